"""`kill -9` of an application that flies a real PX4 or ArduCopter through Ray, on one machine."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import psutil
import pytest
from typing_extensions import Self

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


class Application:
    """A run of `far_app.py` through a relay, with these `settings` of its driver."""

    def __init__(self, autopilot: Autopilot, folder: Path, **settings: object) -> None:
        self.relay = Relay(autopilot.url)
        robot = robot_at(self.relay.url, settings).model_dump(mode="json", exclude_unset=True)
        environment = folder / "environment.json"
        environment.write_text(json.dumps({"robots": [robot]}))
        command = [sys.executable, "-m", "aerodaas", "run", str(HERE / "far_app.py")]
        command += ["--env", str(environment), "--no-view", "--record", str(folder / "flight")]
        variables = {**os.environ, "XDG_STATE_HOME": str(folder / "state")}
        self._process = subprocess.Popen(command, env=variables)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.wait()
        self.relay.close()

    def kill(self) -> list[psutil.Process]:
        """`kill -9`; the processes that it leaves."""
        left: list[psutil.Process] = psutil.Process(self._process.pid).children(recursive=True)
        self._process.kill()
        self._process.wait()
        return left


def test_application_killed(autopilot: Autopilot, tmp_path: Path) -> None:
    """The drone's actor flies it home and lands it, closes the recording, and all is gone."""
    with Application(autopilot, tmp_path) as application:
        witness = application.relay.witness
        assert wait_for(lambda: witness.away > 8.0, 180.0), witness.modes
        left = application.kill()
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


@pytest.mark.parametrize("way", ["return", "retrace"])
def test_everything_killed(autopilot: Autopilot, tmp_path: Path, way: str) -> None:
    """`kill -9` of the application and of every actor: with a fallback the vehicle comes home."""
    if way != "return" and autopilot.family == "px4":
        pytest.skip("PX4 returns straight")
    with Application(autopilot, tmp_path, fallback="set", way_home=way) as application:
        witness = application.relay.witness
        assert wait_for(lambda: witness.away > 12.0, 180.0), witness.modes
        for process in application.kill():
            with contextlib.suppress(psutil.NoSuchProcess):
                process.kill()
        there = witness.away
        end = time.monotonic() + 180.0
        while witness.armed and time.monotonic() < end:
            time.sleep(0.2)
        print(  # noqa: T201 - the result itself
            f"\neverything killed: {autopilot.family}, {way}, {there:.1f} m away, modes "
            f"{witness.modes}, down {witness.away:.1f} m from home, "
            f"texts {witness.texts[-8:]}"
        )
        assert not witness.armed
        assert witness.away < 2.0
