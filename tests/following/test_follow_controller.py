"""The follow controller: signs, limits, what happens to a lost target, and nonsense."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from aerodaas.clock import NANOSECONDS
from aerodaas.following import follow_controller
from aerodaas.following.follow_controller import FollowController, FollowPhase
from aerodaas.following.follow_settings import FollowLimits, LostPolicy
from aerodaas.following.steering import CommandShaper
from aerodaas.following.target import Observation, RelativeTarget
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.waypoints import VelocityCommand

LIMITS = FollowLimits()


def odometry(height: float = 1.5, yaw: float = 0.0) -> Odometry:
    """A drone at rest over the origin."""
    return Odometry(np.array([0.0, 0.0, height]), np.zeros(3), yaw)


def settle(
    sighting: RelativeTarget | None, state: Odometry | None = None, *, steps: int = 20
) -> VelocityCommand:
    """The command after two seconds of the same sighting at 10 Hz."""
    controller = FollowController(2.0, 1.5)
    command = None
    for step in range(steps):
        command = controller.step(Observation(step * NANOSECONDS // 10, sighting, state))
    assert command is not None
    return command


@pytest.mark.parametrize("state", [None, odometry(), odometry(yaw=2.0)])
@pytest.mark.parametrize("side", [1, -1])
def test_a_target_on_the_left_turns_the_drone_left(side: int, state: Odometry | None) -> None:
    """Yaw rates are counter-clockwise: positive to the left."""
    command = settle(RelativeTarget(side * 0.4, 2.0), state)
    assert side * command.yaw_rate > 0.3


@pytest.mark.parametrize("state", [None, odometry()])
def test_it_nears_a_far_target_and_backs_off_from_a_near_one(state: Odometry | None) -> None:
    """Forward is positive; in the middle between there is rest."""
    assert settle(RelativeTarget(0.0, 5.0), state).forward > 1.0
    assert settle(RelativeTarget(0.0, 1.2), state).forward < -0.3
    assert settle(RelativeTarget(0.0, 2.0), state).forward == pytest.approx(0, abs=1e-6)


def test_it_moves_along_the_line_of_sight() -> None:
    """A far target on the left is neared to the left."""
    command = settle(RelativeTarget(0.5, 5.0))
    assert command.left / command.forward == pytest.approx(math.tan(0.5))


def test_height_is_held_by_odometry_alone() -> None:
    """Too low climbs, too high descends, without odometry neither."""
    sighting = RelativeTarget(0.0, 2.0)
    assert settle(sighting, odometry(height=1.0)).up > 0.3
    assert settle(sighting, odometry(height=2.0)).up < -0.3
    assert settle(sighting).up == 0


def test_an_upper_bound_never_draws_the_drone_nearer() -> None:
    """Wherever the target is cut on all sides it may stand right in front."""
    assert settle(RelativeTarget(0.3, 6.0, bound=True), odometry()).forward <= 0
    assert settle(RelativeTarget(0.0, 1.0, bound=True), odometry()).forward < 0


def test_a_lost_target_means_slow_hold_search_and_give_up() -> None:
    """And a search turns to the side where the target went, until it gives up for good."""
    controller = FollowController(2.0, 1.5)
    lost = LostPolicy()
    speeds: dict[FollowPhase, list[VelocityCommand]] = {}
    for step in range(300):
        time = step / 10
        sighting = RelativeTarget(-0.5, 4.0) if time <= 2 else None
        command = controller.step(Observation(step * NANOSECONDS // 10, sighting, odometry()))
        assert (command is None) == (controller.phase is FollowPhase.WAITING)
        if command is not None:
            speeds.setdefault(controller.phase, []).append(command)
    assert list(speeds) == [
        FollowPhase.FOLLOWING,
        FollowPhase.SLOWING,
        FollowPhase.HOLDING,
        FollowPhase.SEARCHING,
    ]
    assert len(speeds[FollowPhase.FOLLOWING]) == pytest.approx(10 * (2 + lost.coast), abs=2)
    slowing = [command.forward for command in speeds[FollowPhase.SLOWING]]
    assert slowing[-1] < 0.4 * slowing[0]
    still = speeds[FollowPhase.HOLDING][-1]
    assert (still.forward, still.left, still.yaw_rate) == (0, 0, 0)
    search = speeds[FollowPhase.SEARCHING]
    assert search[-1].yaw_rate == pytest.approx(-lost.search_rate)
    assert sum(abs(command.yaw_rate) for command in search) / 10 > math.tau
    assert all(abs(command.forward) < 1e-9 for command in search)
    assert controller.phase is FollowPhase.WAITING
    back = Observation(40 * NANOSECONDS, RelativeTarget(0.0, 4.0), odometry())
    assert controller.step(back) is not None


def test_nothing_is_commanded_before_the_first_sighting() -> None:
    """Other navigation goes on meanwhile."""
    controller = FollowController(2.0, 1.5)
    assert controller.step(Observation(0, None, odometry())) is None


def test_stamps_that_run_back_are_left_out() -> None:
    """A late frame does not undo a newer one."""
    controller = FollowController(2.0, 1.5)
    assert controller.step(Observation(5, RelativeTarget(0, 3))) is not None
    assert controller.step(Observation(5, RelativeTarget(0, 3))) is None
    assert controller.step(Observation(4, RelativeTarget(0, 3))) is None


def test_the_integral_does_not_wind_up_while_the_drone_is_far() -> None:
    """After ten seconds of chasing at full speed, the drone brakes when it arrives."""
    controller = FollowController(2.0, 1.5)
    for step in range(100):
        controller.step(Observation(step * NANOSECONDS // 10, RelativeTarget(0.0, 12.0)))
    command = None
    for step in range(100, 115):
        command = controller.step(Observation(step * NANOSECONDS // 10, RelativeTarget(0.0, 1.9)))
    assert command is not None
    assert command.forward < 0


NUMBERS = st.one_of(
    st.floats(-1e3, 1e3), st.sampled_from([math.nan, math.inf, -math.inf, 0.0, 1e-300, 1e300])
)


@given(
    steps=st.lists(
        st.tuples(NUMBERS, NUMBERS, NUMBERS, NUMBERS, st.booleans(), st.integers(-100, 3000)),
        max_size=40,
    )
)
@settings(max_examples=150)
def test_whatever_it_sees_the_commands_stay_finite_and_within_limits(
    steps: list[tuple[float, float, float, float, bool, int]],
) -> None:
    """Nonsense in sightings, odometry and stamps never makes a runaway."""
    controller = FollowController(2.0, 1.5)
    stamp = 0
    last: NDArray[np.float64] = np.zeros(3)
    for bearing, distance, place, yaw, seen, milliseconds in steps:
        stamp += milliseconds * 1_000_000
        state = Odometry(np.array([place, 0.0, 1.0]), np.zeros(3), yaw)
        sighting = RelativeTarget(bearing, distance) if seen else None
        command = controller.step(Observation(stamp, sighting, state, state, stamp))
        if command is None:
            continue
        assert np.isfinite(command.velocity).all()
        fastest = LIMITS.forward if command.forward >= 0 else LIMITS.backward
        assert np.hypot(command.forward, command.left) <= fastest + 1e-9
        assert abs(command.up) <= LIMITS.climb + 1e-9
        assert abs(command.yaw_rate) <= LIMITS.yaw_rate + 1e-9
        assert np.linalg.norm(command.velocity - last) <= LIMITS.stopping * 0.5 + 1e-9 or (
            not command.velocity.any()
        )
        last = command.velocity


@given(
    st.lists(st.tuples(st.floats(-4, 4), st.floats(-4, 4), st.floats(0.0, 0.3)), max_size=20),
)
@example([(-0.2, -4.0, 0.3)] * 9 + [(4.0, 0.0, 0.01)] * 9)
def test_no_velocity_on_the_way_to_another_is_too_fast(
    steps: list[tuple[float, float, float]],
) -> None:
    """Backing off may be faster than anything else; what follows it is not."""
    shaper = CommandShaper(LIMITS)
    for forward, left, dt in steps:
        command = shaper.shape(np.array([forward, left, 0.0]), 0.0, dt, 0)
        assert abs(command.left) <= LIMITS.forward + 1e-9
        assert command.forward >= -LIMITS.backward - 1e-9
        if command.forward >= 0:
            assert np.hypot(command.forward, command.left) <= LIMITS.forward + 1e-9


def test_it_travels_to_its_actor() -> None:
    """PIDs and filters are sent by value."""
    assert pickle.loads(pickle.dumps(FollowController(2.0, 1.5))).distance == 2.0  # noqa: S301


def test_a_command_that_gives_way_has_no_ramp() -> None:
    """It is within the speeds, and said to be evasive; the next one is by the ramp again."""
    limits = FollowLimits()
    shaper = CommandShaper(limits)
    wanted = np.array([-9.0, 0.0, 1.5])
    command = shaper.shape(wanted, 0.0, 0.1, 1, evasive=True)
    assert (command.forward, command.up, command.evasive) == (-limits.backward, 1.5, True)
    command = shaper.shape(np.zeros(3), 0.0, 0.1, 1)
    assert not command.evasive
    assert np.hypot(command.forward + limits.backward, command.up - 1.5) < 0.2


@pytest.mark.parametrize(
    ("doubt", "backs_off"), [(follow_controller._DOUBT, True), (math.inf, False)]
)
def test_it_brakes_before_it_is_sure_that_they_turn_round(
    monkeypatch: pytest.MonkeyPatch, doubt: float, *, backs_off: bool
) -> None:
    """Half a second after a turn it no longer flies on, as by the smooth filter alone it would."""
    monkeypatch.setattr(follow_controller, "_DOUBT", doubt)
    controller = FollowController(4.0, 1.5)
    command = None
    east = speed = 0.0
    for tick in range(46):
        turned = max(0, tick - 40)
        person = RelativeTarget(0.0, 4.5 + 0.1 * (tick - turned) - 0.13 * turned - east)
        state = Odometry(np.array([east, 0.0, 1.5]), np.array([speed, 0.0, 0.0]), 0.0)
        stamp = tick * NANOSECONDS // 10
        command = controller.step(Observation(stamp, person, state, people=(person,)))
        assert command is not None
        speed = command.forward
        east += speed / 10
    assert command is not None
    assert not command.evasive
    assert (command.forward < 0.0) is backs_off


@pytest.mark.parametrize("falls", [True, False])
def test_who_gets_up_does_not_come(*, falls: bool) -> None:
    """Their box leaps towards the drone by a body's length; of who stood, it is believed."""
    controller = FollowController(2.0, 1.5)
    state = odometry()
    commands = []
    for tick in range(60):
        lies, near = 15 <= tick < 40, tick >= 37
        distance = max(2.0, 3.2 - 0.4 * (tick - 36)) if near else 3.2
        person = RelativeTarget(0.0, distance, top=0.3 if lies and falls else 1.4)
        stamp = tick * NANOSECONDS // 5
        commands.append(controller.step(Observation(stamp, person, state, people=(person,))))
    evasive = [one is not None and one.evasive for one in commands]
    assert any(evasive) is not falls
