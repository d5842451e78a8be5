"""The setpoint guard: never above a limit, never through a fence, never stuck outside."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from flights import KinematicVehicle
from hypothesis import example, given, settings
from hypothesis import strategies as st

from aerodaas.clock import NANOSECONDS
from aerodaas.config.model import GeofenceConfig, LimitsConfig
from aerodaas.errors import ConfigError
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.vehicle import PositionSetpoint, Setpoint, VehicleMode, VelocitySetpoint
from aerodaas.mission.safety import setpoint_filter
from aerodaas.mission.safety.geofence import Geofence
from aerodaas.mission.safety.neighbours import Neighbour
from aerodaas.mission.safety.setpoint_filter import SetpointFilter

L_SHAPE = [(-15.0, -15.0), (15.0, -15.0), (15.0, 0.0), (0.0, 0.0), (0.0, 15.0), (-15.0, 15.0)]
HOLE = [(-9.0, -9.0), (-5.0, -9.0), (-5.0, -5.0), (-9.0, -5.0)]
LIMITS = LimitsConfig(
    max_speed=4.0,
    max_range=18.0,
    geofence=GeofenceConfig(polygon=L_SHAPE, no_fly=[HOLE], ceiling=12.0, floor=1.0),
)

numbers = st.floats(-60, 60)
anything = st.floats(allow_nan=True, allow_infinity=True)
velocities = st.builds(
    lambda x, y, z, turn: VelocitySetpoint(np.array([x, y, z]), turn),
    *[st.floats(-10, 10)] * 4,
)
positions = st.builds(
    lambda x, y, z, speed: PositionSetpoint(np.array([x, y, z]), None, speed),
    numbers,
    numbers,
    st.floats(-5, 30),
    st.none() | st.floats(0.1, 20),
)
wild = st.builds(lambda x, y, z, r: VelocitySetpoint(np.array([x, y, z]), r), *[anything] * 4)


def at(*position: float, velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Odometry:
    """Odometry of a drone that is here."""
    return Odometry(np.array(position), np.array(velocity), 0.0)


@given(setpoint=velocities | positions | wild, before=velocities)
@settings(max_examples=100)
def test_no_limit_is_ever_exceeded(setpoint: Setpoint, before: VelocitySetpoint) -> None:
    """What is sent is finite and within speed, climb, turn and acceleration, and says so."""
    guard = SetpointFilter(LIMITS, np.zeros(3))
    odometry = at(-3.0, -3.0, 5.0)
    first = guard.clamp(before, odometry, 0.05)
    sent = guard.clamp(setpoint, odometry, 0.05)
    if isinstance(sent.setpoint, PositionSetpoint):
        assert guard.fence.contains(sent.setpoint.position)
        assert np.linalg.norm(sent.setpoint.position) <= LIMITS.max_range + 1e-6
        assert sent.setpoint.speed is not None
        assert sent.setpoint.speed <= math.hypot(LIMITS.max_speed, LIMITS.max_climb) + 1e-9
        return
    velocity = sent.setpoint.velocity
    assert np.isfinite(velocity).all()
    assert math.hypot(velocity[0], velocity[1]) <= LIMITS.max_speed + 1e-9
    assert abs(velocity[2]) <= LIMITS.max_climb + 1e-9
    assert abs(sent.setpoint.yaw_rate) <= math.radians(LIMITS.max_yaw_rate) + 1e-9
    if isinstance(setpoint, VelocitySetpoint) and isinstance(first.setpoint, VelocitySetpoint):
        change = np.linalg.norm(velocity - first.setpoint.velocity)
        bounded = {"geofence", "floor", "ceiling", "max_range", "not_finite"}
        if not bounded & set(sent.clipped_by):
            assert change <= LIMITS.max_acceleration * 0.05 + 1e-9
        if not np.array_equal(velocity, setpoint.velocity):
            assert sent.clipped_by


@given(setpoints=st.lists(velocities | positions | wild, min_size=1, max_size=5))
@settings(max_examples=25)
@example(setpoints=[VelocitySetpoint(np.array([10.0, 10.0, -10.0]))])
@example(setpoints=[PositionSetpoint(np.array([10.0, -10.0, 5.0]), None, 20.0)])
@example(
    setpoints=[
        VelocitySetpoint(np.array([0.0, 4.0, -1.0])),
        VelocitySetpoint(np.array([-4.0, 2.0, 0.0])),
        VelocitySetpoint(np.array([-2.0, 0.0, -2.0])),
    ]
)
def test_no_sequence_of_setpoints_gets_through_the_fence(setpoints: list[Setpoint]) -> None:
    """A drone with a sluggish response, flown for seconds each way, stays inside all the time."""
    guard = SetpointFilter(LIMITS, np.array([0.0, 0.0, 0.0]))
    vehicle = KinematicVehicle((-3.0, -3.0, 0.0))
    vehicle.position[2] = 5.0
    vehicle.mode = VehicleMode.GUIDED
    now = 0
    for setpoint in setpoints:
        for _ in range(50):
            clamped = guard.clamp(setpoint, vehicle.read().odometry, 0.05)
            vehicle.send(clamped.setpoint)
            now += NANOSECONDS // 20
            vehicle.advance_to(now)
            assert guard.fence.inside(vehicle.position), vehicle.position
            assert 0.95 < vehicle.position[2] < 12.05
            # Where the range meets the fence, the lag of 0.2 s costs up to a decimetre.
            assert np.linalg.norm(vehicle.position) < LIMITS.max_range + 0.2


def test_the_fence_stops_before_the_edge_and_lets_slide_along_it() -> None:
    """The drone brakes to the margin; the part of its velocity along the edge is untouched."""
    guard = SetpointFilter(LIMITS, np.zeros(3))
    ahead = guard.clamp(VelocitySetpoint(np.array([4.0, 0, 0])), at(14.0, -7.0, 5.0), 10.0)
    assert ahead.clipped_by == ("geofence",)
    assert isinstance(ahead.setpoint, VelocitySetpoint)
    assert 0.0 < ahead.setpoint.velocity[0] < 1.5
    along = guard.clamp(VelocitySetpoint(np.array([3.0, -1.0, 0])), at(14.5, -7.0, 5.0), 10.0)
    assert isinstance(along.setpoint, VelocitySetpoint)
    assert along.setpoint.velocity == pytest.approx([0.0, -1.0, 0.0], abs=1e-9)


def test_outside_the_fence_only_the_way_back_is_open() -> None:
    """A drone that was blown outside may come back, and may not go further."""
    guard = SetpointFilter(LIMITS, np.zeros(3))
    outside = at(17.0, -7.0, 5.0)
    back = guard.clamp(VelocitySetpoint(np.array([-2.0, 0, 0])), outside, 10.0)
    assert isinstance(back.setpoint, VelocitySetpoint)
    assert back.setpoint.velocity[0] == -2.0
    on = guard.clamp(VelocitySetpoint(np.array([2.0, 1.0, 0])), outside, 10.0)
    assert isinstance(on.setpoint, VelocitySetpoint)
    assert on.setpoint.velocity == pytest.approx([0.0, 1.0, 0.0], abs=1e-9)
    home = guard.clamp(PositionSetpoint(np.array([-3.0, -3.0, 5.0])), outside, 0.05)
    assert isinstance(home.setpoint, PositionSetpoint)


def test_a_drone_that_follows_no_setpoints_crosses_what_it_cannot_stop_before() -> None:
    """Named only where it flies on towards the edge too fast, or is outside already."""
    guard = SetpointFilter(LIMITS, np.zeros(3))
    assert guard.crossed(at(14.0, -7.0, 5.0, velocity=(4.0, 0.0, 0.0))) == ("geofence",)
    assert guard.crossed(at(14.0, -7.0, 5.0, velocity=(-4.0, 0.0, 0.0))) == ()
    assert guard.crossed(at(14.0, -7.0, 5.0)) == ()
    assert guard.crossed(at(17.0, -7.0, 5.0)) == ("geofence",)
    assert SetpointFilter(WIDE, np.zeros(3)).crossed(at(0, 0, 20, velocity=(9.0, 0.0, 0.0))) == ()


def test_setpoints_that_are_not_finite_become_standing_still() -> None:
    """NaN never reaches a vehicle."""
    guard = SetpointFilter(LIMITS, np.zeros(3))
    for setpoint in (
        VelocitySetpoint(np.array([math.nan, 0, 0])),
        PositionSetpoint(np.array([0, math.inf, 0])),
        PositionSetpoint(np.zeros(3), math.nan),
        PositionSetpoint(np.zeros(3), passing_speed=math.inf),
        PositionSetpoint(np.zeros(3), line_from=np.array([0, 0, math.nan])),
    ):
        clamped = guard.clamp(setpoint, at(-3.0, -3.0, 5.0), 0.05)
        assert clamped.clipped_by == ("not_finite",)
        assert isinstance(clamped.setpoint, VelocitySetpoint)
        assert not clamped.setpoint.velocity.any()


def test_without_a_position_the_drone_does_not_move() -> None:
    """No boundary can be kept, so nothing but standing still is sent."""
    guard = SetpointFilter(LIMITS, np.zeros(3))
    lost = at(math.nan, 0.0, 0.0)
    clamped = guard.clamp(VelocitySetpoint(np.array([1.0, 0, 0])), lost, 0.05)
    assert clamped.clipped_by == ("no_position",)
    assert isinstance(clamped.setpoint, VelocitySetpoint)
    assert clamped.setpoint.velocity.tolist() == [0.0, 0.0, 0.0]
    somewhere = guard.clamp(PositionSetpoint(np.zeros(3)), lost, 0.05)
    assert somewhere.clipped_by == ("no_position",)
    assert isinstance(somewhere.setpoint, VelocitySetpoint)
    assert somewhere.setpoint.velocity.tolist() == [0.0, 0.0, 0.0]
    standing = guard.clamp(VelocitySetpoint(np.zeros(3), 0.3), lost, 0.05)
    assert standing.clipped_by == ()


WIDE = LimitsConfig(max_speed=4.0, max_climb=1.5, max_range=1000.0, max_yaw_rate=60.0)


@pytest.mark.parametrize(
    ("place", "speed", "names"),
    [
        ((50.0, 0.0, 5.0), 3.0, ()),
        ((50.0, 0.0, 5.0), 5.0, ("max_speed",)),
        ((0.0, 0.0, 50.0), 3.0, ("max_climb",)),
        ((0.0, 2000.0, 5.0), 3.0, ("max_range",)),
        ((0.0, 0.0, 200.0), 1.0, ("geofence",)),
    ],
)
def test_what_is_changed_of_a_place_is_named(
    place: tuple[float, float, float], speed: float, names: tuple[str, ...]
) -> None:
    """By the limit that changed it, of range, height or speed."""
    guard = SetpointFilter(WIDE, np.zeros(3))
    clamped = guard.clamp(PositionSetpoint(np.array(place), None, speed), at(0, 0, 5.0), 0.05)
    assert clamped.clipped_by == names
    assert isinstance(clamped.setpoint, PositionSetpoint)


def test_a_place_that_is_passed_is_flown_through_only_where_it_was_asked_for() -> None:
    """No faster than the way there; one that a boundary moved is stopped at, from anywhere."""
    guard = SetpointFilter(WIDE, np.zeros(3))
    here, start = at(0, 0, 5.0), np.array([0.0, -3.0, 5.0])
    near = PositionSetpoint(np.array([50.0, 0.0, 5.0]), None, 3.0, 2.5, start)
    sent = guard.clamp(near, here, 0.05).setpoint
    assert sent == near
    fast = guard.clamp(replace(near, speed=9.0, passing_speed=9.0), here, 0.05).setpoint
    assert isinstance(fast, PositionSetpoint)
    assert (fast.speed, fast.passing_speed) == (4.0, 4.0)
    beyond = guard.clamp(replace(near, position=np.array([0.0, 2e3, 5.0])), here, 0.05).setpoint
    assert isinstance(beyond, PositionSetpoint)
    assert beyond.passing_speed == 0.0
    assert beyond.line_from is None


@pytest.mark.parametrize("passing", [0.0, 1.5])
def test_a_vehicle_without_position_setpoints_passes_a_place_too(passing: float) -> None:
    """At the place itself it is as fast as asked, and before it hardly faster."""
    guard = SetpointFilter(WIDE, np.zeros(3), position_setpoints=False)
    place = PositionSetpoint(np.array([10.0, 0.0, 5.0]), None, 3.0, passing)
    sent = guard.clamp(place, at(9.999, 0, 5.0), 0.05).setpoint
    assert isinstance(sent, VelocitySetpoint)
    assert sent.velocity[0] == pytest.approx(passing, abs=0.01)


@pytest.mark.parametrize(
    ("asked", "sent"), [(0.5, 0.5), (-0.5, -0.5), (2.0, 1.047), (-2.0, -1.047)]
)
def test_a_turn_is_passed_on_up_to_its_limit(asked: float, sent: float) -> None:
    """60 degrees a second, either way, while the drone flies on."""
    guard = SetpointFilter(WIDE, np.zeros(3))
    clamped = guard.clamp(VelocitySetpoint(np.array([1.0, 0, 0]), asked), at(0, 0, 5.0), 10.0)
    assert isinstance(clamped.setpoint, VelocitySetpoint)
    assert clamped.setpoint.yaw_rate == pytest.approx(sent, abs=1e-3)
    assert clamped.setpoint.velocity == pytest.approx([1.0, 0.0, 0.0])
    assert clamped.clipped_by == (("max_yaw_rate",) if asked != sent else ())


@pytest.mark.parametrize(
    ("separation", "other", "free"),
    [(0.5, 0.4, False), (0.5, 40.0, True), (0.0, 0.4, True), (0.5, 0.0, True)],
)
def test_a_neighbour_within_the_separation_is_not_come_nearer(
    separation: float,
    other: float,
    free: bool,  # noqa: FBT001
) -> None:
    """Half a metre counts as well as three; none at all, or the very same place, bounds nothing."""
    limits = WIDE.model_copy(update={"separation": separation})
    guard = SetpointFilter(limits, np.zeros(3))
    near = Neighbour(np.array([other, 0.0, 5.0]), np.zeros(3))
    clamped = guard.clamp(VelocitySetpoint(np.array([1.0, 0, 0])), at(0, 0, 5.0), 10.0, [near])
    assert isinstance(clamped.setpoint, VelocitySetpoint)
    assert clamped.setpoint.velocity[0] == pytest.approx(1.0 if free else 0.0)
    assert clamped.clipped_by == (() if free else ("separation",))


def test_two_drones_keep_their_distance() -> None:
    """Flown straight at each other, both stop with the set distance between them."""
    limits = LimitsConfig(separation=3.0, max_speed=4.0)
    homes = [np.array([0.0, 0.0, 0.0]), np.array([30.0, 0.0, 0.0])]
    guards = [SetpointFilter(limits, home) for home in homes]
    drones = [KinematicVehicle((0.0, 0.0, 5.0)), KinematicVehicle((30.0, 1.0, 5.0))]
    for drone in drones:
        drone.mode = VehicleMode.GUIDED
    now, nearest, names = 0, math.inf, set[str]()
    for _ in range(400):
        states = [drone.read().odometry for drone in drones]
        targets = [states[1].position, states[0].position]
        for me, guard in enumerate(guards):
            other = Neighbour(states[1 - me].position, states[1 - me].velocity)
            asked = PositionSetpoint(targets[me], None, 4.0)
            clamped = guard.clamp(asked, states[me], 0.05, [other])
            drones[me].send(clamped.setpoint)
            names |= set(clamped.clipped_by)
        now += NANOSECONDS // 20
        for drone in drones:
            drone.advance_to(now)
        nearest = min(nearest, float(np.linalg.norm(drones[0].position - drones[1].position)))
    assert 2.9 < nearest < 3.5
    assert "separation" in names


def test_a_fence_that_is_none_is_refused() -> None:
    """Outlines that cross themselves and margins that fill the fence are configuration errors."""
    bow = [(0.0, 0.0), (10.0, 10.0), (10.0, 0.0), (0.0, 10.0)]
    with pytest.raises(ConfigError, match="crosses itself"):
        Geofence(GeofenceConfig(polygon=bow))
    with pytest.raises(ConfigError, match="no room"):
        Geofence(GeofenceConfig(polygon=[(0, 0), (1, 0), (1, 1), (0, 1)], margin=0.6))


@given(numbers, numbers, st.floats(-5, 30))
def test_the_nearest_allowed_place_is_allowed(x: float, y: float, z: float) -> None:
    """Whatever is asked, the place that is flown to lies inside."""
    fence = Geofence(LIMITS.geofence)
    assert fence.contains(fence.nearest_allowed(np.array([x, y, z])))


def test_a_place_out_of_a_zone_stays_within_the_range() -> None:
    """The zone lies across the edge of the range, and its nearest side beyond it."""
    zone = [(16.0, -10.0), (19.0, -10.0), (19.0, 10.0), (16.0, 10.0)]
    limits = LIMITS.model_copy(
        update={"geofence": GeofenceConfig(no_fly=[zone], ceiling=12.0, floor=1.0, margin=0.0)}
    )
    guard = SetpointFilter(limits, np.zeros(3))
    sent = guard.clamp(PositionSetpoint(np.array([17.9, 0.0, 1.0])), at(0.0, 0.0, 1.0), 0.05)
    assert isinstance(sent.setpoint, PositionSetpoint)
    assert sent.setpoint.position == pytest.approx([16.0, 0.0, 1.0], abs=0.01)
    assert sent.clipped_by == ("geofence",)


def test_where_fence_and_range_leave_no_place_the_drone_stands_still() -> None:
    """Home lies in a zone that reaches farther than the range."""
    zone = [(-25.0, -25.0), (25.0, -25.0), (25.0, 25.0), (-25.0, 25.0)]
    limits = LIMITS.model_copy(
        update={"geofence": GeofenceConfig(no_fly=[zone], ceiling=12.0, floor=1.0)}
    )
    guard = SetpointFilter(limits, np.zeros(3))
    sent = guard.clamp(PositionSetpoint(np.array([40.0, 0.0, 5.0])), at(0.0, 0.0, 5.0), 0.05)
    assert isinstance(sent.setpoint, VelocitySetpoint)
    assert not sent.setpoint.velocity.any()
    assert sent.clipped_by == ("max_range", "geofence")


def test_the_floor_lifts_a_place_no_farther_than_the_range() -> None:
    """A place at the edge of the range is lifted, and comes nearer by as much."""
    limits = LIMITS.model_copy(update={"geofence": GeofenceConfig(ceiling=12.0, floor=3.0)})
    guard = SetpointFilter(limits, np.zeros(3))
    sent = guard.clamp(PositionSetpoint(np.array([18.0, 0.0, 0.0])), at(0.0, 0.0, 5.0), 0.05)
    assert isinstance(sent.setpoint, PositionSetpoint)
    assert sent.setpoint.position == pytest.approx([math.sqrt(18.0**2 - 9.0), 0.0, 3.0], abs=0.01)


def clamped_velocity(
    guard: SetpointFilter,
    asked: tuple[float, float, float],
    odometry: Odometry,
    neighbours: list[Neighbour] | None = None,
) -> list[float]:
    """What is sent of a velocity, where the acceleration is no matter."""
    sent = guard.clamp(VelocitySetpoint(np.array(asked)), odometry, 10.0, neighbours or [])
    assert isinstance(sent.setpoint, VelocitySetpoint)
    velocity: list[float] = sent.setpoint.velocity.tolist()
    return velocity


@pytest.mark.parametrize(("reaction", "acceleration"), [(0.3, 3.0), (1.0, 1.0)])
@pytest.mark.parametrize("approach", [0.0, 1.0, -1.0])
def test_the_speed_towards_each_boundary_leaves_just_the_way_to_stop(
    reaction: float, acceleration: float, approach: float
) -> None:
    """Fence, ceiling, floor and range: what is flown meanwhile and while braking fills the room."""
    limits = LimitsConfig(
        max_speed=9.0,
        max_climb=9.0,
        max_range=120.0,
        takeoff_height=5.0,
        reaction_time=reaction,
        max_acceleration=acceleration,
        separation=2.0,
        geofence=GeofenceConfig(
            polygon=[(-50, -500), (50, -500), (50, 500), (-50, 500)], ceiling=20, floor=4, margin=1
        ),
    )
    for towards, place, room in (
        ((1, 0, 0), (45.0, 0.0, 12.0), 4.0),
        ((-1, 0, 0), (-45.0, 0.0, 12.0), 4.0),
        ((0, 0, 1), (0.0, 0.0, 17.0), 3.0),
        ((0, 0, -1), (0.0, 0.0, 7.0), 3.0),
        ((0, 1, 0), (0.0, 115.0, 12.0), 5.0),
    ):
        guard = SetpointFilter(limits, np.array([0.0, 0.0, 12.0]))
        way = np.array(towards, dtype=float)
        here = Odometry(np.array(place), approach * way, 0.0)
        speed = float(np.dot(clamped_velocity(guard, tuple(9.0 * way), here), way))
        flown_on = max(0.0, approach) * reaction
        stops_in = speed * reaction + speed**2 / (2 * acceleration)
        assert stops_in == pytest.approx(room - flown_on), towards


def test_each_drone_may_use_exactly_half_of_the_room() -> None:
    """Whatever the other one does; its own reaction and braking fill that half."""
    limits = LimitsConfig(max_speed=9.0, separation=3.0, max_acceleration=2.0, reaction_time=0.5)
    guard = SetpointFilter(limits, np.zeros(3))
    for other in (np.array([11.0, 0.0, 5.0]), np.array([-11.0, 0.0, 5.0])):
        way = np.sign(other) * np.array([1.0, 0.0, 0.0])
        near = Neighbour(other, -way)
        speed = float(np.dot(clamped_velocity(guard, tuple(9.0 * way), at(0, 0, 5.0), [near]), way))
        assert speed * 0.5 + speed**2 / 4 == pytest.approx((11.0 - 3.0) / 2)


def test_of_many_neighbours_the_far_ones_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Among fifty the setpoint and its limits are those of a look at every one of them."""
    random = np.random.default_rng(5)
    limits = LimitsConfig(max_speed=9.0, max_climb=3.0, separation=2.0, reaction_time=0.5)
    named = []
    for _ in range(300):
        places = random.uniform(-60, 60, (50, 3)) * random.uniform(0.1, 1.0)
        neighbours = [Neighbour(place, np.zeros(3)) for place in places]
        asked = VelocitySetpoint(random.uniform(-12, 12, 3))
        odometry = Odometry(np.zeros(3), random.uniform(-9, 9, 3), 0.0)
        made = []
        for few in (0, 50):
            monkeypatch.setattr(setpoint_filter, "_FEW", few)
            guard = SetpointFilter(limits, np.zeros(3))
            made.append(guard.clamp(asked, odometry, 10.0, neighbours))
        one, other = made
        assert isinstance(one.setpoint, VelocitySetpoint)
        assert isinstance(other.setpoint, VelocitySetpoint)
        assert one.setpoint.velocity.tolist() == other.setpoint.velocity.tolist()
        assert one.clipped_by == other.clipped_by
        named.append("separation" in one.clipped_by)
    assert 100 < sum(named) < 250


