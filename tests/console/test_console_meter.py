"""What a flight's meter remembers for those who look on later."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import pytest

from aerodaas.messages.mission import MissionState, MissionStatus, RobotStatus
from aerodaas.messages.waypoints import Waypoint
from aerodaas.protocol.schemas import AnalyticsOut
from aerodaas.service.own.flight import FlightMeter

if TYPE_CHECKING:
    from aerodaas.runtime.reports import ActorReport, FlightState


def flying_to(target: int, *pending: int, stamp: int = 10**9) -> FlightState:
    """A state of one drone on its way to the waypoint `target`, as numbers name them."""
    ahead = [Waypoint(f"wp{one}", one, 2, 3, waypoint_type="local") for one in (target, *pending)]
    status = MissionStatus(stamp, MissionState.ENROUTE, "", ahead[0], tuple(ahead[1:]))
    robots = {"drone": RobotStatus(status)}
    return cast("FlightState", SimpleNamespace(robots=robots, alerts=[], reports={}))


def test_places_behind_are_remembered() -> None:
    """Who comes late sees where the drone has been."""
    meter = FlightMeter()
    meter.record(flying_to(1, 2))
    meter.record(flying_to(2))
    assert meter.places["drone"] == {"wp1": (1, 2, 3)}


def test_a_long_flight_forgets_its_first_places_and_none_ahead() -> None:
    """A status is sent often; all that lies ahead is in it."""
    meter = FlightMeter()
    for number in range(300):
        meter.record(flying_to(number))
    places = meter.places["drone"]
    assert (len(places), "wp99" in places, "wp100" in places) == (199, False, True)
    meter.record(flying_to(*range(1000, 1400)))
    assert meter.places["drone"] == {}
    ahead = meter.status["drone"].mission.ahead
    assert [one.id for one in ahead] == [f"wp{number}" for number in range(1000, 1400)]


def test_the_same_status_again_is_no_news(monkeypatch: pytest.MonkeyPatch) -> None:
    """Who told it may hang."""
    now = 100.0
    monkeypatch.setattr("aerodaas.service.own.flight.host_time_ns", lambda: int(now * 1e9))
    meter, state = FlightMeter(), flying_to(1)
    for _ in range(2):
        meter.record(state)
        assert meter.told == {"drone": 100.0}
        now += 5.0
    meter.record(flying_to(1, stamp=2 * 10**9))
    assert meter.told == {"drone": 110.0}


def test_decisions_of_the_analytics_scheduler_are_told_once_there_are_some() -> None:
    """As the dispatcher reports them."""
    meter = FlightMeter()
    state = flying_to(1)
    meter.record(state)
    assert meter.analytics is None
    values: dict[str, object] = {"outcomes": {}, "qos_total": 0.0, "qoe_total": 0.0}
    state.reports["dispatcher"] = cast("ActorReport", SimpleNamespace(values=values))
    meter.record(state)
    assert meter.analytics is None
    values |= {
        "outcomes": {"done": 7, "late": 1, "timeout": 2, "failed": 3, "dropped": 4},
        "places": {"edge": 5, "cloud": 8, "nowhere": 4},
        "qos_total": 2.5,
        "qoe_total": 1.5,
    }
    meter.record(state)
    assert meter.analytics == AnalyticsOut(
        time=1.0, in_time=7, late=6, dropped=4, edge=5, cloud=8, qos=2.5, qoe=1.5
    )
