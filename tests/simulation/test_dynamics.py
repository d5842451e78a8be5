"""The flight dynamics keep to the limits that they are given."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aerodaas.simulation.airframe import GRAVITY, Airframe, Wind
from aerodaas.simulation.dynamics import STEP, Multirotor

ACCELERATION, YAW_RATE = 3.0, math.radians(90)
axis = st.floats(-5, 5)
demands = st.lists(
    st.tuples(axis, axis, st.floats(-1.5, 1.5), st.floats(-10, 10)), min_size=1, max_size=6
)


def rotor(*, gust: float = 0.0, mean: tuple[float, float, float] = (0, 0, 0)) -> Multirotor:
    """Make a drone on the ground."""
    wind = Wind(mean, gust, "7/wind", STEP)
    return Multirotor(
        Airframe(),
        wind,
        max_acceleration=ACCELERATION,
        max_yaw_rate=YAW_RATE,
        start=(0.0, 0.0, 0.0),
        yaw=0.0,
    )


@settings(max_examples=25)
@given(demands, st.floats(0, 2))
def test_tilt_and_yaw_rate_limits_hold_in_any_wind(
    commands: list[tuple[float, float, float, float]], gust: float
) -> None:
    """No demand and no gust tilts it further or turns it faster than it may."""
    drone = rotor(gust=gust, mean=(3.0, -2.0, 0.0))
    limit = math.cos(math.radians(Airframe().max_tilt)) - 1e-9
    for x, y, z, rate in commands:
        for _ in range(80):
            drone.step((x, y, z), rate)
            motion = drone.motion()
            assert math.cos(motion.roll) * math.cos(motion.pitch) >= limit
            assert abs(motion.yaw_rate) <= YAW_RATE + 1e-9


@settings(max_examples=25)
@given(demands)
def test_speed_and_acceleration_limits_hold_in_still_air(
    commands: list[tuple[float, float, float, float]],
) -> None:
    """Speed stays within what was demanded, acceleration within its limit."""
    drone = rotor()
    for _ in range(200):
        drone.step((0.0, 0.0, 1.0), 0.0)
    fastest = 1.0
    for x, y, z, _ in commands:
        fastest = max(fastest, math.hypot(x, y, z))
        for _ in range(80):
            before = drone.velocity
            drone.step((x, y, z), 0.0)
            gain = math.dist(drone.velocity, before) / STEP
            if not drone.on_ground:
                assert gain <= 1.05 * ACCELERATION
            assert math.hypot(*drone.velocity) <= 1.02 * fastest


@given(st.floats(-3, 3), st.floats(-3, 3))
@settings(max_examples=10)
def test_a_velocity_is_reached_in_a_steady_wind(x: float, y: float) -> None:
    """The disturbance observer takes out the wind's steady push."""
    drone = rotor(mean=(4.0, -3.0, 0.0))
    for _ in range(200):
        drone.step((0.0, 0.0, 1.0), 0.0)
    for _ in range(700):
        drone.step((x, y, 0.0), 0.0)
    assert drone.velocity == pytest.approx((x, y, 0.0), abs=0.02)


@pytest.mark.parametrize(
    ("demand", "roll_sign", "pitch_sign"),
    [((0.0, 3.0, 1.0), 0, 1), ((3.0, 0.0, 1.0), 1, 0), ((0.0, -3.0, 1.0), 0, -1)],
)
def test_it_leans_the_way_it_accelerates(
    demand: tuple[float, float, float], roll_sign: int, pitch_sign: int
) -> None:
    """Facing north: north is nose down (positive pitch), east is right side down."""
    drone = Multirotor(
        Airframe(),
        Wind((0, 0, 0), 0.0, "", STEP),
        max_acceleration=ACCELERATION,
        max_yaw_rate=YAW_RATE,
        start=(0, 0, 0),
        yaw=math.pi / 2,
    )
    for _ in range(40):
        drone.step(demand, 0.0)
    motion = drone.motion()
    assert motion.roll == pytest.approx(roll_sign * abs(motion.roll), abs=1e-9)
    assert motion.pitch == pytest.approx(pitch_sign * abs(motion.pitch), abs=1e-9)
    assert max(abs(motion.roll), abs(motion.pitch)) > 0.1


def test_it_falls_without_motors() -> None:
    """With the motors off in the air, gravity and drag alone act, and the ground stops it."""
    drone = rotor()
    for _ in range(300):
        drone.step((0.0, 0.0, 3.0), 0.0)
    height = drone.position[2]
    for _ in range(300):
        drone.step(None, 0.0)
    assert drone.on_ground
    assert drone.position[2] == 0.0
    assert 0.7 < drone.impact / math.sqrt(2 * GRAVITY * height) < 1.3


def test_reading_ahead_changes_nothing() -> None:
    """Extrapolated reads lie between the steps and leave the state alone."""
    drone = rotor(gust=0.5)
    for _ in range(150):
        drone.step((1.0, 0.0, 1.0), 0.3)
    here, ahead = drone.motion(), drone.motion(STEP / 2)
    assert drone.motion() == here
    drone.step((1.0, 0.0, 1.0), 0.3)
    there = drone.motion()
    assert here.position[2] < ahead.position[2] < there.position[2]


@pytest.mark.parametrize("speed", [2.0, 5.0, 10.0])
def test_it_stops_beside_a_new_way_before_it_speeds_up_along_it(speed: float) -> None:
    """From 2.7 m/s east to any speed north: 1.2 m of braking, and what its lag adds."""
    drone = rotor()
    for _ in range(300):
        drone.step((0.0, 0.0, 1.5), 0.0)
    while drone.velocity[0] < 2.7:
        drone.step((3.0, 0.0, 0.0), 0.0)
    start = drone.position[0]
    for _ in range(round(4.0 / STEP)):
        drone.step((0.0, speed, 0.0), 0.0)
        assert math.hypot(*drone.acceleration) < 1.05 * ACCELERATION
    assert 1.2 < drone.position[0] - start < 2.0
    assert drone.velocity[1] > 0.9 * min(speed, 8.0)