def test_two_boundaries_at_once_are_both_kept() -> None:
    """In a corner that is narrower than square, between two neighbours, and at the ceiling."""
    wedge = [(0.0, 0.0), (100.0, 20.0), (100.0, -20.0)]
    limits = LimitsConfig(max_speed=4.0, geofence=GeofenceConfig(polygon=wedge, ceiling=10.0))
    guard = SetpointFilter(limits, np.array([50.0, 0.0, 5.0]))
    at_tip = at(2.0, 0.0, 10.0)
    velocity = np.array(clamped_velocity(guard, (-4.0, 0.0, 1.0), at_tip))
    normals = [np.array([-20.0, side * 100.0, 0.0]) / math.hypot(20, 100) for side in (1, -1)]
    assert all(float(velocity @ normal) <= 1e-6 for normal in normals)
    assert velocity[2] <= 1e-6
    open_field = SetpointFilter(LimitsConfig(separation=2.0), np.zeros(3))
    near = [Neighbour(np.array([1.0, side, 5.0]), np.zeros(3)) for side in (0.2, -0.2)]
    held = np.array(clamped_velocity(open_field, (4.0, 1.0, 0.0), at(0, 0, 5.0), near))
    for neighbour in near:
        assert float(held @ (neighbour.position - np.array([0, 0, 5.0]))) <= 1e-6


