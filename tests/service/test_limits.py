"""A flight's limits: the least of provider's, tenant's and lease's, and never anything wider."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from aerodaas.config.model import EnvironmentConfig, GeofenceConfig, LimitsConfig, validated
from aerodaas.errors import ConfigError
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.vehicle import PositionSetpoint, VelocitySetpoint
from aerodaas.mission.safety.geofence import Geofence
from aerodaas.mission.safety.setpoint_filter import SetpointFilter
from aerodaas.service.flights.environment import limited
from aerodaas.service.flights.orders import TenantLimits

SQUARE = [(-50.0, -50.0), (50.0, -50.0), (50.0, 50.0), (-50.0, 50.0)]
NOTHING = TenantLimits()
Corners = Sequence[tuple[float, float]]


def fleet(*, fence: dict[str, Any] | None = None, **limits: Any) -> EnvironmentConfig:  # noqa: ANN401
    """Two drones within a square of 100 m, three metres apart."""
    whole: dict[str, Any] = {
        "polygon": SQUARE,
        "floor": 0.3,
        "ceiling": 30,
        "margin": 2,
        **(fence or {}),
    }
    robots: list[dict[str, Any]] = [
        {"id": name, "start": [east, 0, 0], "limits": {**limits, "geofence": whole}}
        for name, east in (("one", 0), ("two", 3))
    ]
    return validated({"robots": robots}, "fleet")


def limits_of(
    config: EnvironmentConfig, tenant: TenantLimits, area: Corners | None
) -> LimitsConfig:
    """Limits of the first drone."""
    return limited(config, ["one"], tenant=tenant, area=area).robots[0].limits


@st.composite
def stars(draw: st.DrawFn, least: float, most: float) -> list[tuple[float, float]]:
    """A polygon around the origin, convex or not, whose corners lie this far from it."""
    count = draw(st.integers(3, 9))
    turn = draw(st.floats(0, math.tau))
    radii = draw(st.lists(st.floats(least, most), min_size=count, max_size=count))
    angles = [turn + math.tau * number / count for number in range(count)]
    return [(r * math.cos(a), r * math.sin(a)) for r, a in zip(radii, angles, strict=True)]


@st.composite
def boxes(draw: st.DrawFn) -> list[tuple[float, float]]:
    """A no-fly zone off the origin."""
    east, north = draw(st.floats(8, 40)), draw(st.floats(-40, 40))
    size = draw(st.floats(1, 15))
    return [
        (east, north),
        (east + size, north),
        (east + size, north + size),
        (east, north + size),
    ]


cases = {
    "fence": st.one_of(st.just([]), stars(10, 60)),
    "no_fly": st.lists(boxes(), max_size=2),
    "margin": st.floats(0, 3),
    "area": st.one_of(st.none(), stars(10, 60)),
    "tenant": st.builds(
        TenantLimits,
        *[st.one_of(st.none(), st.floats(low, high)) for low, high in ((2, 60), (0.2, 12))],
    ),
}


def narrowed(
    fence: Corners,
    no_fly: list[list[tuple[float, float]]],
    margin: float,
    **given: Any,  # noqa: ANN401
) -> tuple[LimitsConfig, LimitsConfig]:
    """The provider's limits and the flight's; a refusal is no case."""
    zones = {"polygon": fence, "no_fly": no_fly, "margin": margin}
    config = fleet(fence=zones, takeoff_height=1.0)
    try:
        Geofence(config.robots[0].limits.geofence)
        return config.robots[0].limits, limits_of(config, given["tenant"], given["area"])
    except ConfigError:
        assume(False)  # noqa: FBT003 - the refusals have tests of their own
        raise


def within(fence: Geofence, place: tuple[float, float, float]) -> bool:
    """Whether a fence allows a place, or its area lies within the tolerance of a micrometre.

    The distance of a place that is rounded to the outside may be 0.
    """
    outside = fence.area is not None and not shapely.covers(fence.area, shapely.Point(place[:2]))
    near = outside and shapely.distance(fence.area, shapely.Point(place[:2])) <= 1e-6
    return fence.contains(np.array(place)) or bool(near)


@settings(max_examples=100)
@given(
    places=st.lists(st.tuples(*[st.floats(-70, 70)] * 2, st.floats(0, 70)), min_size=30), **cases
)
@example(
    places=[],
    fence=[],
    no_fly=[[(8.0, 28.0), (15.0, 28.0), (15.0, 35.0), (8.0, 35.0)]],
    margin=0.0,
    area=[(10.0, 0.0), (17.92298567374695, 55.161277945118904), (-8.09, 5.87), (-8.09, -5.87)],
    tenant=TenantLimits(),
)
def test_a_place_that_is_allowed_is_allowed_by_each(
    places: list[tuple[float, float, float]],
    **case: Any,  # noqa: ANN401
) -> None:
    """By the provider's fence, the tenant's height and range, and the lease's area."""
    provider, flight = narrowed(**case)
    outer, inner = Geofence(provider.geofence), Geofence(flight.geofence)
    area = case["area"] and Geofence(GeofenceConfig(polygon=case["area"], margin=0, ceiling=1e3))
    corners = [(*corner, 1.0) for corner in flight.geofence.polygon]
    inset = shapely.get_coordinates(inner.inner) if inner.inner is not None else []
    edge = [(float(x), float(y), 1.0) for x, y in inset]
    for place in [*places, *corners, *edge]:
        if inner.contains(np.array(place)):
            assert within(outer, place)
            assert not area or within(area, (*place[:2], 1.0))
            assert place[2] <= (case["tenant"].max_height or math.inf)


