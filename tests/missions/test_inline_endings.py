"""How a flight in simulated time ends before its mission does."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import ClassVar

import pytest
from flying import FLAT, Flyer, hop

from aerodaas import Analytics, Environment, Odometry
from aerodaas.analytics.base import Context
from aerodaas.errors import MissionError
from aerodaas.messages.readings import Readings
from aerodaas.recording.reader import Recording
from aerodaas.recording.report.flight import RecordedFlight

pytestmark = pytest.mark.wall_clock

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


@contextmanager
def flying_when(folder: Path, application: str, said: str) -> Iterator[subprocess.Popen[str]]:
    """The process of an application that flies, once it has said so."""
    (folder / "environment.json").write_text(json.dumps(FLAT))
    (folder / "app.py").write_text(application)
    with subprocess.Popen(
        [sys.executable, "-m", "aerodaas", "run", "app.py", "--no-view", "--record", "out"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=folder,
    ) as process:
        assert process.stdout is not None
        assert any(said in line for line in process.stdout)
        yield process


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
    with flying_when(tmp_path, _APP + ending, "in the air") as process:
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


_HANGING = """
import time
from aerodaas import AeroNavigation, Analytics, Environment, NavigationType, Odometry, Waypoint

class Hanging(Analytics[str]):
    accepts = (Odometry,)
    def process(self, item, context):
        if context.now() > 3e9:
            print("hanging", flush=True)
            time.sleep(1000)

env = Environment("environment.json")
drone = env.get_robot_by_id("drone")
Hanging().analyse(drone.get_sensor_by_id("odom_drone").get_data_stream())
drone.navigate(AeroNavigation(NavigationType.DISTANCE_DRIVEN, [Waypoint("a", 9, 0, 2)]))
drone.start_mission()
"""


@pytest.mark.slow
def test_an_analysis_that_hangs_is_named_after_a_second_interrupt(tmp_path: Path) -> None:
    """The run ends without it, and its recording is closed."""
    with flying_when(tmp_path, _HANGING, "hanging") as process:
        for _ in range(2):
            process.send_signal(signal.SIGINT)
            time.sleep(1.0)
        _, errors = process.communicate(timeout=60)
    assert process.returncode == 130, errors
    assert "drone/hanging" in errors
    assert "did not return within" in errors
    with Recording.open(tmp_path / "out" / "flight.mcap") as recording:
        assert recording.complete


class Exiting(Analytics[Readings]):
    """Calls `sys.exit`."""

    accepts: ClassVar[tuple[type, ...]] = (Odometry,)

    def process(self, item: Odometry, context: Context) -> Readings:  # noqa: ARG002
        """End the program, as its author thought."""
        sys.exit("not in the mood")


def test_an_analysis_that_exits_ends_alone(flyer: Flyer) -> None:
    """The mission goes on to its end, which says what the analysis did."""

    def build(env: Environment) -> None:
        drone = env.get_robot_by_id("drone")
        Exiting().analyse(drone.get_sensor_by_id("odom_drone").get_data_stream())
        drone.navigate(hop((4, 0)))

    with pytest.raises(MissionError, match="drone/exiting: SystemExit: not in the mood"):
        flyer.fly(build)
    with Recording.open(flyer.folder / "flight" / "flight.mcap") as recording:
        assert RecordedFlight.read(recording).robots["drone"].visited == ("wp0",)