def test_at_exactly_its_limits_nothing_is_clamped() -> None:
    """Speed, climb, turn, acceleration and range: equal is within."""
    limits = LimitsConfig(max_speed=4.0, max_climb=1.5, max_yaw_rate=90.0, max_acceleration=2.0)
    guard = SetpointFilter(limits, np.zeros(3))
    turn = math.radians(90.0)
    for velocity in ((4.0, 0.0, 1.5), (0.0, -4.0, -1.5)):
        guard.forget()
        asked = VelocitySetpoint(np.array(velocity), turn)
        sent = guard.clamp(asked, at(0, 0, 5.0, velocity=velocity), 0.05)
        assert sent.clipped_by == ()
        assert isinstance(sent.setpoint, VelocitySetpoint)
        assert sent.setpoint.velocity.tolist() == list(velocity)
    guard.forget()
    step = guard.clamp(VelocitySetpoint(np.array([0.5, 0, 0])), at(0, 0, 5.0), 0.25)
    assert step.clipped_by == ()
    high = SetpointFilter(limits, np.array([0.0, 0.0, 9.0]))
    far = PositionSetpoint(np.array([limits.max_range, 0.0, 9.0]), None, 4.0)
    assert high.clamp(far, at(0, 0, 9.0), 0.05).clipped_by == ()


