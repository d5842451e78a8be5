"""The dispatcher in flight: executors that die, a cloud that goes and comes, bad schedulers."""

from __future__ import annotations

import contextlib
import os
import signal
import time
from collections import Counter, defaultdict
from collections.abc import Callable
from typing import Any

import numpy as np
import psutil
import pytest
import schedulers_at_fault
from analyses import FrameNumbers
from flying import Flyer, hop, robot
from hosts import Hand, published

from aerodaas import AeroStreamData, Environment, Frame
from aerodaas.actors.base import NodeActor
from aerodaas.actors.dispatch.dispatcher import LiveDispatcher
from aerodaas.actors.run.flight import Flight
from aerodaas.analytics import SyntheticAnalytics
from aerodaas.clock import NANOSECONDS, SimulatedClock
from aerodaas.config.model import EnvironmentConfig
from aerodaas.environment.run import Run
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Header
from aerodaas.messages.mission import Decision
from aerodaas.recording.reader import Recording
from aerodaas.runtime.dispatch.dispatcher import Managed
from aerodaas.runtime.node import Outlet
from aerodaas.runtime.session import Session
from aerodaas.runtime.stream_names import done_stream, task_stream
from aerodaas.schedulers.analytics.base import (
    MILLISECOND,
    AnalyticsScheduler,
    Profile,
    Resources,
)
from aerodaas.schedulers.analytics.published.dems import Dems

pytestmark = pytest.mark.wall_clock

_CAMERA = {"driver": "simulated", "settings": {"width": 64, "height": 36}}


def _environment(rate: float = 4.0, *, cloud: bool = False, **task: Any) -> dict[str, Any]:  # noqa: ANN401
    """A drone with a camera that one analysis, `model`, watches."""
    clouds = [{"id": "cloud", "kind": "cloud", "executors": 4}] if cloud else []
    return {
        "robots": [robot(sensors=[{"id": "camera", "rate": rate, **_CAMERA}])],
        "compute": [{"id": "edge"}, *clouds],
        "schedulers": {"tasks": {"model": {"benefit": 10, **task}}},
        "recording": {"images": "none"},
        "simulation": {"world": "empty"},
    }


def _build(scheduler: Any, edge_ms: float, cloud_ms: float = 0.0) -> Callable[[Environment], None]:  # noqa: ANN401
    def build(env: Environment) -> None:
        env.set_analytics_scheduler(scheduler)
        drone = env.get_robot_by_id("drone")
        model = SyntheticAnalytics("model", edge_ms, cloud_ms)
        model.isolated = True  # in a process of its own, which a test may kill
        model.deploy(env.get_compute_resource_by_id("edge"))
        model.analyse(drone.get_sensor_by_id("camera").get_data_stream())
        drone.navigate(hop((1, 0), hover=600))

    return build


def _values(env: Environment) -> dict[str, Any]:
    run = env.launch()
    run.poll()
    return run.reports()["dispatcher"].values


def _until(env: Environment, holds: Callable[[dict[str, Any]], bool], seconds: float = 120) -> None:
    """Wait until the dispatcher's figures satisfy `holds`."""
    end = time.monotonic() + seconds
    while not holds(_values(env)):
        assert time.monotonic() < end, f"it never happened: {_values(env)}"
        time.sleep(0.1)


def _pid(env: Environment, name: str) -> int:
    flight = env.launch()._flight
    assert isinstance(flight, Flight)
    return flight.infos()[name].pid


def _process(name: str) -> psutil.Process:
    """The one process below this one that runs the actor class `name`."""
    for process in psutil.Process().children(recursive=True):
        with contextlib.suppress(psutil.Error):
            if " ".join(process.cmdline()).startswith(f"ray::{name}"):
                return process
    raise AssertionError(f"no {name}")


def _decisions(run: Run) -> list[Decision]:
    assert run.recording is not None
    with Recording.open(run.recording) as recording:
        return [record.value for record in recording.records(schemas=["aerodaas.Decision"])]


def _alerts(run: Run) -> dict[str, list[str]]:
    assert run.recording is not None
    found: dict[str, list[str]] = defaultdict(list)
    with Recording.open(run.recording) as recording:
        for record in recording.records(schemas=["aerodaas.Alert"]):
            found[record.value.kind].append(record.value.text)
    return found


def _require_one_end_each(run: Run) -> Counter[str]:
    """No task ended twice; of those that arrived at most the very last are open."""
    decisions = _decisions(run)
    ends = [one for one in decisions if one.action not in {"edge", "cloud"}]
    each = Counter(one.task for one in ends)
    assert max(each.values()) == 1
    values = run.reports()["dispatcher"].values
    assert sum(values["outcomes"].values()) == len(ends)
    assert 0 <= values["tasks"] - len(ends) <= 8
    return Counter(one.action for one in ends)


