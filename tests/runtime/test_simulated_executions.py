"""Simulated time with executions that take mission time, on the edge and in a simulated cloud."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
import pytest
from analyses import FrameNumbers
from flying import Flyer, hop, recorded, robot

from aerodaas import (
    AeroNavigation,
    Environment,
    NavigableAnalytics,
    NavigationType,
    VelocityCommand,
)
from aerodaas.analytics.base import Context
from aerodaas.clock import NANOSECONDS
from aerodaas.config.model import EnvironmentConfig
from aerodaas.environment.run import Run
from aerodaas.errors import AeroDaaSError
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Header
from aerodaas.messages.mission import Decision
from aerodaas.messages.readings import Readings
from aerodaas.recording.reader import Recording
from aerodaas.recording.report.flight import RecordedFlight
from aerodaas.recording.report.summary import FlightSummary
from aerodaas.runtime.dispatch.dispatcher import Managed
from aerodaas.runtime.dispatch.simulated import Executions, SimulatedDispatcher
from aerodaas.runtime.inline import InlineExecutor
from aerodaas.runtime.session import Session
from aerodaas.runtime.stream_names import done_stream, task_stream
from aerodaas.schedulers.analytics.base import (
    MILLISECOND,
    AnalyticsScheduler,
    Profile,
    Resources,
    SendToCloud,
    Task,
    TaskOutcome,
    TaskPlace,
)
from aerodaas.schedulers.analytics.published.profiles import told_profile
from aerodaas.schedulers.analytics.registry import load_scheduler
from aerodaas.schedulers.lab.sample import SamplePath
from aerodaas.schedulers.lab.simulator import simulate

_CAMERA = {"driver": "simulated", "rate": 4, "settings": {"width": 64, "height": 36}}


def _content(**simulation: Any) -> dict[str, Any]:  # noqa: ANN401
    """Two cameras' frames, two analyses of each, an edge that is too slow for all of them."""
    return {
        "robots": [robot(sensors=[{"id": f"camera{n}", **_CAMERA} for n in range(2)])],
        "compute": [{"id": "edge"}, {"id": "cloud", "kind": "cloud", "executors": 2}],
        "schedulers": {
            "tasks": {
                "one": {"benefit": 30, "edge_time": 110, "cloud_time": 260, "cloud_cost": 5,
                        "deadline": 400},
                "two": {"benefit": 20, "edge_time": 70, "cloud_time": 190, "cloud_cost": 8,
                        "deadline": 500},
            },
        },
        "recording": {"images": "none"},
        "simulation": {"world": "empty", "execution_times": "nominal", **simulation},
    }  # fmt: skip


class One(FrameNumbers):
    """The first of two analyses."""

    name = "one"


class Two(FrameNumbers):
    """The second one."""

    name = "two"


def _fly(flyer: Flyer, content: dict[str, Any], scheduler: str, seed: int = 5) -> Run:
    def watch(env: Environment) -> None:
        env.set_analytics_scheduler(scheduler)
        drone = env.get_robot_by_id("drone")
        for model in (One(), Two()):
            model.deploy(env.get_compute_resource_by_id("edge"))
            for camera in ("camera0", "camera1"):
                model.analyse(drone.get_sensor_by_id(camera).get_data_stream())
        drone.navigate(hop((2, 0), hover=9.0))

    count = len(list(flyer.folder.glob("flight-*")))
    run = flyer.fly(watch, content, seed=seed, record=flyer.folder / f"flight-{count}")
    assert run.in_simulated_time
    assert recorded(run).robots["drone"].outcome.startswith("landed")
    return run


def _decisions(run: Run) -> list[Decision]:
    assert run.recording is not None
    with Recording.open(run.recording) as recording:
        return [record.value for record in recording.records(schemas=["aerodaas.Decision"])]


def _ends(decision: Decision) -> bool:
    return decision.action not in {"edge", "cloud", "retry"}


