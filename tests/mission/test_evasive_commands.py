"""Commands that give way to a person: at once, within every limit and boundary, while following."""

from __future__ import annotations

import numpy as np
import pytest
from flights import Flight, flight, live

from aerodaas.config.model import GeofenceConfig, LimitsConfig
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.messages.mission import MissionState as S
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.vehicle import VelocitySetpoint
from aerodaas.messages.waypoints import NavigationType, VelocityCommand
from aerodaas.mission.commands import Pause, Resume, ReturnHome, StreamItem
from aerodaas.mission.safety.setpoint_filter import SetpointFilter

LIMITS = LimitsConfig(max_speed=4.0, max_climb=1.5, max_acceleration=3.0)
STEP = 0.05


def command(*, evasive: bool, forward: float = -2.0) -> StreamItem:
    """One velocity command of a follower."""
    item = VelocityCommand(forward, evasive=evasive)
    return StreamItem("drone/follow", AeroNavigation(NavigationType.ANALYTICS_DRIVEN, [item]))


def following(limits: LimitsConfig = LIMITS) -> Flight:
    """A drone that flies east at 1 m/s behind somebody."""
    flown = flight(live(), limits=limits)
    flown.run_to(S.HOLDING)
    flown.keep_saying(lambda: command(evasive=False, forward=1.0), 6.0, rate=10)
    flown.expect(S.FOLLOWING)
    assert flown.vehicle.velocity[0] == pytest.approx(1.0, abs=0.05)
    return flown


def sent(flown: Flight) -> VelocitySetpoint:
    """What was sent last."""
    setpoint = flown.vehicle.sent[-1]
    assert isinstance(setpoint, VelocitySetpoint)
    return setpoint


def test_it_is_sent_at_once_and_another_command_by_the_ramp() -> None:
    """From 1 m/s towards somebody to 2 m/s away within one turn of the loop."""
    for evasive, velocity in ((True, -2.0), (False, 1.0 - LIMITS.max_acceleration * STEP)):
        flown = following()
        flown.tell(command(evasive=evasive))
        flown.turn()
        assert sent(flown).velocity[0] == pytest.approx(velocity, abs=0.01)


def test_after_giving_way_the_ramp_holds_again() -> None:
    """From the velocity that was sent last."""
    flown = following()
    flown.tell(command(evasive=True))
    flown.turn()
    flown.tell(command(evasive=False, forward=1.0))
    flown.turn()
    assert sent(flown).velocity[0] == pytest.approx(-2.0 + LIMITS.max_acceleration * STEP)


def test_the_limits_of_speed_hold() -> None:
    """Giving way is no licence: across, up and turning are clipped as ever."""
    guard = SetpointFilter(LIMITS, np.zeros(3))
    pose = Odometry(np.array([0.0, 0.0, 5.0]), np.zeros(3), 0.0)
    asked = VelocitySetpoint(np.array([-9.0, 0.0, 9.0]), 9.0, evasive=True)
    clamped = guard.clamp(asked, pose, STEP)
    assert isinstance(clamped.setpoint, VelocitySetpoint)
    assert clamped.setpoint.velocity.tolist() == pytest.approx([-4.0, 0.0, 1.5])
    assert clamped.setpoint.yaw_rate == pytest.approx(np.pi / 2)
    assert set(clamped.clipped_by) == {"max_speed", "max_climb", "max_yaw_rate"}


@pytest.mark.parametrize(
    ("velocity", "axis", "least"),
    [((-2.0, 0.0, 0.0), 0, -3.0), ((0.0, 1.5, 0.0), 1, 0.0), ((0.0, 0.0, -1.5), 2, 1.0)],
    ids=["fence behind", "fence beside", "minimum height"],
)
def test_boundaries_hold_while_giving_way(
    velocity: tuple[float, float, float], axis: int, least: float
) -> None:
    """At the fence and at minimum height the drone stops, whoever comes."""
    corners = [(-3.0, -9.0), (20.0, -9.0), (20.0, 3.0), (-3.0, 3.0)]
    limits = LIMITS.model_copy(update={"geofence": GeofenceConfig(polygon=corners, floor=1.0)})
    flown = following(limits)
    flown.vehicle.position[:2] = (-1.0, 1.0)
    move = VelocityCommand(*velocity, evasive=True)
    item = StreamItem("drone/follow", AeroNavigation(NavigationType.ANALYTICS_DRIVEN, [move]))
    flown.keep_saying(lambda: item, 5.0, rate=10)
    flown.expect(S.FOLLOWING)
    fence = flown.mission.fence
    assert all(fence.contains(place) for place in flown.track[-100:])
    reached = float(flown.vehicle.position[axis])
    assert abs(reached - (3.0 if axis == 1 else least)) < 1.1


def test_a_paused_drone_stays_where_it_is() -> None:
    """The operator's word goes before the follower's; resumed, it gives way by the next command."""
    flown = following()
    flown.tell(Pause())
    flown.run(3.0)
    stood = flown.vehicle.position.copy()
    flown.keep_saying(lambda: command(evasive=True), 3.0, rate=10)
    flown.expect(S.PAUSED)
    assert np.linalg.norm(flown.vehicle.position - stood) < 0.1
    flown.tell(Resume())
    flown.tell(command(evasive=True))
    flown.run(0.2)
    flown.expect(S.FOLLOWING)
    assert sent(flown).velocity[0] == pytest.approx(-2.0)


def test_a_returning_drone_goes_on_home() -> None:
    """It takes no more commands of a follower, those that give way included."""
    flown = following()
    flown.tell(ReturnHome("the operator asked"))
    flown.turn()
    answer = flown.tell(command(evasive=True, forward=2.0))
    assert not answer.accepted
    flown.run()
    flown.expect(S.LANDED)
    assert np.linalg.norm(flown.vehicle.position[:2]) < 0.5
