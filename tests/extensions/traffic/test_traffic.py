"""Other aircraft: which are too near, what that demands, and how a drone keeps away from them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from flights import Flight, KinematicVehicle, add, flight
from hypothesis import given
from hypothesis import strategies as st

from aerodaas.clock import NANOSECONDS
from aerodaas.config.checked import checked
from aerodaas.config.model import LimitsConfig
from aerodaas.config.sections.preflight import PreflightConfig
from aerodaas.errors import ConfigError
from aerodaas.extensions.traffic.encounters import Encounter, TrafficWatch, encounters, meets_in
from aerodaas.extensions.traffic.settings import TrafficConfig
from aerodaas.geometry.frames import Vector
from aerodaas.messages.health import Verdict
from aerodaas.messages.mission import MissionState as S
from aerodaas.messages.odometry import Battery, Odometry
from aerodaas.messages.vehicle import (
    PositionSetpoint,
    Traffic,
    VehicleMode,
    VehicleState,
    VelocitySetpoint,
)
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.commands import ReturnHome
from aerodaas.mission.safety.checklist import Checklist, concerns, refusals
from aerodaas.mission.safety.failsafe import FailsafeAction
from aerodaas.mission.safety.neighbours import Neighbour
from aerodaas.mission.safety.setpoint_filter import SetpointFilter
from aerodaas.recording.recorded_environment import allowed_content

CLOSE = TrafficConfig(action="hold", distance=100.0, height=50.0, lookahead=10.0)


def aircraft(
    at: tuple[float, float, float],
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0),
    address: int = 0x4B1234,
    callsign: str = "HBXYZ",
) -> Traffic:
    """One that is heard."""
    return Traffic(address, callsign, np.array(at), np.array(velocity))


def state(*traffic: Traffic, at: tuple[float, float, float] = (0.0, 0.0, 10.0)) -> VehicleState:
    """A drone that hovers."""
    odometry = Odometry(np.array(at), np.zeros(3), 0.0)
    return VehicleState(
        0, odometry, Battery(1.0), VehicleMode.GUIDED, armed=True, traffic=tuple(traffic)
    )


def near(seen: VehicleState, config: TrafficConfig) -> list[Encounter]:
    """Who of all that are heard is too near."""
    return encounters(seen, seen.traffic, config)


@pytest.mark.parametrize(
    ("way", "closing", "after"),
    [
        ((100.0, 0.0, 50.0), (0.0, 0.0, 0.0), 0.0),
        ((0.0, -100.0, -50.0), (0.0, 0.0, 0.0), 0.0),
        ((100.001, 0.0, 0.0), (0.0, 0.0, 0.0), None),
        ((0.0, 0.0, 50.001), (0.0, 0.0, 0.0), None),
        ((0.0, 0.0, -50.001), (0.0, 0.0, 0.0), None),
        ((100.0, 0.0, 0.0), (10.0, 0.0, 0.0), 0.0),  # at the edge, and leaving
        ((300.0, 0.0, 0.0), (-20.0, 0.0, 0.0), 10.0),
        ((300.0, 0.0, 0.0), (-19.9, 0.0, 0.0), None),
        ((300.0, 0.0, 0.0), (20.0, 0.0, 0.0), None),
        ((300.0, 100.0, 0.0), (-40.0, 0.0, 0.0), 7.5),  # touches it
        ((300.0, 100.1, 0.0), (-40.0, 0.0, 0.0), None),
        ((0.0, 0.0, 90.0), (0.0, 0.0, -10.0), 4.0),
        # Over the drone before it is down at its height, and away again.
        ((300.0, 0.0, 150.0), (-100.0, 0.0, -12.5), None),
        ((300.0, 0.0, 150.0), (-100.0, 0.0, -25.0), 4.0),
        ((99.0, 0.0, math.nan), (0.0, 0.0, 0.0), 0.0),
        ((101.0, 0.0, math.nan), (0.0, 0.0, 0.0), None),
    ],
)
def test_distance_and_height_are_judged_ahead(
    way: tuple[float, ...], closing: tuple[float, ...], after: float | None
) -> None:
    """Exactly at the edge is within; only both at the same time are near."""
    found = meets_in(np.array(way), np.array(closing), CLOSE)
    assert found == (None if after is None else pytest.approx(after))


places = st.floats(-400, 400).map(lambda number: round(number, 2))
speeds = st.floats(-60, 60).map(lambda number: round(number, 2))
vectors = st.tuples(places, places, places).map(np.array)
velocities = st.tuples(speeds, speeds, speeds).map(np.array)


@given(vectors, velocities)
def test_it_agrees_with_a_look_at_every_moment(way: Vector, closing: Vector) -> None:
    """At all times up to ten seconds ahead, with a metre's tolerance at the edge."""
    found = meets_in(way, closing, CLOSE)
    times = np.linspace(0.0, CLOSE.lookahead, 2001)
    track = way + np.outer(times, closing)
    level, upright = np.hypot(track[:, 0], track[:, 1]), np.abs(track[:, 2])
    inside = (level <= CLOSE.distance - 1.0) & (upright <= CLOSE.height - 1.0)
    if inside.any():
        assert found is not None
        assert found <= times[np.argmax(inside)] + 1e-9
    if found is not None:
        there = way + found * closing
        assert math.hypot(there[0], there[1]) <= CLOSE.distance + 1e-6
        assert abs(there[2]) <= CLOSE.height + 1e-6


