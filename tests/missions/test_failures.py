"""Whatever fails around the drone's actor, the drone comes down safely and says why."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest
from faulty import DyingScheduler, HangingScheduler, Mortal, RaisingScheduler, Stuck
from flying import FLAT, Flyer, flight_of, hop, recorded, robot
from ray.cluster_utils import Cluster
from scripted import RemoteUser, free_port

from aerodaas import AeroNavigation, Environment, NavigationType, TrajectoryScheduler
from aerodaas.environment.run import Run
from aerodaas.errors import MissionError
from aerodaas.recording.reader import Recording
from aerodaas.recording.report.flight import RecordedFlight

pytestmark = pytest.mark.wall_clock

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).resolve().parent


def environment(silence_return: float = 40.0, **more: Any) -> dict[str, Any]:  # noqa: ANN401
    """A drone that waits `silence_return` seconds for silent navigation."""
    limits = {"cruise_speed": 3.0, "takeoff_height": 2.0, "silence_return": silence_return}
    sensors = [{"id": "odom", "type": "odometry", "rate": 10}]
    drone = robot(limits=limits, sensors=sensors, mission={"plan_timeout": 2.0})
    return {**FLAT, "robots": [drone], **more}


def states(flight: RecordedFlight) -> list[str]:
    """The states that the mission went through."""
    return [state for state, _ in groupby(band.state for band in flight.robots["drone"].bands)]


def landed_at_home(flight: RecordedFlight) -> bool:
    """Whether the drone ended on the ground within two metres of its take-off."""
    mission = flight.robots["drone"]
    near = bool(np.linalg.norm(mission.position[-1]) < 2.0)
    return mission.outcome.startswith("landed") and near


def alerts(flight: RecordedFlight) -> dict[str, str]:
    """The alerts recorded, by kind, one a line."""
    found: dict[str, str] = defaultdict(str)
    for _, kind, text in flight.alerts:
        found[kind] += f"{text}\n"
    return found


@pytest.mark.slow
def test_hung_analysis(flyer: Flyer) -> None:
    """The drone holds, returns after the configured silence, and the recording names who hung."""

    def build(env: Environment) -> None:
        drone = env.get_robot_by_id("drone")
        stream = Stuck().analyse(drone.get_sensor_by_id("odom").get_data_stream())
        drone.navigate(AeroNavigation(NavigationType.ANALYTICS_DRIVEN, stream))

    flight = recorded(flyer.fly(build, environment(), speed=5.0))
    assert landed_at_home(flight)
    assert states(flight)[-5:] == ["following", "holding", "returning", "landing", "landed"]
    assert "navigation has been silent" in flight.robots["drone"].outcome
    assert "drone/stuck has been at one item" in alerts(flight)["analysis_hung"]


@pytest.mark.slow
def test_killed_analysis_is_restarted(flyer: Flyer) -> None:
    """The drone holds until the analysis is back, then follows it again until it says land."""
    marker = flyer.folder / "died"

    def build(env: Environment) -> None:
        drone = env.get_robot_by_id("drone")
        analysis = Mortal(marker).trigger(drone.end_mission, when=lambda steps: not len(steps))
        stream = analysis.analyse(drone.get_sensor_by_id("odom").get_data_stream())
        drone.navigate(AeroNavigation(NavigationType.ANALYTICS_DRIVEN, stream))

    flight = recorded(flyer.fly(build, environment(silence_return=100.0), speed=5.0))
    assert marker.exists()
    assert flight.robots["drone"].outcome == "landed: an analysis asked to land"
    assert states(flight)[-5:] == ["following", "holding", "following", "landing", "landed"]
    assert "analytics/drone/mortal died" in alerts(flight)["actor_lost"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scheduler", "reason"),
    [
        (RaisingScheduler, "ZeroDivisionError: a bug of the user's own"),
        (HangingScheduler, "no plan within 2 s: flying the order given"),
        (DyingScheduler, "the scheduler's actor died"),
    ],
)
def test_scheduler_fails(flyer: Flyer, scheduler: type[TrajectoryScheduler], reason: str) -> None:
    """Without a plan the order given is flown; the setpoints never stop coming."""

    def build(env: Environment) -> None:
        env.set_trajectory_scheduler(scheduler(env))
        env.get_robot_by_id("drone").navigate(hop((20, 0), (20, 20), (0, 20)))

    flight = recorded(flyer.fly(build, environment(), speed=5.0))
    assert landed_at_home(flight)
    assert flight.robots["drone"].visited == ("wp0", "wp1", "wp2")
    assert reason in alerts(flight)["scheduler"]
    # Mission time between the drone's states, of which five seconds pass in one: a late turn is the
    # host's; a loop that waited for the plan, or for its actor's new start, would stop for longer.
    assert np.diff(flight.robots["drone"].time).max() < 5.0


@pytest.mark.wall_clock
@pytest.mark.parametrize("pause", [0.0, pytest.param(7.0, marks=pytest.mark.slow)])
def test_drone_actor_dies(flyer: Flyer, pause: float) -> None:
    """Nobody can fly any more: the application ends with the reason, and nothing is left over.

    An application that stood still before is not taken for the reason, while its run goes on.
    """
    with flyer.options(speed=5.0):
        env = Environment(flyer.write(environment()))
        env.get_robot_by_id("drone").navigate(hop((300, 0)))
        run = env.launch()
        assert wait_for(lambda: bool(run.poll().reports["drone/drone"].values), 20.0)
        with run._polling:
            time.sleep(pause)
        time.sleep(1.0)
        run.poll()
        os.kill(flight_of(run).infos()["drone/drone"].pid, signal.SIGKILL)
        with pytest.raises(
            MissionError, match="the actor of drone died: a simulated drone ends with its process"
        ):
            run.wait()


@pytest.mark.slow
def test_a_drone_that_hangs_is_told_though_nobody_waits(
    flyer: Flyer, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its process stands still: the terminal says so before `wait`, and says when it is back."""
    told: list[str] = []

    def heard(words: str) -> bool:
        told.append(capsys.readouterr().err)
        return words in "".join(told)

    with flyer.options(speed=2.0, simulated_time=False):
        env = Environment(flyer.write(environment()))
        drone = env.get_robot_by_id("drone")
        drone.navigate(hop((300, 0)))
        env.start_mission(wait=False)
        run = env.run
        assert run is not None
        assert wait_for(lambda: bool(run.poll().reports["drone/drone"].values), 20.0)
        pid = flight_of(run).infos()["drone/drone"].pid
        os.kill(pid, signal.SIGSTOP)
        try:
            assert wait_for(lambda: heard("drone/drone has not answered for"), 30.0)
        finally:
            os.kill(pid, signal.SIGCONT)
        assert wait_for(lambda: heard("drone/drone answers again after"), 30.0)
        drone.end_mission()
        env.wait()
    silent = alerts(recorded(run))["actor_silent"]
    assert "take over by other means" in silent


