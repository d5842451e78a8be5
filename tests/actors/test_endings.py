"""How `aerodaas run` ends: interrupted, or by an application that raises in mid-flight."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import psutil
import pytest
from flying import FLAT

from aerodaas.recording.reader import Recording
from aerodaas.recording.report.flight import RecordedFlight

pytestmark = [pytest.mark.slow, pytest.mark.wall_clock]

_ROOT = Path(__file__).resolve().parents[2]
# A shell starts what a script runs in its background with Ctrl-C ignored.
_MAIN = """
import signal
from aerodaas.cli.app import main
signal.signal(signal.SIGINT, signal.SIG_IGN)
main()
"""
_APP = """
import time
from aerodaas import AeroNavigation, Environment, NavigationType, Waypoint

env = Environment("environment.json")
drone = env.get_robot_by_id("drone")
drone.navigate(AeroNavigation(NavigationType.DISTANCE_DRIVEN, [Waypoint("far", 900, 0, 2)]))
drone.start_mission(wait=False)
odometry = drone.get_sensor_by_id("odom_drone")
while odometry.poll(10.0).height < 1.0:
    time.sleep(0.05)
print("in the air", flush=True)
"""


@contextmanager
def running(folder: Path, ending: str, *more: str) -> Iterator[subprocess.Popen[str]]:
    """Run an application that is in the air when it comes to its `ending`, in real time."""
    (folder / "environment.json").write_text(json.dumps(FLAT))
    (folder / "app.py").write_text(_APP + ending)
    words = ["run", str(folder / "app.py"), "--speed", "1", "--record", str(folder / "out"), *more]
    with subprocess.Popen(
        [sys.executable, "-c", _MAIN, *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=_ROOT,
        env={**os.environ, "PYTHONPATH": str(_ROOT)},
        start_new_session=True,
    ) as process:
        yield process
        process.kill()


def landed(folder: Path) -> RecordedFlight:
    """What was recorded, closed properly, of a drone that came down."""
    with Recording.open(folder / "out" / "flight.mcap") as recording:
        assert recording.complete
        flight = RecordedFlight.read(recording)
    robot = flight.robots["drone"]
    assert robot.outcome.startswith("landed")
    assert robot.position[:, 2].max() > 1.0
    assert robot.position[-1, 2] < 0.2
    return flight


def airborne(process: subprocess.Popen[str]) -> list[str]:
    """Wait until the application says that it is in the air; returns its lines so far."""
    assert process.stdout is not None
    said = []
    for line in process.stdout:
        said.append(line)
        if "in the air" in line:
            return said
    raise AssertionError("".join(said) + process.communicate()[1])


def everyone(process: subprocess.Popen[str]) -> list[psutil.Process]:
    """The process and all that it has started."""
    parent = psutil.Process(process.pid)
    return [parent, *parent.children(recursive=True)]


def require_gone(processes: list[psutil.Process], seconds: float) -> None:
    """Wait until all of these have ended."""
    deadline = time.monotonic() + seconds
    while any(one.is_running() and one.status() != psutil.STATUS_ZOMBIE for one in processes):
        assert time.monotonic() < deadline, [one for one in processes if one.is_running()]
        time.sleep(0.2)


@pytest.mark.parametrize(
    ("sent", "code", "reason"),
    [
        (signal.SIGINT, 130, "interrupted from the keyboard"),
        (signal.SIGTERM, 143, "received SIGTERM"),
        (signal.SIGHUP, 129, "received SIGHUP"),
    ],
    ids=["Ctrl-C", "terminated", "terminal closed"],
)
def test_an_interrupted_run_lands(
    tmp_path: Path, sent: signal.Signals, code: int, reason: str
) -> None:
    """The drone lands, the recording is closed, and no process is left."""
    with running(tmp_path, "drone.wait()") as process:
        said_first = airborne(process)
        assert said_first[0] == "starting Ray …\n"
        processes = everyone(process)
        assert len(processes) > 3
        if sent is signal.SIGINT:
            os.killpg(process.pid, sent)  # as a terminal does: to all of them
        else:
            process.send_signal(sent)
        _, said = process.communicate(timeout=120)
        assert process.returncode == code, said
    assert "Traceback" not in said
    flight = landed(tmp_path)
    reasons = [band.reason for band in flight.robots["drone"].bands if band.state == "landing"]
    assert reasons == [reason]
    require_gone(processes, 20.0)


@pytest.mark.parametrize(
    ("sent", "code", "reason"),
    [
        (signal.SIGINT, 130, "interrupted from the keyboard"),
        (signal.SIGTERM, 143, "received SIGTERM"),
    ],
    ids=["Ctrl-C", "terminated"],
)
def test_a_signal_in_its_own_code(
    tmp_path: Path, sent: signal.Signals, code: int, reason: str
) -> None:
    """A signal that comes before `wait()`, or without one, is the reason all the same."""
    with running(tmp_path, "time.sleep(300)") as process:
        airborne(process)
        process.send_signal(sent)
        _, said = process.communicate(timeout=120)
        assert process.returncode == code, said
    flight = landed(tmp_path)
    reasons = [band.reason for band in flight.robots["drone"].bands if band.state == "landing"]
    assert reasons == [reason]


def test_a_head_that_hangs_keeps_nobody_waiting(tmp_path: Path) -> None:
    """It is told in flight; after the landing the application ends, and no process is left."""
    ending = "time.sleep(10); drone.end_mission(); drone.wait()"
    with running(tmp_path, ending, "--no-view") as process:
        airborne(process)
        processes = everyone(process)
        (head,) = (one for one in processes if one.name() == "gcs_server")
        head.suspend()
        _, said = process.communicate(timeout=120)
        assert process.returncode == 0, said
    assert "the flight goes on without it" in said
    assert str(tmp_path / "out" / "flight.mcap") in said
    landed(tmp_path)
    require_gone(processes, 20.0)


def test_a_second_interrupt_leaves_the_drone_to_itself(tmp_path: Path) -> None:
    """The application returns at once and says so; the drone lands, and then nothing is left."""
    with running(tmp_path, "drone.wait()") as process:
        airborne(process)
        processes = everyone(process)
        os.killpg(process.pid, signal.SIGINT)
        time.sleep(1.0)
        os.killpg(process.pid, signal.SIGINT)
        _, said = process.communicate(timeout=60)
        assert process.returncode == 130, said
    assert "a drone is still flying: it comes down by itself" in said
    assert str(tmp_path / "out" / "flight.mcap") in said
    assert "Traceback" not in said
    require_gone(processes, 120.0)
    landed(tmp_path)


def test_rays_own_words_do_not_reach_the_terminal(tmp_path: Path) -> None:
    """Of processes that die in flight people are told by us, in a line each."""
    with running(tmp_path, "drone.wait()", "--no-view") as process:
        airborne(process)
        for one in everyone(process):
            with contextlib.suppress(psutil.Error):
                if " ".join(one.cmdline()).startswith("ray::RecorderActor"):
                    one.kill()
        time.sleep(8.0)
        process.send_signal(signal.SIGTERM)
        rest, said = process.communicate(timeout=120)
    assert "the actor edge died" in said
    assert "edge is back after" in said
    for text in (rest, said):
        assert "raylet" not in text
        assert "ray." not in text
        assert "worker" not in text


def test_an_application_that_leaves_the_cluster_first(tmp_path: Path) -> None:
    """There is nobody left to talk to: it ends, and starts no other Ray to look for its drone."""
    leaving = "import ray; ray.shutdown()"
    with running(tmp_path, leaving) as process:
        _, said = process.communicate(timeout=60)
    assert "Traceback" not in said
    assert "local Ray instance" not in said
    assert process.returncode == 0
