"""Whole flights in simulated time: what an application does in flight, and what goes wrong."""

from __future__ import annotations

import threading
import time

import pytest
from analyses import Above, Broken, Jitter, Ticker, Unwritten
from flying import Flyer, hop, recorded
from one_drone import drone_of, long, odometry_of, short, state_of
from waiting import until

from aerodaas import Environment, Odometry
from aerodaas.errors import GraphError, MissionError
from aerodaas.messages.mission import MissionState
from aerodaas.recording.reader import Recording
from aerodaas.recording.report.flight import RecordedFlight


def test_the_application_reads_streams_in_flight(flyer: Flyer) -> None:
    """Push, pull and iteration give what is measured; all end with the mission."""
    pushed: list[Odometry] = []

    def build(env: Environment) -> None:
        long(env)
        sensor = drone_of(env).get_sensor_by_id("odom_drone")
        sensor.subscribe(pushed.append)
        with pytest.raises(GraphError, match="before the mission starts"):
            sensor.poll()

    with flyer.flying(build) as env:
        sensor = drone_of(env).get_sensor_by_id("odom_drone")
        until(lambda: sensor.poll(5.0).height > 1.0)
        heights = [odometry.height for _, odometry in zip(range(5), odometry_of(env), strict=False)]
        assert len(heights) == 5
        reader = odometry_of(env)
        drone_of(env).end_mission()
        assert list(reader)[-1].height < 0.2
    assert max(item.height for item in pushed) > 1.0
    with pytest.raises(MissionError, match="no longer flying"):
        drone_of(env).end_mission()


def test_a_paused_drone_hovers_until_it_is_resumed(flyer: Flyer) -> None:
    """Then it goes on to its waypoint."""

    def build(env: Environment) -> None:
        drone_of(env).navigate(hop((60, 0)))

    with flyer.flying(build) as env:
        until(lambda: state_of(env) is MissionState.ENROUTE)
        drone_of(env).pauseMission()
        until(lambda: state_of(env) is MissionState.PAUSED)
        time.sleep(0.1)
        assert state_of(env) is MissionState.PAUSED
        drone_of(env).resumeMission()
        until(lambda: state_of(env) is not MissionState.PAUSED)
    flight = recorded(env.launch())
    assert flight.robots["drone"].visited == ("wp0",)
    assert "paused" in [band.state for band in flight.robots["drone"].bands]


def test_an_analysis_that_raises_does_not_end_the_mission(flyer: Flyer) -> None:
    """The mission is flown to its end; then the run fails, naming the analysis and the line."""

    def build(env: Environment) -> None:
        short(env)
        Broken().analyse(odometry_of(env))

    with pytest.raises(MissionError) as error:
        flyer.fly(build)
    assert error.value.exit_code == 1
    said = str(error.value)
    assert "drone/broken: ZeroDivisionError: a bug of the user's own at analyses.py:" in said
    with Recording.open(flyer.folder / "flight" / "flight.mcap") as recording:
        assert recording.complete
        flight = RecordedFlight.read(recording)
    assert flight.robots["drone"].visited == ("wp0",)
    assert [kind for _, kind, _ in flight.alerts] == ["analysis_failed"]


def test_an_analysis_that_cannot_be_closed_is_told_of(flyer: Flyer) -> None:
    """What it was to write then is lost, and nobody would know."""

    def build(env: Environment) -> None:
        short(env)
        Unwritten().analyse(odometry_of(env))

    with pytest.raises(MissionError, match=r"drone/unwritten: OSError: the disk is full at analys"):
        flyer.fly(build)


def test_a_trigger_ends_the_mission_and_wakes_an_analysis(flyer: Flyer) -> None:
    """A result that satisfies `when` lands the drone; a target sleeps until it is woken."""
    woken: list[float] = []

    def build(env: Environment) -> None:
        long(env)
        sleeper, high, ticker = Jitter(), Above(1.0), Ticker()
        jitter = sleeper.analyse(odometry_of(env))
        high.analyse(odometry_of(env))
        high.trigger(sleeper)
        ticker.deploy(env.get_compute_resource_by_id("edge")).instantiate()
        ticker.trigger(drone_of(env).end_mission, when=lambda count: count == 24)

        def listen() -> None:
            woken.extend(jitter)

        env.graph.on_launch.append(lambda: threading.Thread(target=listen, daemon=True).start())

    flight = recorded(flyer.fly(build))
    assert flight.robots["drone"].outcome == "landed: an analysis asked to land"
    landing = next(band for band in flight.robots["drone"].bands if band.state == "landing")
    # The ticker's first count is at 0 s, its twenty-fourth 23 quarters of a second later.
    assert landing.start == pytest.approx(5.75, abs=0.06)
    assert woken
    assert woken[0] > 1.0


def test_the_applications_objects_stay_as_they_are(flyer: Flyer) -> None:
    """A flight works with copies, so that the next one begins as this one did."""
    ticker = Ticker()

    def build(env: Environment) -> None:
        short(env)
        ticker.deploy(env.get_compute_resource_by_id("edge")).instantiate()

    run = flyer.fly(build)
    assert run.reports()["edge"].sent["ticker"].count > 10
    assert not hasattr(ticker, "_count")