def test_the_speed_of_a_position_setpoint_keeps_both_limits_on_the_way() -> None:
    """Straight up, level, and a slope where the climb limits; at the place it is as asked."""
    limits = LimitsConfig(max_speed=4.0, max_climb=1.5, cruise_speed=2.0, max_range=500.0)
    guard = SetpointFilter(limits, np.zeros(3))
    for place, asked, speed, names in (
        ((0.0, 0.0, 35.0), 3.0, 1.5, ("max_climb",)),
        ((0.0, 0.0, 1.0), 3.0, 1.5, ("max_climb",)),
        ((30.0, 0.0, 5.0), 9.0, 4.0, ("max_speed",)),
        ((30.0, 0.0, 45.0), 9.0, 1.5 * 50 / 40, ("max_climb",)),
        ((0.0, 0.0, 5.0), 3.0, 3.0, ()),
        ((30.0, 0.0, 5.0), None, 2.0, ()),
    ):
        sent = guard.clamp(PositionSetpoint(np.array(place), None, asked), at(0, 0, 5.0), 0.05)
        assert isinstance(sent.setpoint, PositionSetpoint)
        assert sent.setpoint.speed == pytest.approx(speed)
        assert sent.clipped_by == names


@pytest.mark.parametrize(("asked", "turns"), [(None, 0.0), (0.4, 0.6), (-0.4, -0.6), (3.0, 1.5708)])
def test_a_vehicle_without_position_setpoints_turns_on_its_way(
    asked: float | None, turns: float
) -> None:
    """Towards the yaw of the place, by its own limit; bounded or not."""
    limits = LimitsConfig(max_speed=4.0, max_yaw_rate=90.0, separation=2.0)
    guard = SetpointFilter(limits, np.zeros(3), position_setpoints=False)
    place = PositionSetpoint(np.array([20.0, 0.0, 5.0]), asked, 2.0)
    for neighbours in ([], [Neighbour(np.array([2.0, 0.0, 5.0]), np.zeros(3))]):
        sent = guard.clamp(place, at(0, 0, 5.0), 0.05, neighbours).setpoint
        assert isinstance(sent, VelocitySetpoint)
        assert sent.velocity.tolist() == pytest.approx([0.0 if neighbours else 2.0, 0.0, 0.0])
        assert sent.yaw_rate == pytest.approx(turns, abs=1e-4)


