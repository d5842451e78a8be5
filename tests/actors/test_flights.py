"""Whole flights in real time: what an application does in flight, and what goes wrong there."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from functools import partial

import pytest
from analyses import ProcessId
from flying import FLAT, Flyer, recorded, robot
from one_drone import drone_of, long, odometry_of, short, state_of

from aerodaas import Environment, Odometry
from aerodaas.dataflow.graph import AeroStreamData
from aerodaas.errors import GraphError, MissionError
from aerodaas.messages.mission import MissionState

pytestmark = pytest.mark.wall_clock

SPEED = 5.0


def eventually(condition: Callable[[], bool], seconds: float = 30.0) -> None:
    """Wait until `condition` holds."""
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "it never happened"
        time.sleep(0.05)


def test_a_flight_in_scaled_time(flyer: Flyer) -> None:
    """At five times the wall's speed the drone visits its waypoint, returns and lands."""
    run = flyer.fly(short, speed=SPEED)
    assert not run.in_simulated_time
    flight = recorded(run)
    assert flight.robots["drone"].outcome.startswith("landed")
    assert flight.robots["drone"].visited == ("wp0",)
    assert flight.alerts == []


@pytest.mark.slow
def test_a_slow_start_is_not_taken_for_a_dead_application(
    flyer: Flyer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The drone listens for the application from its start on, not from its making."""
    from aerodaas.actors.run import flight as module  # noqa: PLC0415 - loads ray

    prepare = module.Flight._prepare

    def slowly(self: object, *args: object) -> None:
        prepare(self, *args)  # type: ignore[arg-type]
        time.sleep(5.5)

    monkeypatch.setattr(module.Flight, "_prepare", slowly)
    flight = recorded(flyer.fly(short, speed=SPEED))
    assert flight.robots["drone"].visited == ("wp0",)
    assert flight.alerts == []


@pytest.fixture(params=["in shared memory", pytest.param("by asking", marks=pytest.mark.slow)])
def reads(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """How the application reads: as beside the drone, or as from another node."""
    if request.param == "by asking":
        monkeypatch.setattr("aerodaas.actors.run.live.shared_memory_available", lambda: False)


@pytest.mark.usefixtures("reads")
def test_the_application_reads_streams_in_flight(flyer: Flyer) -> None:
    """Push, pull and iteration give what is measured; all end with the mission."""
    pushed: list[Odometry] = []
    refused: list[str] = []

    def build(env: Environment) -> None:
        long(env)
        sensor = drone_of(env).get_sensor_by_id("odom_drone")
        sensor.subscribe(pushed.append)
        for read in (sensor.poll, sensor.get_data_stream().get_data):
            with pytest.raises(GraphError, match="before the mission starts") as error:
                read()
            refused.append(str(error.value))

    with flyer.flying(build, speed=SPEED) as env:
        assert "test_flights.py" in refused[0]
        assert "read()" in refused[0]
        sensor = drone_of(env).get_sensor_by_id("odom_drone")
        eventually(lambda: sensor.poll(5.0).height > 1.0)
        heights = [odometry.height for _, odometry in zip(range(5), odometry_of(env), strict=False)]
        assert len(heights) == 5
        read = partial(odometry_of(env).get_data, timeout=0.0)
        with pytest.raises(TimeoutError, match="nothing arrived"):
            list(iter(read, None))  # some may have come since
        reader = odometry_of(env)
        drone_of(env).end_mission()
        landed = list(reader)
        assert landed[-1].height < 0.2
    assert len(pushed) > 10
    assert max(item.height for item in pushed) > 1.0
    with pytest.raises(MissionError, match="no longer flying"):
        drone_of(env).end_mission()


@pytest.mark.usefixtures("reads")
def test_poll_gives_the_newest(flyer: Flyer) -> None:
    """However long nobody asked, the item is a fresh one; asked twice, there is still one."""
    with flyer.flying(long, speed=SPEED) as env:
        sensor = drone_of(env).get_sensor_by_id("odom_drone")
        assert sensor.poll(5.0).height < 1.0
        eventually(lambda: state_of(env) is MissionState.LOITERING)
        time.sleep(1.0)
        assert sensor.poll(0.0).height > 1.0
        assert sensor.poll(0.0).height > 1.0
        drone_of(env).end_mission()


@pytest.mark.slow
def test_an_analysis_that_dies_is_restarted(flyer: Flyer) -> None:
    """SIGKILL of an analysis' process: it works again in a new one; the drone flies on, watched."""
    results: dict[str, AeroStreamData[int]] = {}

    def build(env: Environment) -> None:
        long(env)
        work = ProcessId(str(flyer.folder / "opened"))
        results["pid"] = work.analyse(odometry_of(env))

    with flyer.flying(build, {**FLAT, "robots": [robot()]}, speed=1.0) as env:
        first = results["pid"].get_data(30.0)
        os.kill(first, signal.SIGKILL)
        eventually(lambda: state_of(env) is not None and newest(results["pid"]) not in {0, first})
        drone_of(env).end_mission()
    flight = recorded(env.launch())
    assert flight.robots["drone"].outcome.startswith("landed: ")
    assert [kind for _, kind, _ in flight.alerts] == ["actor_lost", "actor_back"]


def newest(stream: AeroStreamData[int]) -> int:
    """The next item, 0 if there is none at present."""
    try:
        return stream.get_data(0.2)
    except TimeoutError:
        return 0