@settings(max_examples=100)
@given(
    target=st.tuples(*[st.floats(-90, 90)] * 2, st.floats(0, 70)),
    speed=st.floats(0.1, 15),
    **cases,
)
@example(
    target=(9.0, -19.0, 0.0),
    speed=1.0,
    fence=[],
    no_fly=[[(8.0, -19.0), (9.0, -19.0), (9.0, -18.0), (8.0, -18.0)]],
    margin=0.0,
    area=None,
    tenant=TenantLimits(),
)
def test_a_setpoint_sent_is_within_each(
    target: tuple[float, float, float],
    speed: float,
    **case: Any,  # noqa: ANN401
) -> None:
    """Whatever is asked, what is sent keeps the least speed, height and range, and the fences."""
    provider, flight = narrowed(**case)
    tenant = case["tenant"]
    start = np.array([0.0, 0.0, 1.0])
    still = Odometry(start, np.zeros(3), 0.0)
    sent = SetpointFilter(flight, np.zeros(3)).clamp(
        PositionSetpoint(np.array(target), speed=speed), still, 0.05
    )
    setpoint = sent.setpoint
    fastest = min(provider.max_speed, tenant.max_speed or math.inf)
    if isinstance(setpoint, PositionSetpoint):
        if Geofence(flight.geofence).contains(setpoint.position):
            assert Geofence(provider.geofence).contains(setpoint.position)
        assert np.linalg.norm(setpoint.position[:2]) <= flight.max_range + 1e-6
        assert setpoint.position[2] <= (tenant.max_height or math.inf)
        way = setpoint.position - start
        if np.linalg.norm(way) > 0 and setpoint.speed is not None:
            level = setpoint.speed * np.linalg.norm(way[:2]) / np.linalg.norm(way)
            assert level <= fastest + 1e-9
    else:
        assert np.linalg.norm(setpoint.velocity[:2]) <= fastest + 1e-9
        assert abs(setpoint.velocity[2]) <= min(provider.max_climb, fastest) + 1e-9


@settings(max_examples=20)
@given(
    wishes=st.lists(st.tuples(*[st.floats(-20, 20)] * 3), min_size=5, max_size=12),
    **cases,
)
def test_a_drone_never_leaves_any_of_them(
    wishes: list[tuple[float, float, float]],
    **case: Any,  # noqa: ANN401
) -> None:
    """FlightRun by whatever velocities for seconds each, the drone stays inside all three."""
    provider, flight = narrowed(**case)
    tenant = case["tenant"]
    guard, outer = SetpointFilter(flight, np.array([0.0, 0.0, 0.0])), Geofence(provider.geofence)
    area = shapely.Polygon(case["area"]) if case["area"] else None
    position, velocity = np.array([0.0, 0.0, 1.0]), np.zeros(3)
    assume(guard.fence.contains(position))
    for wish in wishes:
        for _ in range(40):
            asked = VelocitySetpoint(np.array(wish))
            sent = guard.clamp(asked, Odometry(position, velocity, 0.0), 0.05).setpoint
            assert isinstance(sent, VelocitySetpoint)
            velocity = sent.velocity
            position = position + 0.05 * velocity
            assert outer.inside(position)
            assert area is None or shapely.covers(area, shapely.Point(*position[:2]))
            assert position[2] <= min(30.0, tenant.max_height or 30.0) + 1e-6
            # Steps along a sphere go off it a little.
            assert np.linalg.norm(position) <= flight.max_range + 0.1


def test_each_limit_is_the_least() -> None:
    """The tenant's where it is lower, the provider's where that is."""
    config = fleet(cruise_speed=3, max_speed=6, max_climb=2, max_range=300)
    flight = limits_of(config, TenantLimits(12, 2.5), None)
    assert (flight.cruise_speed, flight.max_speed, flight.max_climb) == (2.5, 2.5, 2)
    assert limits_of(config, TenantLimits(max_speed=1.5), None).max_climb == 1.5
    assert (flight.max_range, flight.geofence.ceiling) == (300, 12)
    assert limits_of(config, TenantLimits(120, 25), None) == config.robots[0].limits