@pytest.mark.slow
def test_a_recorder_that_is_killed_and_then_hangs(flyer: Flyer) -> None:
    """Each is told, what was recorded is named, and a recording that is cut is a failed run."""
    with flyer.options(speed=2.0, simulated_time=False):
        env = Environment(flyer.write(environment()))
        drone = env.get_robot_by_id("drone")
        drone.navigate(hop((300, 0)))
        run = env.launch()
        flight = flight_of(run)
        assert wait_for(lambda: bool(run.poll().reports["edge"].values), 20.0)
        os.kill(first := flight.infos()["edge"].pid, signal.SIGKILL)
        assert wait_for(lambda: flight.infos()["edge"].pid != first, 60.0)
        assert wait_for(lambda: told(run, "edge is back after"), 20.0)
        assert wait_for(lambda: len(flight.recordings) == 2, 20.0)
        os.kill(second := flight.infos()["edge"].pid, signal.SIGSTOP)
        try:
            assert wait_for(lambda: told(run, "edge has not answered for"), 30.0)
            drone.end_mission()
            with pytest.raises(MissionError, match="the recorder did not answer") as failed:
                run.wait()
        finally:
            os.kill(second, signal.SIGKILL)
    folder = flyer.folder / "flight"
    assert flight.recordings == (folder / "flight.mcap", folder / "flight.2.mcap")
    assert all(path.exists() and str(path) in str(failed.value) for path in flight.recordings)


def told(run: Run, words: str) -> bool:
    """Whether an alert of the flight has these words by now."""
    return any(words in alert.text for alert in run.poll().alerts)


@pytest.mark.slow
def test_a_drone_whose_actor_died_keeps_no_other_in_the_air(flyer: Flyer) -> None:
    """The run has failed: every drone that can still be told lands."""
    limits = {"cruise_speed": 3.0, "takeoff_height": 2.0}
    robots = [robot(name, limits=limits) for name in ("first", "second")]
    with flyer.options(speed=2.0, simulated_time=False):
        env = Environment(flyer.write({**environment(), "robots": robots}))
        for drone in env.get_env_robots():
            drone.navigate(hop((300, 0)))
        run = env.launch()
        assert wait_for(lambda: bool(run.poll().reports["drone/first"].values), 20.0)
        os.kill(flight_of(run).infos()["drone/first"].pid, signal.SIGKILL)
        with pytest.raises(MissionError, match="the actor of first died"):
            run.wait()
    path = flyer.folder / "flight" / "flight.mcap"
    assert wait_for(lambda: closed(path), 60.0)
    with Recording.open(path) as recording:
        flight = RecordedFlight.read(recording)
    reasons = [band.reason for band in flight.robots["second"].bands if band.state == "landing"]
    assert reasons == ["the run failed"]


