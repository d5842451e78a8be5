"""Parts of a run that die or hang on one machine, with no cluster around them."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import psutil
import pytest
from faulty import Forward
from flying import FLAT, Flyer, flight_of, hop, robot
from required import needs_root

from aerodaas import AeroNavigation, Environment, NavigationType
from aerodaas.actors.cluster.ray_process import LOCKS, VARIABLE
from aerodaas.actors.run import flight
from aerodaas.actors.run.actor_state import ask
from aerodaas.environment.run import Run
from aerodaas.errors import MissionError
from aerodaas.messages.mission import MissionState
from aerodaas.recording.reader import Recording
from aerodaas.recording.report.flight import RecordedFlight
from tools.namespaces.machine import run

pytestmark = pytest.mark.wall_clock

ROOT = Path(__file__).resolve().parents[2]
CAMERA = {"id": "cam", "type": "camera", "rate": 5, "settings": {"width": 64, "height": 36}}


def with_camera(**more: Any) -> dict[str, Any]:  # noqa: ANN401
    """A drone with a small camera."""
    return {**FLAT, "robots": [robot(sensors=[CAMERA])], "recording": {"images": "none"}, **more}


def hover(env: Environment) -> None:
    """Stay in the air, its camera on."""
    drone = env.get_robot_by_id("drone")
    drone.get_sensor_by_id("cam").get_data_stream()
    drone.navigate(hop((2, 0), hover=900))


def until(run: Run, holds: Callable[[], bool], seconds: float = 60.0) -> None:
    """Wait until `holds`; the mission must go on meanwhile."""
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end, "it never happened"
        assert not run.poll().over, "the mission is over"
        time.sleep(0.05)


def process_of(run: Run, actor: str) -> psutil.Process:
    """The process of an actor."""
    return psutil.Process(flight_of(run).infos()[actor].pid)


def holders(folder: Path) -> set[int]:
    """Processes that hold the lock of a run, by which they keep the local Ray."""
    inodes = {f":{path.stat().st_ino}" for path in folder.iterdir()}
    locks = [line.split() for line in Path("/proc/locks").read_text().splitlines()]
    return {int(words[4]) for words in locks if any(words[5].endswith(one) for one in inodes)}


def state_of(run: Run) -> MissionState:
    """The mission's state."""
    return run.poll().robots["drone"].mission.state


def alerts(flight: RecordedFlight) -> dict[str, list[str]]:
    """Texts of the alerts recorded, by kind."""
    found: dict[str, list[str]] = defaultdict(list)
    for _, kind, text in flight.alerts:
        found[kind].append(text)
    return found


@pytest.mark.slow
def test_a_run_is_watched_before_its_drones_fly(flyer: Flyer) -> None:
    """An application that is suspended at once sends no later heartbeat to a reaper that starts."""
    with flyer.flying(hover, with_camera(), speed=1.0) as env:
        run = env.launch()
        recorder = process_of(run, "edge")
        assert recorder.pid in holders(Path(recorder.environ()[VARIABLE]) / LOCKS)
        until(run, lambda: state_of(run) is MissionState.ENROUTE)
        env.get_robot_by_id("drone").end_mission()


def test_the_actor_of_recorder_and_steering_camera_dies(flyer: Flyer) -> None:
    """The drone holds until there are pictures again.

    Both files can be read, and the second one says what happened.
    """

    def build(env: Environment) -> None:
        drone = env.get_robot_by_id("drone")
        frames = drone.get_sensor_by_id("cam").get_data_stream()
        steering = Forward().deploy(env.get_compute_resource_by_id("edge")).analyse(frames)
        drone.navigate(AeroNavigation(NavigationType.ANALYTICS_DRIVEN, steering))

    content = with_camera()
    content["robots"][0]["limits"] = {**content["robots"][0]["limits"], "silence_return": 60.0}
    with flyer.flying(build, content, speed=1.0) as env:
        run = env.launch()
        until(run, lambda: state_of(run) is MissionState.FOLLOWING)
        shared = process_of(run, "edge")
        time.sleep(2.0)
        shared.kill()
        until(run, lambda: state_of(run) is MissionState.HOLDING)
        until(run, lambda: state_of(run) is MissionState.FOLLOWING)
        until(run, lambda: run.reports()["edge"].phase == "running")
        assert process_of(run, "edge").pid != shared.pid
        env.get_robot_by_id("drone").end_mission()
    first = flyer.folder / "flight" / "flight.mcap"
    with Recording.open(first) as recording:
        assert not recording.complete
        assert RecordedFlight.read(recording).robots["drone"].position[:, 2].max() > 0.5
    with Recording.open(first.with_name("flight.2.mcap")) as recording:
        assert recording.complete
        flight = RecordedFlight.read(recording)
    assert flight.robots["drone"].outcome.startswith("landed")
    assert any("edge is back after" in text for text in alerts(flight)["actor_back"])


@pytest.mark.slow
def test_the_orphan_reaper_outlives_its_host(flyer: Flyer, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is that of the recorder that is restarted; of one that is not, another takes over."""
    monkeypatch.setattr(flight, "_RESTARTS", 1)
    with (
        suppress(MissionError),  # that the recorder died, if it was seen in time
        flyer.flying(hover, with_camera(), speed=1.0) as env,
    ):
        run = env.launch()
        flown = flight_of(run)
        reaper = flown._reaper
        process_of(run, "edge").kill()
        until(run, lambda: run.reports()["edge"].phase == "failed")
        until(run, lambda: run.reports()["edge"].phase == "running")
        assert flown._reaper == reaper
        process_of(run, "edge").kill()
        until(run, lambda: flown._reaper != reaper)
        assert not ask(flown._call_reaper("ending"), 20.0)
        env.get_robot_by_id("drone").end_mission()


_SURVEY = """
from aerodaas import AeroNavigation, Environment, NavigationType, Waypoint

env = Environment("environment.json")
drone = env.get_robot_by_id("drone")
drone.get_sensor_by_id("cam").get_data_stream()
hover = Waypoint("there", 2, 0, 2, hover_duration=8)
drone.navigate(AeroNavigation(NavigationType.DISTANCE_DRIVEN, [hover]))
drone.start_mission()
"""


@needs_root
def test_a_full_disk_is_told_without_a_view(tmp_path: Path) -> None:
    """On standard error, as it happens; the drone flies on and lands, and the run has failed."""
    content = with_camera(recording={"images": "png"})
    content["simulation"] = {**content["simulation"], "world": "field"}
    (tmp_path / "environment.json").write_text(json.dumps(content))
    (tmp_path / "app.py").write_text(_SURVEY)
    disk = tmp_path / "disk"
    disk.mkdir()
    run("mount", "-t", "tmpfs", "-o", "size=200k", "tmpfs", str(disk))
    try:
        words = ["run", str(tmp_path / "app.py"), "--no-view"]
        flown = subprocess.run(
            [sys.executable, "-m", "aerodaas", *words, "--record", str(disk / "out")],
            capture_output=True,
            text=True,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            timeout=120,
            check=False,
        )
        with Recording.open(disk / "out" / "flight.mcap") as recording:
            RecordedFlight.read(recording)
    finally:
        run("umount", str(disk))
    assert "edge: " in flown.stderr
    assert "No space left on device" in flown.stderr
    assert "Traceback" not in flown.stderr
    assert flown.returncode == 1, flown.stderr
    assert str(disk / "out" / "flight.mcap") in flown.stdout
    assert "what it holds so far can be read" in flown.stderr.partition("error: ")[2]