def _tasks(decisions: list[Decision], environment: EnvironmentConfig) -> list[Task]:
    """Tasks of a flight as its dispatcher made them."""
    found: dict[str, Task] = {}
    for one in decisions:
        model, _, frame = one.task.partition("#")
        source, _, segment = frame.rpartition(":")
        profile = told_profile(model, environment.schedulers)
        arrival = one.stamp - round(one.values["waited_ms"] * MILLISECOND)
        number = int(one.values["number"])
        task = Task(number, profile, arrival, arrival + profile.deadline, source, int(segment))
        found.setdefault(one.task, task)
    return sorted(found.values(), key=lambda task: task.id)


def _by_number(tasks: list[Task], time: Callable[[Task], int]) -> list[int]:
    """Times by a task's number; the last ones have none, for nothing was decided about them."""
    times = {task.id: time(task) for task in tasks}
    return [times.get(number, 0) for number in range(max(times) + 1)]


@pytest.mark.parametrize(
    ("scheduler", "times", "network"),
    [("dems", "lognormal:0.3", "outage:4-6"), ("margin", "gamma:0.2", "trapezium:300")],
)
def test_a_flight_agrees_with_the_laboratory(
    flyer: Flyer, scheduler: str, times: str, network: str
) -> None:
    """Each task ends where, how and when the laboratory says, to the nanosecond."""
    content = _content(execution_times=times, network=network, network_period=16)
    run = _fly(flyer, content, scheduler)
    environment = EnvironmentConfig.model_validate(content)
    executions = Executions.of(environment.simulation.model_copy(update={"seed": 5}))
    assert executions is not None
    decisions = _decisions(run)
    tasks = _tasks(decisions, environment)
    path = SamplePath(
        tasks,
        _by_number(tasks, executions.edge_time),
        _by_number(tasks, executions.cloud_time),
        executions.network,
    )
    trace = simulate(path, load_scheduler(scheduler), Resources(2))
    end = decisions[-1].stamp - NANOSECONDS
    wanted = [one for one in trace.results if one.finished < end]
    ended = {int(one.values["number"]): one for one in decisions if _ends(one)}
    for result in wanted:
        found = ended[result.task.id]
        assert found.stamp == result.finished
        if result.outcome is TaskOutcome.DROPPED:
            assert found.action in {"drop", "dropped"}
        else:
            assert found.action == result.outcome.value
            assert found.reason.partition(":")[0] == result.place.value
    assert len(wanted) > 100
    assert {one.place for one in wanted} == set(TaskPlace)
    # A lost task's empty answer is no result, however late it is.
    latencies = recorded(run).latencies
    assert 0.0 < max(latencies["drone/one"].age) <= 400.0
    assert 0.0 < max(latencies["drone/two"].age) <= 500.0


class Swerve(NavigableAnalytics):
    """Steers by the frame's number and by where the drone is when the result is there."""

    accepts: ClassVar[tuple[type, ...]] = (Readings,)

    def process(self, item: Readings, context: Context) -> AeroNavigation:
        """Swing from side to side."""
        state = context.vehicle()
        assert state is not None
        side = 0.5 if int(item.values["number"]) % 8 < 4 else -0.5
        climb = 0.2 * (2.0 - float(state.odometry.position[2]))
        command = VelocityCommand(0.5, side, climb, 0.0)
        return AeroNavigation(NavigationType.ANALYTICS_DRIVEN, [command])


def _swerve(flyer: Flyer, number: int) -> Recording:
    def build(env: Environment) -> None:
        env.set_analytics_scheduler("ec_edf")
        drone = env.get_robot_by_id("drone")
        edge = env.get_compute_resource_by_id("edge")
        frames = drone.get_sensor_by_id("camera0").get_data_stream()
        one = One().deploy(edge)
        one.trigger(drone.end_mission, when=lambda item: item.values["number"] >= 30)
        numbers = one.analyse(frames)
        drone.navigate(Swerve().deploy(edge).analyse(numbers))

    content = _content()
    del content["schedulers"]["tasks"]["two"]
    content["schedulers"]["tasks"]["one"]["edge_time"] = 130
    run = flyer.fly(build, content, seed=5, record=flyer.folder / f"swerve-{number}")
    assert run.recording is not None
    return Recording.open(run.recording)