def limits_of(config: TrafficConfig, **others: float) -> LimitsConfig:
    """Limits of a drone among others."""
    return LimitsConfig.model_validate({"traffic": config, **others})


def watching(config: TrafficConfig) -> TrafficWatch:
    """For a drone of 2 m/s that climbs at 1.5 m/s."""
    return TrafficWatch(limits_of(config, cruise_speed=2.0, max_climb=1.5))


@pytest.mark.parametrize(
    ("action", "demand"),
    [
        ("warn", FailsafeAction.NOTHING),
        ("hold", FailsafeAction.HOLD),
        ("return", FailsafeAction.RETURN),
        ("land", FailsafeAction.LAND),
    ],
)
def test_the_action_is_what_is_demanded(action: Any, demand: FailsafeAction) -> None:  # noqa: ANN401
    """And it is told of whom, how far and how high."""
    watch = watching(CLOSE.model_copy(update={"action": action}))
    (fault,) = watch.assess(state(aircraft((60.0, 0.0, 40.0))), 0)
    assert fault.demand is demand
    assert fault.kind == "traffic"
    assert fault.text == "traffic: HBXYZ is 60 m away, 30 m above"


def test_texts_tell_below_unknown_and_coming() -> None:
    """As it is."""
    texts = [
        one.text
        for one in near(
            state(
                aircraft((0.0, 30.0, -20.0)),
                aircraft((0.0, 30.0, math.nan), address=2),
                aircraft((250.0, 0.0, 10.0), (-30.0, 0.0, 0.0), address=3),
            ),
            CLOSE,
        )
    ]
    assert texts == [
        "traffic: HBXYZ is 30 m away, 30 m below",
        "traffic: HBXYZ is 30 m away, at an unknown height",
        "traffic: HBXYZ is 250 m away, 0 m above, coming nearer",
    ]


def test_nothing_is_judged_that_is_to_be_ignored_or_from_nowhere() -> None:
    """Without a position of its own, nobody is near; other faults say what to do then."""
    beside = aircraft((10.0, 0.0, 10.0))
    ignoring = CLOSE.model_copy(update={"action": "ignore"})
    assert near(state(beside), ignoring) == []
    assert near(state(beside, at=(math.nan, math.nan, math.nan)), CLOSE) == []
    assert near(state(beside), CLOSE) != []