def test_an_actor_that_is_not_set_up_reports() -> None:
    """Ray has restarted it, and the application asks before it has prepared it anew."""
    environment = EnvironmentConfig.model_validate({"robots": [robot()]})
    actor = NodeActor(Session(environment), "dispatcher")
    report = actor.report()
    assert (report.phase, report.values) == ("new", {})
    assert actor.stop().error is None


def _dispatcher(scheduler: AnalyticsScheduler, edge_time: int) -> LiveDispatcher:
    """A dispatcher of one analysis, whose execution on the edge takes so many milliseconds."""
    environment = EnvironmentConfig.model_validate({"robots": [robot()]})
    deadline = max(1000, 20 * edge_time) * MILLISECOND
    profile = Profile("m", 10.0, deadline, edge_time * MILLISECOND, NANOSECONDS)
    managed = Managed("m", ("drone/camera",), profile, offloadable=False)
    return LiveDispatcher(Session(environment), scheduler, (managed,), Resources(cloud_slots=0))


def _frame(number: int, stamp: int) -> Message[Frame]:
    pixels = np.zeros((2, 2, 3), np.uint8)
    frame = Frame(Header(number, stamp, "drone/camera"), pixels)
    return published("drone/camera", frame, stamp, number)


@pytest.mark.parametrize(
    ("edge_time", "patience"), [(10, 1000), (250, 1000), (251, 1004), (3000, 12_000)]
)
def test_an_execution_on_the_edge_has_four_times_its_time(edge_time: int, patience: int) -> None:
    """But a second at least, for a first inference takes longer; it is back once it answers."""
    dispatcher = _dispatcher(Dems(), edge_time)
    host = Hand()
    dispatcher.open(host)
    dispatcher.start(SimulatedClock())
    tasks = dispatcher.step(0, [_frame(0, 0)])
    for milliseconds, alerts in ((patience, []), (patience + 1, ["executor_lost"])):
        host.time = milliseconds * MILLISECOND
        dispatcher.step(host.time, [])
        assert [alert.kind for alert in host.alerts] == alerts
    [task] = [message for message in tasks if message.stream == task_stream("m")]
    late = Outlet(done_stream("m")).derive(1, task, 0, host.time)
    dispatcher.step(host.time, [late])
    assert [alert.kind for alert in host.alerts] == ["executor_lost", "executor_back"]
    dispatcher.close()


@pytest.mark.parametrize(
    "speed",
    [
        pytest.param(None, id="simulated time"),
        pytest.param(1.0, id="real time", marks=pytest.mark.slow),
    ],
)
def test_tasks_name_their_frames(flyer: Flyer, speed: float | None) -> None:
    """Each analysis works on the frame that its task is about, and no frame is published again.

    In simulated time what an execution takes of the host's counts for nothing: no task waits.
    """

    def build(env: Environment) -> None:
        env.set_analytics_scheduler("edf")
        drone = env.get_robot_by_id("drone")
        camera = drone.get_sensor_by_id("camera").get_data_stream()
        for name in ("model", "other"):
            analysis = FrameNumbers()
            analysis.name = name
            analysis.deploy(env.get_compute_resource_by_id("edge")).analyse(camera)
        drone.navigate(hop((3, 0), hover=3))

    content = _environment(10.0, edge_time=20, deadline=400)
    content["schedulers"]["tasks"]["other"] = {"benefit": 10, "edge_time": 20, "deadline": 400}
    run = flyer.fly(build, content, speed=speed)
    assert run.recording is not None
    with Recording.open(run.recording) as recording:
        results = list(recording.records(schemas=["aerodaas.Value"]))
        assert len(results) > 20
        assert all(one.value.value["values"]["stamp"] == one.captured for one in results)
    if speed is None:
        ends = [one for one in _decisions(run) if one.action != "edge"]
        assert {(one.action, one.values["waited_ms"]) for one in ends} == {("done", 0.0)}
    else:
        assert run.reports()["dispatcher"].values["frames_carried"] == 0


@pytest.mark.slow
def test_an_executor_that_dies_is_restarted_and_its_task_has_failed(flyer: Flyer) -> None:
    """With the reason; those that come once the executor is back are done."""
    content = _environment(1.0, edge_time=900, deadline=1000)
    with flyer.flying(_build("fifo", 900), content, speed=1.0) as env:
        _until(env, lambda values: values["outcomes"].get("done", 0) >= 2)
        time.sleep(0.3)  # by then it is at the next, which comes a second after the one before
        os.kill(_pid(env, "analytics/drone/model"), signal.SIGKILL)
        _until(env, lambda values: values["outcomes"].get("failed", 0) == 1)
        done = _values(env)["outcomes"]["done"]
        _until(env, lambda values: values["outcomes"]["done"] > done)
        env.get_robot_by_id("drone").end_mission()
    run = env.launch()
    assert _require_one_end_each(run)["failed"] == 1
    assert run.reports()["dispatcher"].values["edge_down"] == []
    reasons = {one.reason for one in _decisions(run) if one.action == "failed"}
    assert reasons == {"edge: its executor on the edge died"}
    alerts = _alerts(run)
    assert alerts["executor_lost"] == ["drone/model died on the edge: restarting"]
    assert alerts["executor_back"] == ["drone/model is back on the edge"]