def test_after_a_stop_the_drone_accelerates_from_standing() -> None:
    """What was sent last counts, not what the drone still does: bad numbers, then a wish."""
    limits = LimitsConfig(max_speed=4.0, max_acceleration=2.0)
    for stop in (
        VelocitySetpoint(np.array([math.nan, 0.0, 0.0])),
        VelocitySetpoint(np.zeros(3)),
    ):
        guard = SetpointFilter(limits, np.zeros(3))
        moving = at(0, 0, 5.0, velocity=(3.0, 0.0, 0.0))
        lost = at(math.nan, 0, 5.0, velocity=(3.0, 0.0, 0.0))
        guard.clamp(stop, moving if math.isnan(stop.velocity[0]) else lost, 0.05)
        sent = guard.clamp(VelocitySetpoint(np.array([4.0, 0, 0])), moving, 0.05).setpoint
        assert isinstance(sent, VelocitySetpoint)
        assert sent.velocity.tolist() == pytest.approx([0.1, 0.0, 0.0])
    guard.forget()
    sent = guard.clamp(VelocitySetpoint(np.array([4.0, 0, 0])), moving, 0.05).setpoint
    assert isinstance(sent, VelocitySetpoint)
    assert sent.velocity.tolist() == pytest.approx([3.1, 0.0, 0.0])


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("which", ["position", "velocity"])
def test_odometry_with_one_bad_number_stops_the_drone(axis: int, which: str) -> None:
    """Any of the six, whatever it is: no boundary could be kept."""
    guard = SetpointFilter(LimitsConfig(), np.zeros(3))
    for bad in (math.nan, math.inf, -math.inf):
        numbers = {"position": np.array([0.0, 0.0, 5.0]), "velocity": np.zeros(3)}
        numbers[which][axis] = bad
        odometry = Odometry(numbers["position"], numbers["velocity"], 0.0)
        sent = guard.clamp(VelocitySetpoint(np.array([1.0, 0, 0]), 0.2), odometry, 0.05)
        assert sent.clipped_by == ("no_position",)
        assert isinstance(sent.setpoint, VelocitySetpoint)
        assert not sent.setpoint.velocity.any()
