"""How a flight in simulated time ends before its mission does."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from flying import FLAT

from aerodaas.recording.reader import Recording
from aerodaas.recording.report.flight import RecordedFlight

_APP = """
import sys
import time
from aerodaas import AeroNavigation, Environment, NavigationType, Waypoint

env = Environment("environment.json")
drone = env.get_robot_by_id("drone")
far = Waypoint("far", 900, 0, 2, hover_duration=900)
drone.navigate(AeroNavigation(NavigationType.DISTANCE_DRIVEN, [far]))
drone.start_mission(wait=False)
odometry = drone.get_sensor_by_id("odom_drone")
while odometry.poll(10.0).height < 1.0:
    pass
print("in the air", flush=True)
"""


@pytest.mark.parametrize(
    ("ending", "sent", "code", "reason"),
    [
        ("drone.wait()", signal.SIGINT, 130, "interrupted from the keyboard"),
        ("time.sleep(300)", signal.SIGTERM, 143, "received SIGTERM"),
        ("1 / 0", None, 1, "the application ended"),
        ("assert 'ray' not in sys.modules", None, 0, "the application ended"),
    ],
    ids=["Ctrl-C", "terminated", "an error of its own", "without waiting"],
)
def test_the_drone_lands_and_its_recording_is_closed(
    tmp_path: Path, ending: str, sent: signal.Signals | None, code: int, reason: str
) -> None:
    """However the application ends; its exit code says how, and no Ray is loaded."""
    (tmp_path / "environment.json").write_text(json.dumps(FLAT))
    (tmp_path / "app.py").write_text(_APP + ending)
    with subprocess.Popen(
        [sys.executable, "-m", "aerodaas", "run", "app.py", "--no-view", "--record", "out"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=tmp_path,
    ) as process:
        assert process.stdout is not None
        assert any("in the air" in line for line in process.stdout)
        if sent is not None:
            process.send_signal(sent)
        _, errors = process.communicate(timeout=60)
    assert process.returncode == code, errors
    assert "Traceback" not in errors
    with Recording.open(tmp_path / "out" / "flight.mcap") as recording:
        assert recording.complete
        drone = RecordedFlight.read(recording).robots["drone"]
    assert [band.reason for band in drone.bands if band.state == "landing"] == [reason]
    assert drone.position[-1, 2] < 0.2