@pytest.mark.slow
def test_a_dispatcher_that_dies_comes_back_without_being_asked(
    flyer: Flyer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Though the application never asks how it fares; no task ends twice, one stretch is lost."""
    monkeypatch.setattr("aerodaas.environment.run._BEAT_SECONDS", 3600.0)
    results: list[AeroStreamData[Any]] = []

    def build(env: Environment) -> None:
        env.set_analytics_scheduler("edf")
        drone = env.get_robot_by_id("drone")
        model = SyntheticAnalytics("model", 20.0, 0.0)
        model.deploy(env.get_compute_resource_by_id("edge"))
        results.append(model.analyse(drone.get_sensor_by_id("camera").get_data_stream()))
        drone.navigate(hop((1, 0), hover=600))

    with flyer.flying(build, _environment(5.0, edge_time=50, deadline=1000), speed=1.0) as env:
        env.launch()
        _hear(results[0], 5)
        killed = _pid(env, "dispatcher")
        os.kill(killed, signal.SIGKILL)
        while _pid(env, "dispatcher") == killed:
            time.sleep(0.05)
        _hear(results[0], 5)
        env.get_robot_by_id("drone").end_mission()
    run = env.launch()
    alerts = _alerts(run)
    assert alerts["actor_lost"] == ["the actor dispatcher died"]
    assert len(alerts["actor_back"]) == 1
    ends = [one.task for one in _decisions(run) if one.action not in {"edge", "cloud"}]
    assert max(Counter(ends).values()) == 1
    numbers = {int(task.rpartition("#")[2]) for task in ends}
    lost = set(range(min(numbers), max(numbers))) - numbers
    assert lost == set(range(min(lost), max(lost) + 1))


def _hear(stream: AeroStreamData[Any], count: int) -> None:
    for _ in range(count):
        stream.get_data(60.0)


@pytest.mark.slow
def test_work_moves_to_the_edge_while_the_cloud_is_gone(flyer: Flyer) -> None:
    """E+C sends what the edge cannot do; after the executor's death that stops until it is back."""
    content = _environment(4.0, cloud=True, edge_time=400, cloud_time=600, deadline=1500)
    with flyer.flying(_build("ec_edf", 400, 500), content, speed=1.0) as env:
        _until(env, lambda values: values["outcomes"].get("done", 0) >= 6)
        _process("CloudExecutor").kill()
        _until(env, lambda values: values["cloud_slots"] == 0)
        _until(env, lambda values: values["cloud_slots"] == 4)
        done = _values(env)["outcomes"]["done"]
        _until(env, lambda values: values["outcomes"]["done"] >= done + 8)
        env.get_robot_by_id("drone").end_mission()
    run = env.launch()
    _require_one_end_each(run)
    alerts = _alerts(run)
    assert len(alerts["cloud_lost"]) == len(alerts["cloud_back"]) == 1
    order = [one for one in _decisions(run) if one.action == "cloud"]
    assert run.recording is not None
    with Recording.open(run.recording) as recording:
        found = {
            r.value.kind: r.value.header.stamp
            for r in recording.records(schemas=["aerodaas.Alert"])
        }
    gone, back = found["cloud_lost"], found["cloud_back"]
    assert not [one for one in order if gone < one.stamp < back]
    in_cloud = {one.task for one in order if one.stamp > back}
    assert in_cloud & {one.task for one in _decisions(run) if one.action == "done"}


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        ("Raising", "ZeroDivisionError: a bug of the user's own at schedulers_at_fault.py:"),
        ("Silent", "Silent answered an event with None"),
        ("Twice", "Twice decided RunOnEdge of task"),
        ("Forgetful", "Forgetful: left m#"),
        ("Slow", "Slow took more than 50 ms to decide, 5 times in a row"),
        ("Hanging", "Hanging.task_arrived does not come to an end"),
    ],
)
def test_a_scheduler_that_goes_wrong_is_replaced(fault: str, said: str) -> None:
    """People are told why, and edge-first EDF goes on with what was waiting."""
    dispatcher = _dispatcher(getattr(schedulers_at_fault, fault)(), 50)
    host, answers = Hand(), list[Message[Any]]()
    dispatcher.open(host)
    dispatcher.start(SimulatedClock())
    done = Outlet(done_stream("m"))
    for number in range(40):
        host.time = number * 125 * MILLISECOND
        out = dispatcher.step(host.time, [*answers, _frame(number, host.time)])
        tasks = [message for message in out if message.stream == task_stream("m")]
        answers = [done.derive(number, task, 0, host.time) for task in tasks]
    [alert] = host.alerts
    assert alert.kind == "scheduler_failed"
    assert said in alert.text
    assert alert.text.endswith("going on with edge-first EDF")
    values = dispatcher.values()
    assert values["scheduler"] == "EdgeCloudEdf"
    assert values["outcomes"]["done"] > 20
    dispatcher.close()
