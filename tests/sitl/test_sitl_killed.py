"""`kill -9` of an application that flies a real PX4 or ArduCopter through Ray, on one machine."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import psutil
import pytest

from aerodaas.recording.reader import Recording
from sitl.autopilot import Autopilot
from sitl.flights import robot_at
from sitl.relay import Relay

pytestmark = [pytest.mark.sitl, pytest.mark.slow, pytest.mark.timeout(420)]

HERE = Path(__file__).parent


def wait_for(happened: Callable[[], bool], seconds: float) -> bool:
    """Wait up to `seconds` for something to happen."""
    end = time.monotonic() + seconds
    while not happened() and time.monotonic() < end:
        time.sleep(0.2)
    return happened()


def test_application_killed(autopilot: Autopilot, tmp_path: Path) -> None:
    """The drone's actor flies it home and lands it, closes the recording, and all is gone."""
    relay = Relay(autopilot.url)
    witness = relay.witness
    robot = robot_at(relay.url).model_dump(mode="json", exclude_unset=True)
    environment = tmp_path / "environment.json"
    environment.write_text(json.dumps({"robots": [robot]}))
    command = [sys.executable, "-m", "aerodaas", "run", str(HERE / "far_app.py")]
    command += ["--env", str(environment), "--no-view", "--record", str(tmp_path / "flight")]
    application = subprocess.Popen(command)
    try:
        assert wait_for(lambda: witness.away > 8.0, 180.0), witness.modes
        left = set(psutil.Process(application.pid).children(recursive=True))
        application.kill()
        application.wait()
        assert wait_for(lambda: not witness.armed, 180.0)
        gone = wait_for(lambda: not any(process.is_running() for process in left), 60.0)
        print(  # noqa: T201 - the result itself
            f"\napplication killed: {autopilot.family}, modes {witness.modes}, "
            f"down {witness.away:.1f} m from home, all processes gone: {gone}"
        )
        assert witness.away < 2.0
        assert gone
        with Recording.open(tmp_path / "flight" / "flight.mcap") as recording:
            assert recording.complete
    finally:
        application.kill()
        application.wait()
        relay.close()