def test_an_aircraft_counts_for_five_seconds_after_it_was_near() -> None:
    """And for no longer; one that is told no more, too.

    It is near until it is a fifth further, and as far as the drone flies in the time looked ahead.
    """
    watch = watching(CLOSE)
    near, far = aircraft((60.0, 0.0, 10.0)), aircraft((140.1, 0.0, 10.0))
    leaving = aircraft((140.0, 0.0, 85.0))
    higher = aircraft((60.0, 0.0, 85.1))
    for one in (far, leaving, higher):
        assert watch.assess(state(one), 0) == []
    assert len(watch.assess(state(near), 0)) == 1
    assert len(watch.assess(state(leaving), NANOSECONDS)) == 1
    assert len(watch.assess(state(higher), 6 * NANOSECONDS)) == 1
    assert watch.assess(state(far), 6 * NANOSECONDS + 1) == []
    assert len(watch.assess(state(near), 7 * NANOSECONDS)) == 1
    assert len(watch.assess(state(), 12 * NANOSECONDS)) == 1
    assert watch.assess(state(), 12 * NANOSECONDS + 1) == []


@pytest.mark.parametrize("action", ["ignore", "warn"])
def test_who_is_only_told_of_bounds_nothing(action: Any) -> None:  # noqa: ANN401
    """The flight goes on as it was."""
    watch = watching(TrafficConfig(action=action))
    assert watch.neighbours(state(aircraft((1, 1, 10)))) == []


WIDE = LimitsConfig(max_speed=9.0, max_climb=9.0, max_range=5000.0, separation=0.0)
APART = (100.0, 50.0)