def test_the_others_are_left_out_and_all_else_stays() -> None:
    """Only the lease's robots are in the flight's environment."""
    config = fleet()
    assert limited(config, ["two", "one"], tenant=NOTHING, area=None) == config
    (robot,) = limited(config, ["two"], tenant=NOTHING, area=None).robots
    assert robot == config.robots[1]


def test_no_fly_zones_and_margins_stay() -> None:
    """An area does not lift them."""
    zone = [(10.0, 10.0), (20.0, 10.0), (20.0, 20.0), (10.0, 20.0)]
    area = [(-5.0, -5.0), (30.0, -5.0), (30.0, 30.0), (-5.0, 30.0)]
    flight = limits_of(fleet(fence={"no_fly": [zone]}), NOTHING, area)
    assert flight.geofence.no_fly == [zone]
    assert flight.geofence.margin == 2
    assert shapely.Polygon(flight.geofence.polygon).equals_exact(
        shapely.Polygon(area).normalize(), 1e-5, normalize=True
    )


def test_an_area_around_the_fence_leaves_it_as_it_is() -> None:
    """To the last digit."""
    wide = [(2 * x, 2 * y) for x, y in SQUARE]
    assert limits_of(fleet(), NOTHING, wide).geofence.polygon == SQUARE
    assert limits_of(fleet(fence={"polygon": []}), NOTHING, SQUARE).geofence.polygon == SQUARE


COMB = [(0, 0), (60, 0), (60, 40), (40, 40), (40, 10), (20, 10), (20, 40), (0, 40)]
"""A fence of two teeth."""


@pytest.mark.parametrize(
    ("area", "fence", "text"),
    [
        (
            [(70, 0), (90, 0), (90, 20)],
            SQUARE,
            "the lease's area lies outside it, the fence of -50",
        ),
        ([(10, -9), (40, -9), (40, 9), (10, 9)], SQUARE, r"one stands at \(0, 0\), outside"),
        ([(-1, 20), (70, 20), (70, 30), (-1, 30)], COMB, "lies in 2 parts within it"),
        ([(-5, -5), (5, 5), (5, -5), (-5, 5)], SQUARE, "encloses nothing or crosses itself"),
        ([(-1, -1), (1, -1), (1, 1), (-1, 1)], SQUARE, "leaves no room within its margin of 2"),
        ([(0, 0), (1, 1)], SQUARE, "encloses nothing"),
    ],
)
def test_an_area_that_does_not_do_is_refused(area: Corners, fence: Corners, text: str) -> None:
    """With the drone, the figures and what to do."""
    with pytest.raises(ConfigError, match=text):
        limits_of(fleet(fence={"polygon": fence}), NOTHING, area)


def test_an_area_upon_a_corner_of_the_fence_does_not_shrink_its_margin() -> None:
    """An inner corner keeps a mitred margin, which an edge through that corner would lose."""
    fence = [(-50, -50), (50, -50), (50, 50), (10, 50), (10, 10), (-50, 10)]
    area = [(-40, -40), (40, -40), (40, 20), (10, 10), (-40, 10)]
    with pytest.raises(ConfigError, match="a corner of the lease's area touches one of the fence"):
        limits_of(fleet(fence={"polygon": fence}), NOTHING, area)


def test_a_take_off_above_the_tenants_height_is_refused() -> None:
    """Rather than being lowered into the ceiling."""
    with pytest.raises(ConfigError, match="climbs to 3 m, and the tenant may fly up to 2 m"):
        limits_of(fleet(takeoff_height=3), TenantLimits(max_height=2), None)


def test_an_unknown_robot_is_refused() -> None:
    """With those that there are."""
    with pytest.raises(ConfigError, match=r"no robot tow; did you mean two\?"):
        limited(fleet(), ["tow"], tenant=NOTHING, area=None)


def test_actuators_are_the_tenants_that_may_move_them_and_no_parachute_is() -> None:
    """Without a word none is there, whatever the fleet carries."""
    carried = [
        {"id": "hook", "type": "gripper"},
        {"id": "pump", "type": "relay"},
        {"id": "chute", "type": "parachute", "may_release": True},
    ]
    robots = [{"id": name, "actuators": carried} for name in ("one", "two")]
    config = validated({"robots": robots}, "fleet")

    def left(*names: str) -> list[list[str]]:
        found = limited(config, ["one", "two"], tenant=NOTHING, area=None, actuators=names)
        return [[one.id for one in robot.actuators] for robot in found.robots]

    assert left() == [[], []]
    assert left("one/hook", "two/chute", "one/chute", "pump") == [["hook"], []]