def test_a_drone_flies_by_results_as_old_as_they_would_be(flyer: Flyer) -> None:
    """Results come when their executions are over; two flights agree to the last bit."""
    with _swerve(flyer, 1) as recording:
        ages = [
            (record.stamp - record.captured) / MILLISECOND
            for record in recording.records(topics=["/drone/swerve/navigation"])
        ]
        first = RecordedFlight.read(recording)
        told = str(FlightSummary.of(recording, first))
    assert len(ages) > 30
    assert set(ages) == {130.0}
    assert "swerve: 130.0 ms median, 130.0 ms 99th percentile since capture in mission time" in told
    with _swerve(flyer, 2) as recording:
        again = RecordedFlight.read(recording)
    assert np.array_equal(first.robots["drone"]._columns, again.robots["drone"]._columns)
    assert np.ptp(first.robots["drone"].position[:, 1]) > 0.3


@pytest.mark.parametrize(
    ("setting", "said"),
    [
        ({"execution_times": "normal:0.1"}, "nominal, lognormal or gamma"),
        ({"execution_times": "lognormal:x"}, "write nominal"),
        ({"network": "dial-up"}, "dial-up"),
        ({"network": "outage:7-3"}, "outage"),
    ],
)
def test_what_cannot_be_simulated_is_refused_before_the_flight(
    flyer: Flyer, setting: dict[str, Any], said: str
) -> None:
    """A misspelt network or distribution is told, with what there is."""
    with pytest.raises(AeroDaaSError, match=said):
        _fly(flyer, _content(**setting), "dems")


@pytest.mark.parametrize(
    ("cloud_ms", "offloadable", "ends_ms", "failure"),
    [
        (4000, True, 5000, None),
        (4001, True, 5000, TaskOutcome.TIMEOUT),
        (100, False, 1000, TaskOutcome.FAILED),
    ],
)
def test_a_cloud_that_takes_too_long_or_cannot_do_it_gives_no_result(
    cloud_ms: int,
    offloadable: bool,  # noqa: FBT001
    ends_ms: int,
    failure: TaskOutcome | None,
) -> None:
    """What takes exactly the time-out is answered, longer is lost; what nothing runs fails."""
    profile = Profile("model", 10.0, 9000 * MILLISECOND, MILLISECOND, cloud_ms * MILLISECOND)
    environment = EnvironmentConfig.model_validate(
        {"robots": [robot()], "simulation": {"execution_times": "nominal"}}
    )
    dispatcher = SimulatedDispatcher(
        Session(environment, None),
        _Cloud(),
        (Managed("model", ("camera",), profile, offloadable=offloadable),),
        Resources(2, 4000 * MILLISECOND),
    )
    executor = InlineExecutor()
    executor.add("dispatcher", [dispatcher])
    executor.open([dispatcher])
    executor.start([dispatcher])
    start = 1000 * MILLISECOND
    frame = Message("camera", 0, start, Header(0, start, "camera"), 0, (), "picture")
    executor.clock.advance_to(start)
    tasks = dispatcher.step(start, [frame])
    sent = [message for message in tasks if message.stream == task_stream("model")]
    assert len(sent) == (failure is None)
    for message in sent:
        answer = replace(message, stream=done_stream("model"), item="found")
        assert not dispatcher.step(start, [answer])
    assert dispatcher.due == ends_ms * MILLISECOND
    executor.clock.advance_to(dispatcher.due)
    published = dispatcher.step(dispatcher.due, [])
    results = [message.item for message in published if message.stream == "model"]
    outcomes = [one.item.action for one in published if isinstance(one.item, Decision)]
    assert results == (["found"] if failure is None else [])
    assert outcomes[-1] == (TaskOutcome.DONE if failure is None else failure).value
    dispatcher.close()


class _Cloud(AnalyticsScheduler):
    """Sends every task to the cloud."""

    def task_arrived(self, task: Task, now: int) -> list[SendToCloud]:  # noqa: ARG002
        """Send it."""
        return [SendToCloud(task, "always")]