def clamped(
    asked: tuple[float, float, float],
    other: Neighbour,
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> tuple[list[float], tuple[str, ...]]:
    """What is sent of a velocity from (0, 0, 60), where the acceleration is no matter."""
    guard = SetpointFilter(WIDE, np.zeros(3))
    odometry = Odometry(np.array([0.0, 0.0, 60.0]), np.array(velocity), 0.0)
    sent = guard.clamp(VelocitySetpoint(np.array(asked)), odometry, 100.0, [other])
    assert isinstance(sent.setpoint, VelocitySetpoint)
    return sent.setpoint.velocity.tolist(), sent.clipped_by


def beside(*at: float, velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Neighbour:
    """An aircraft, by its way from that place."""
    position = np.array([0.0, 0.0, 60.0]) + np.array(at)
    return Neighbour(position, np.array(velocity), APART, "traffic")


def test_the_speed_towards_an_aircraft_leaves_the_way_to_stop() -> None:
    """All of it, for an aircraft does not brake; where drones need keep no distance, too."""
    velocity, names = clamped((9.0, 0.0, 0.0), beside(105.0, 0.0, 0.0))
    assert velocity[0] * WIDE.reaction_time + velocity[0] ** 2 / (2 * 3.0) == pytest.approx(5.0)
    assert names == ("traffic",)
    assert clamped((-9.0, 0.0, 0.0), beside(105.0, 0.0, 0.0))[0] == [-9.0, 0.0, 0.0]


def test_at_the_very_distance_it_stands() -> None:
    """And inside it does, while all ways off are open."""
    for away in (100.0, 60.0):
        assert clamped((5.0, 2.0, 0.0), beside(away, 0.0, 0.0))[0] == pytest.approx([0.0, 2.0, 0.0])
    assert clamped((-5.0, 0.0, -3.0), beside(60.0, 0.0, 20.0))[0] == [-5.0, 0.0, -3.0]
    assert clamped((5.0, 0.0, 3.0), beside(60.0, 0.0, 20.0))[0] == pytest.approx([0.0, 0.0, 0.0])


def test_it_passes_below_what_flies_high_enough() -> None:
    """Either distance or height keeps them apart; the one of which there is more is kept."""
    assert clamped((9.0, 0.0, 0.0), beside(20.0, 0.0, 80.0))[0] == [9.0, 0.0, 0.0]
    velocity, names = clamped((9.0, 0.0, 9.0), beside(20.0, 0.0, 55.0))
    assert velocity[0] == 9.0
    assert velocity[2] * WIDE.reaction_time + velocity[2] ** 2 / (2 * 3.0) == pytest.approx(5.0)
    assert names == ("traffic",)


def test_an_unknown_height_keeps_nobody_apart() -> None:
    """Then the distance along the ground must."""
    assert clamped((9.0, 0.0, 0.0), beside(90.0, 0.0, math.nan))[0] == pytest.approx([0, 0, 0])
    assert clamped((0.0, 0.0, 4.0), beside(0.0, 0.0, math.nan))[0] == [0.0, 0.0, 4.0]


def test_what_comes_nearer_meanwhile_is_room_that_is_not_there() -> None:
    """10 m/s for the 3.3 s that a stop takes; what flies off gives no room."""
    braking = WIDE.reaction_time + WIDE.max_speed / WIDE.max_acceleration
    for speed, room in ((10.0, 40.0 - 10.0 * braking), (-10.0, 40.0)):
        other = beside(140.0, 0.0, 0.0, velocity=(-speed, 0.0, 0.0))
        (east, _, _), _ = clamped((9.0, 0.0, 0.0), other)
        expected = room * 1.0
        assert min(east * WIDE.reaction_time + east**2 / 6.0, 15.0) == pytest.approx(
            min(expected, 9.0 * WIDE.reaction_time + 81 / 6.0, 15.0)
        )


@given(vectors, velocities, velocities)
def test_standing_still_is_always_allowed(way: Vector, flies: Vector, asked: Vector) -> None:
    """Whatever flies around: what is sent is finite, and no nearing within the distance."""
    other = Neighbour(np.array([0.0, 0.0, 60.0]) + way, flies, APART, "traffic")
    assert clamped((0.0, 0.0, 0.0), other)[0] == [0.0, 0.0, 0.0]
    east, north, up = asked
    sent = np.array(clamped((east, north, up), other)[0])
    assert np.isfinite(sent).all()
    level, upright = math.hypot(way[0], way[1]), abs(float(way[2]))
    if 1.0 < level <= APART[0] and 1.0 < upright <= APART[1]:
        assert float(sent[:2] @ way[:2]) <= 1e-6 * level
        assert float(sent[2] * way[2]) <= 1e-6 * upright


class Surrounded(KinematicVehicle):
    """A vehicle that hears aircraft, which fly as the test says."""

    def __init__(self, traffic: Callable[[float], list[Traffic]], **given: Any) -> None:  # noqa: ANN401
        super().__init__(**given)
        self._heard = traffic

    def read(self) -> VehicleState:
        """The state, with what it hears."""
        seen = super().read()
        return replace(seen, traffic=tuple(self._heard(seen.stamp / NANOSECONDS)))


def flown(
    traffic: Callable[[float], list[Traffic]],
    action: str = "hold",
    places: tuple[Waypoint, ...] = (Waypoint("far", 60, 0, 1.5),),
    **given: Any,  # noqa: ANN401
) -> Flight:
    """A mission to a waypoint in the east, among aircraft."""
    config = TrafficConfig(action=action, distance=30.0, height=20.0, lookahead=2.0)  # type: ignore[arg-type]
    limits = limits_of(config, cruise_speed=2.0)
    return flight(add(*places), limits=limits, vehicle=Surrounded(traffic, **given))


def crossing(begin: float = 6.0, until: float = 30.0) -> Callable[[float], list[Traffic]]:
    """One that stands 45 m to the east, and nobody before `begin` and after `until` seconds."""
    return lambda now: [aircraft((45.0, 0.0, 2.0))] if begin <= now <= until else []


def nearest(flying: Flight, to: tuple[float, float, float] = (45.0, 0.0, 2.0)) -> float:
    """How near it came to a place along the ground, until the aircraft was gone (30 s)."""
    track = flying.track[:600]
    return min(math.hypot(*(place - np.array(to))[:2]) for place in track)


def test_a_drone_waits_until_the_aircraft_is_gone() -> None:
    """It holds at its distance, tells once of whom, and flies on."""
    flying = flown(crossing())
    flying.run()
    flying.expect(S.LANDED)
    assert list(flying.status.visited) == ["far"]
    assert S.HOLDING in flying.states[flying.states.index(S.ENROUTE) :]
    told = [alert.text for alert in flying.mission.alerts if alert.kind == "traffic"]
    assert told == ["traffic: HBXYZ is 30 m away, 0 m above, coming nearer"]
    assert flying.states.count(S.ENROUTE) == 2
    assert nearest(flying) > 29.5


def test_two_aircraft_are_told_of_each() -> None:
    """Though their callsigns differ in figures alone."""
    swiss = aircraft((25.0, 0.0, 2.0), address=1, callsign="SWR123")
    other = aircraft((25.0, 9.0, 2.0), address=2, callsign="SWR456")
    flying = flown(lambda now: [swiss, other] if now > 5.0 else [swiss] if now > 4.0 else [])
    flying.run(20.0)
    told = [alert.text for alert in flying.mission.alerts if alert.kind == "traffic"]
    assert [text.split()[1] for text in told] == ["SWR123", "SWR456"]


@pytest.mark.parametrize(("action", "place"), [("return", 0.0), ("land", 12.0)])
def test_it_comes_home_or_lands_where_told_to(action: str, place: float) -> None:
    """And does not go on when the aircraft is gone."""
    flying = flown(crossing(), action)
    flying.run()
    flying.expect(S.LANDED)
    assert not flying.status.visited
    assert "HBXYZ" in flying.status.reason
    assert float(flying.vehicle.position[0]) == pytest.approx(place, abs=1.5)


def test_a_warning_changes_nothing_but_is_told() -> None:
    """The drone flies under the aircraft."""
    flying = flown(crossing(until=90.0), "warn")
    flying.run()
    flying.expect(S.LANDED)
    assert list(flying.status.visited) == ["far"]
    assert [alert.kind for alert in flying.mission.alerts] == ["traffic"]
    assert nearest(flying) < 29.0
    assert not any("traffic" in record.clipped_by for record in flying.records)


def test_nobody_is_told_of_what_is_ignored() -> None:
    """At all."""
    flying = flown(crossing(until=90.0), "ignore")
    flying.run()
    flying.expect(S.LANDED)
    assert not flying.mission.alerts


def test_a_low_battery_comes_first() -> None:
    """While it holds for an aircraft its battery runs low: it goes home, and tells of both."""
    flying = flown(crossing(until=600.0))
    flying.run(until=lambda: flying.mission.state is S.HOLDING and flying.now > 15 * NANOSECONDS)
    flying.expect(S.HOLDING)
    flying.vehicle.charge = 0.2
    flying.run()
    flying.expect(S.LANDED)
    assert "battery" in flying.status.reason
    assert float(np.linalg.norm(flying.vehicle.position[:2])) < 0.6
    assert {"traffic", "battery_low"} <= {alert.kind for alert in flying.mission.alerts}


def test_a_critical_battery_lands_it_beside_the_aircraft() -> None:
    """Nothing keeps it up."""
    flying = flown(crossing(until=600.0))
    flying.run(15.0)
    flying.vehicle.charge = 0.1
    flying.run()
    flying.expect(S.LANDED)
    assert "critical" in flying.status.reason


def test_a_return_waits_for_an_aircraft_over_home() -> None:
    """Hold does not stop a return, but the distance is kept on the way; then it comes home."""

    def over_home(now: float) -> list[Traffic]:
        return [aircraft((0.0, 0.0, 2.0))] if 35.0 <= now <= 60.0 else []

    flying = flown(over_home)
    flying.run(until=lambda: bool(flying.status.visited))
    flying.tell(ReturnHome("the test says so"))
    assert flying.now < 35 * NANOSECONDS
    flying.run(59.9 - flying.now / NANOSECONDS)
    flying.expect(S.RETURNING)
    assert float(flying.vehicle.position[0]) == pytest.approx(30.0, abs=1.0)
    flying.run()
    flying.expect(S.LANDED)
    assert float(np.linalg.norm(flying.vehicle.position[:2])) < 0.6


def test_a_lost_link_goes_before_traffic() -> None:
    """The vehicle comes home by itself."""
    flying = flown(crossing(until=600.0))
    flying.run(15.0)
    flying.vehicle.lost = True
    flying.run(6.0)
    flying.expect(S.RETURNING)
    assert "no word" in flying.status.reason


@pytest.mark.parametrize(
    ("action", "verdict"),
    [
        ("warn", Verdict.WARNING),
        ("hold", Verdict.REFUSED),
        ("return", Verdict.REFUSED),
        ("land", Verdict.REFUSED),
    ],
)
def test_traffic_is_an_item_before_take_off(action: Any, verdict: Verdict) -> None:  # noqa: ANN401
    """Where anything flies; near is refused where the drone would act on it."""
    limits = limits_of(CLOSE.model_copy(update={"action": action}))
    vehicle = KinematicVehicle()
    checklist = Checklist(vehicle, limits, PreflightConfig())

    def item(*traffic: Traffic) -> Any:  # noqa: ANN401
        items = checklist.examine(replace(vehicle.read(), traffic=traffic))
        found = [one for one in items if one.name == "traffic"]
        assert bool(found) is bool(traffic)
        refused = any("traffic" in text for text in refusals(items))
        assert refused is bool(found and found[0].verdict is Verdict.REFUSED)
        warned = any("traffic" in text for text in concerns(items))
        assert warned is bool(found and found[0].verdict is Verdict.WARNING)
        return found[0] if found else None

    assert item() is None
    assert item(aircraft((500.0, 0.0, 10.0))).verdict is Verdict.GOOD
    near = item(aircraft((50.0, 0.0, 20.0)))
    assert near.verdict is verdict
    assert near.text == (
        "traffic: HBXYZ is 50 m away, 20 m above, should be none within 100 m and 50 m of height"
    )
    assert near.remedy == "wait until it is gone"


def test_a_take_off_waits_for_an_aircraft() -> None:
    """As long as for the vehicle's own objections; then it is refused."""
    gone = flown(lambda now: [aircraft((5.0, 0.0, 2.0))] if now < 3.0 else [])
    gone.run(10.0)
    assert S.TAKING_OFF in gone.states
    stays = flown(lambda _: [aircraft((5.0, 0.0, 2.0))])
    stays.run(10.0)
    stays.expect(S.ABORTED)
    assert "take-off refused: traffic: HBXYZ is 0 m away" in stays.status.reason
    assert not stays.vehicle.calls


def test_a_setpoint_of_a_place_is_bounded_as_well() -> None:
    """It becomes a velocity while it leads to an aircraft."""
    guard = SetpointFilter(WIDE, np.zeros(3))
    odometry = Odometry(np.array([0.0, 0.0, 60.0]), np.zeros(3), 0.0)
    asked = PositionSetpoint(np.array([90.0, 0.0, 60.0]), None, 5.0)
    sent = guard.clamp(asked, odometry, 0.05, [beside(80.0, 0.0, 0.0)])
    assert isinstance(sent.setpoint, VelocitySetpoint)
    assert sent.setpoint.velocity.tolist() == pytest.approx([0.0, 0.0, 0.0])
    assert sent.clipped_by == ("traffic",)


def test_the_drones_own_transponder_has_six_digits() -> None:
    """Hexadecimal ones."""
    assert TrafficConfig(own_address="4b12Ff").own_address == "4b12Ff"
    for wrong in ("4B12F", "4B12FF0", "4B12FG", ""):
        with pytest.raises(ConfigError, match="own_address"):
            checked(TrafficConfig, {"own_address": wrong}, "limits.traffic")


def test_a_replay_reads_of_a_recording_all_but_the_drones_own_address() -> None:
    """Recorded traffic has no echo of the drone's own."""
    told = {**CLOSE.model_dump(), "own_address": "4b1234"}
    read = allowed_content({"robots": [{"id": "drone", "limits": {"traffic": told}}]})
    kept = CLOSE.model_dump(exclude={"own_address"})
    assert read == {"robots": [{"id": "drone", "limits": {"traffic": kept}}]}
