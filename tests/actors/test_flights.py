"""Whole flights in real time: what an application does in flight, and what goes wrong there."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial

import pytest
from flying import Flyer, recorded
from one_drone import drone_of, long, odometry_of, short

from aerodaas import Environment, Odometry
from aerodaas.errors import GraphError, MissionError

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