def closed(path: Path) -> bool:
    """Whether a recording was closed properly."""
    with Recording.open(path) as recording:
        return recording.complete


@pytest.fixture
def cluster(runtime: None) -> Iterator[Cluster]:  # noqa: ARG001 - its PYTHONPATH goes to the actors
    """A Ray that outlives its applications, started by somebody else."""
    arguments = {
        "num_cpus": 2,
        "resources": {"edge": 1, "cloud": 1},
        "include_dashboard": False,
        "object_store_memory": 128 * 2**20,
    }
    cluster = Cluster(initialize_head=True, connect=False, head_node_args=arguments)
    yield cluster
    cluster.shutdown()


def start_application(
    flyer: Flyer, port: int, *arguments: str, stderr: int | None = None
) -> subprocess.Popen[bytes]:
    """Start the long mission in a process of its own."""
    path = flyer.write(environment(remote={"port": port}))
    command = [sys.executable, "-m", "aerodaas", "run", str(HERE / "remote_app.py")]
    command += ["--env", str(path), "--speed", "5", "--no-view"]
    command += ["--record", str(flyer.folder / "flight"), *arguments]
    return subprocess.Popen(command, cwd=ROOT, stderr=stderr)


def actors_below(pid: int) -> set[psutil.Process]:
    """Actors of the drone, recorder and analytics among a process' descendants."""
    names = ("ray::DroneActor", "ray::RecorderActor", "ray::NodeActor")
    found = set()
    for process in psutil.Process(pid).children(recursive=True):
        with contextlib.suppress(psutil.Error):
            if " ".join(process.cmdline()).startswith(names):
                found.add(process)
    return found


def gone(processes: set[psutil.Process]) -> bool:
    """Whether none of them runs any more."""
    return not any(process.is_running() for process in processes)


def wait_for(happened: Callable[[], bool], seconds: float) -> bool:
    """Wait up to `seconds` for something to happen."""
    end = time.monotonic() + seconds
    while not happened() and time.monotonic() < end:
        time.sleep(0.2)
    return happened()


@pytest.mark.slow
def test_application_killed_in_a_cluster(flyer: Flyer, cluster: Cluster) -> None:
    """The drone comes home by itself, the recording is closed, and no actor is left over."""
    port = free_port()
    before = actors_below(os.getpid())
    application = start_application(flyer, port, "--address", str(cluster.address))
    actors: set[psutil.Process] = set()

    def kill_and_watch(user: RemoteUser) -> None:
        user.until(lambda status: status.mission.distance > 20.0)
        actors.update(actors_below(os.getpid()) - before)
        application.kill()
        application.wait()

    with RemoteUser(port, kill_and_watch):
        pass
    assert len(actors) == 2
    assert wait_for(lambda: gone(actors), 60.0)
    with Recording.open(flyer.folder / "flight" / "flight.mcap") as recording:
        assert recording.complete
        flight = RecordedFlight.read(recording)
    assert landed_at_home(flight)
    assert "the application's process is gone" in alerts(flight)["application_lost"]


@pytest.mark.slow
def test_application_suspended_on_one_machine(flyer: Flyer) -> None:
    """The drone comes home meanwhile; resumed, the application says what happened, in its words."""
    port = free_port()
    application = start_application(flyer, port, stderr=subprocess.PIPE)
    user = RemoteUser(port, lambda _: None)
    user.until(lambda status: status.mission.distance > 20.0)
    actors = actors_below(application.pid)
    application.send_signal(signal.SIGSTOP)
    assert wait_for(lambda: gone(actors), 90.0)
    application.send_signal(signal.SIGCONT)
    said = application.communicate(timeout=60)[1].decode()
    assert application.returncode not in {0, None}
    assert "this application did not run for" in said
    assert "after which a drone comes home by itself" in said
    assert "ray.kill" not in said
    assert "Traceback" not in said
    with Recording.open(flyer.folder / "flight" / "flight.mcap") as recording:
        flight = RecordedFlight.read(recording)
    assert landed_at_home(flight)
    assert "the application's process is gone" in alerts(flight)["application_lost"]
