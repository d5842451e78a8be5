"""The guard against contact: who comes at the drone is given way to, and nobody else."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerodaas.clock import NANOSECONDS
from aerodaas.following import contact_guard
from aerodaas.following.contact_guard import ContactGuard
from aerodaas.following.follow_settings import FollowLimits
from aerodaas.following.target import seen_from
from aerodaas.geometry.frames import Vector, body_to_enu, enu_to_body
from aerodaas.messages.odometry import Odometry

LIMITS = FollowLimits()
INTERVAL = 0.1
EAST, NORTH, UP = 0, 1, 2

Walk = Callable[[float], tuple[float, float]]
"""Metres east and north of home by seconds."""


def straight(start: tuple[float, float], velocity: tuple[float, float]) -> Walk:
    """Walk from `start` in metres at `velocity` in m/s, both east and north."""
    return lambda time: (start[0] + velocity[0] * time, start[1] + velocity[1] * time)


class Drone:
    """A point that flies as it is told, with a drone's lag and acceleration, before some walkers.

    All quantities are ENU; only what the guard sees and answers is turned by `yaw`.
    """

    def __init__(
        self,
        walks: Sequence[Walk],
        *,
        height: float = 1.5,
        yaw: float = 0.0,
        follows: bool = False,
    ) -> None:
        self.guard = ContactGuard(LIMITS)
        self.walks = walks
        self.follows = follows
        """Whether the first of them is followed."""
        self.position = np.array([0.0, 0.0, height])
        self.velocity = np.zeros(3)
        self.yaw = yaw
        self.cruise = np.zeros(3)
        """Velocity flown while the guard is content, m/s."""
        self.visible: Callable[[float], bool] = lambda _: True
        self.commands: list[Vector | None] = []
        """Of each frame, ENU m/s."""
        self.alarmed = False
        self.nearest = math.inf
        self.stamp = 0

    def fly(self, duration: float) -> None:
        """Fly for `duration` seconds, with a frame each 0.1 s that is answered at once."""
        wanted = [self.cruise] * round(LIMITS.reply / 0.01)
        for tick in range(round(duration / 0.01)):
            time = tick * 0.01
            self.stamp = round(time * NANOSECONDS)
            if tick % round(INTERVAL / 0.01) == 0:
                pose = Odometry(self.position.copy(), self.velocity.copy(), self.yaw)
                places = [walk(time) for walk in self.walks] if self.visible(time) else []
                seen = [seen_from(pose, place) for place in places]
                target = seen[0] if seen and self.follows else None
                self.guard.see(seen, pose, self.stamp, INTERVAL, target=target)
                answer = self.guard.evade(pose, self.stamp)
                self.alarmed |= self.guard.alarming
                self.commands.append(None if answer is None else body_to_enu(answer, self.yaw))
            asked = self.commands[-1]
            wanted.append(self.cruise if asked is None else asked)
            change = wanted[tick] - self.velocity
            size = float(np.linalg.norm(change))
            gained = min(size, LIMITS.evasion * 0.01)
            self.velocity = self.velocity + change * gained / max(size, 1e-9)
            self.position = self.position + self.velocity * 0.01
            for walk in self.walks:
                gap = math.hypot(*(np.array(walk(time)) - self.position[:2]))
                self.nearest = min(self.nearest, gap)

    @property
    def gave_way(self) -> list[Vector]:
        """The commands by which it gave way."""
        return [one for one in self.commands if one is not None]


@given(pace=st.floats(-1.0, 5.0), later=st.floats(0.0, 1.0), delay=st.floats(0.0, 0.5))
def test_the_headway_is_what_a_turn_costs(pace: float, later: float, delay: float) -> None:
    """Closing at twice the pace until the drone answers, then until it flies as fast away."""
    guard = ContactGuard(LIMITS)
    closing = 2.0 * min(max(pace, 0.0), LIMITS.forward)
    lost = guard.headway(pace, delay) - LIMITS.contact
    assert lost == pytest.approx(closing * (delay + LIMITS.reply) + closing**2 / 6.0)
    assert guard.headway(pace + later, delay) >= guard.headway(pace, delay)


@pytest.mark.parametrize("speed", [0.9, 1.3, 1.8])
@pytest.mark.parametrize("yaw", [0.0, 2.0, -3.0])
@pytest.mark.parametrize("bearing", [0.0, 0.5, -0.5])
@pytest.mark.parametrize("follows", [True, False])
def test_who_comes_is_backed_off_from(
    speed: float, yaw: float, bearing: float, *, follows: bool
) -> None:
    """Straight away from them, whichever way the camera looks; not from afar."""
    heading = yaw + bearing
    ahead = np.array([math.cos(heading), math.sin(heading), 0.0])
    start, walk = 6.0 * ahead, -speed * ahead
    walks = [straight((start[0], start[1]), (walk[0], walk[1]))]
    drone = Drone(walks, yaw=yaw, follows=follows)
    drone.fly(6.0 / speed)
    assert drone.commands[10] is None
    first = drone.gave_way[0]
    assert first @ ahead < -0.7 * LIMITS.backward
    assert drone.nearest > LIMITS.contact


def test_a_drone_that_flies_towards_them_gives_way_sooner() -> None:
    """What counts is how fast both close."""
    started = []
    for speed in (0.0, 1.3):
        drone = Drone([straight((8.0, 0.0), (-1.3, 0.0))])
        drone.cruise = drone.velocity = np.array([speed, 0.0, 0.0])
        drone.fly(6.0)
        first = next(number for number, one in enumerate(drone.commands) if one is not None)
        started.append(8.0 - (1.3 + speed) * first * INTERVAL)
        assert drone.nearest > LIMITS.contact
    assert started[1] > started[0] + 0.5


@pytest.mark.parametrize("yaw", [0.0, 2.0])
@pytest.mark.parametrize("left", [0.25, -0.25])
def test_where_backing_off_is_too_late_it_steps_aside(left: float, yaw: float) -> None:
    """To the side that they do not go to, by whichever frame that is reckoned.

    East and north are forward and left for a yaw of 0; somebody who comes west and drifts north
    passes on the drone's left, so that it goes south, to its right.
    """
    start, walk = (body_to_enu(np.array(one), yaw) for one in ((2.4, 0, 0), (-1.8, left, 0)))
    drone = Drone([straight((start[0], start[1]), (walk[0], walk[1]))], yaw=yaw)
    drone.velocity = body_to_enu(np.array([1.3, 0.0, 0.0]), yaw)
    drone.fly(0.8)
    flown = enu_to_body(drone.gave_way[-1], yaw)
    assert flown[1] * left < -0.2
    assert flown[0] < -0.5


def test_somebody_beside_is_not_stepped_into() -> None:
    """Of two people at once, the one in the way and the one beside it both count."""
    for side in (1.0, -1.0):
        drone = Drone([straight((2.4, 0.0), (-1.8, 0.0)), straight((0.6, 0.7 * side), (0.0, 0.0))])
        drone.velocity = np.array([1.3, 0.0, 0.0])
        drone.fly(0.8)
        assert all(one[NORTH] * side < 0.1 for one in drone.gave_way)
        assert any(one[NORTH] * side < -0.5 for one in drone.gave_way)


def test_two_who_come_side_by_side_are_both_kept_clear_of() -> None:
    """The farther one walks where a step to that side would lead."""
    for side in (1.0, -1.0):
        other = straight((2.6, 0.9 * side), (-1.8, 0.0))
        drone = Drone([straight((2.4, 0.0), (-1.8, -0.05 * side)), other])
        drone.velocity = np.array([1.3, 0.0, 0.0])
        drone.fly(0.8)
        assert all(one[NORTH] * side < 0.1 for one in drone.gave_way)
        drone = Drone([straight((2.4, 0.0), (-1.8, 0.05 * side)), other])
        drone.velocity = np.array([1.3, 0.0, 0.0])
        drone.fly(0.8)
        assert any(one[NORTH] * side < -0.5 for one in drone.gave_way)


def test_above_the_head_it_climbs() -> None:
    """Which leaves more than a step aside; below, it would fly past a face."""
    for height, climbs in ((2.1, True), (1.88, False), (1.5, False), (0.6, False)):
        drone = Drone([straight((2.0, 0.0), (-1.8, 0.0))], height=height)
        drone.velocity = np.array([1.3, 0.0, 0.0])
        drone.fly(0.8)
        assert any(one[UP] > 1.0 for one in drone.gave_way) is climbs
        assert all(one[UP] >= 0.0 for one in drone.gave_way)


def test_below_the_head_it_never_climbs() -> None:
    """Though it would leave most: between people on both sides, before one who comes."""
    ahead = np.array([1.0, 0.0, 0.0])
    stands = [(np.array([-0.5, side, 0.0]), np.zeros(3)) for side in (1.0, -1.0)]
    walks = [(1.2 * ahead, -1.8 * ahead), *stands]
    for height, climbs in ((contact_guard._HEAD + 0.01, True), (contact_guard._HEAD, False)):
        guard = ContactGuard(LIMITS)
        pose = Odometry(np.array([0.0, 0.0, height]), ahead, 0.0)
        assert bool(guard._choose(ahead, walks, pose)[UP] > 0.0) is climbs


def test_it_ends_once_nobody_comes_any_more() -> None:
    """Sooner than it is over for somebody who went out of sight."""
    drone = Drone([lambda time: (1.4 + 1.3 * abs(time - 2.0), 0.0)], follows=True)
    drone.fly(3.0)
    assert drone.commands[20] is not None
    assert drone.commands[26] is None


def test_it_ends_though_somebody_else_comes_from_afar() -> None:
    """It is over with the danger of whom it gave way to."""

    def frames(*others: Walk) -> list[bool]:
        drone = Drone([lambda time: (1.4 + 1.3 * abs(time - 2.0), 0.0), *others], follows=True)
        drone.fly(3.0)
        return [one is not None for one in drone.commands]

    alone = frames()
    assert any(alone)
    assert frames(straight((14.0, -2.0), (-1.3, 0.0))) == alone


@pytest.mark.parametrize(
    "walk",
    [
        straight((1.2, 0.0), (0.0, 0.0)),
        straight((5.0, 1.5), (-1.3, 0.0)),
        straight((2.0, 0.0), (1.0, 0.0)),
    ],
    ids=["stands", "passes", "goes away"],
)
def test_nobody_else_is_given_way_to(walk: Walk) -> None:
    """They are the approach's business."""
    drone = Drone([walk])
    drone.fly(4.0)
    assert drone.gave_way == []


def test_who_comes_and_is_out_of_sight_is_still_given_way_to() -> None:
    """Too near to be seen is no reason to stop; a moment later it is over."""
    drone = Drone([straight((4.0, 0.0), (-1.3, 0.0))])
    drone.visible = lambda time: time < 2.0
    drone.fly(6.0)
    assert all(one is not None for one in drone.commands[20:27])
    assert drone.commands[-1] is None
    assert not drone.guard.evading


def test_the_direction_is_kept_while_the_drone_turns() -> None:
    """Back is where they came from, whichever way the camera looks meanwhile."""
    drone = Drone([straight((4.0, 0.0), (-1.3, 0.0))])
    drone.fly(2.2)
    before = drone.gave_way[-1]
    pose = Odometry(drone.position, drone.velocity, math.pi / 2)
    answer = drone.guard.evade(pose, drone.stamp)
    assert answer is not None
    assert answer == pytest.approx(enu_to_body(before, math.pi / 2), abs=1e-9)
    assert answer[1] > 1.0


def test_without_odometry_what_closes_is_what_counts() -> None:
    """The people move in relation to a drone that is taken to stand still."""
    guard = ContactGuard(LIMITS)
    still = Odometry(np.zeros(3), np.zeros(3), 0.0)
    answer = None
    for step in range(30):
        stamp = round(step * INTERVAL * NANOSECONDS)
        guard.see([seen_from(still, (4.0 - 1.3 * step * INTERVAL, 0.0))], None, stamp, INTERVAL)
        answer = guard.evade(None, stamp)
    assert answer is not None
    assert answer[0] < -1.0


def test_what_is_predicted_is_what_a_reply_and_the_way_round_cost() -> None:
    """Closing at 1 m/s for the reply, then until the drone flies as fast away; later by a frame."""
    guard = ContactGuard(LIMITS)
    pose = Odometry(np.zeros(3), np.zeros(3), 0.0)
    guard.see([], pose, 0, INTERVAL)
    walks = [(np.array([3.0, 0.0, 0.0]), np.array([-1.0, 0.0, 0.0]))]
    back = np.array([-2.0, 0.0, 0.0])
    lost = LIMITS.reply + 1.0 / (2.0 * LIMITS.evasion)
    assert guard._room(back, walks, pose) == pytest.approx(3.0 - lost, abs=0.01)
    later = guard._room(back, walks, pose, late=True)
    assert later == pytest.approx(3.0 - lost - INTERVAL, abs=0.01)


def test_how_fast_the_followed_person_goes_away_counts_while_in_sight() -> None:
    """Who comes is told by a negative speed; who is out of sight or not followed, by none."""
    walk = straight((6.0, 0.0), (-1.3, 0.0))
    for follows in (True, False):
        drone = Drone([walk], follows=follows)
        drone.fly(1.5)
        pose = Odometry(drone.position, drone.velocity, 0.0)
        away = drone.guard.away(pose, drone.stamp)
        assert away == (pytest.approx(-1.3, abs=0.2) if follows else math.inf)
        drone.guard.see([], pose, drone.stamp + 1, INTERVAL)
        assert drone.guard.away(pose, drone.stamp + 1) == math.inf


@pytest.mark.parametrize(
    ("speed", "follows", "gives_way", "alarms"),
    [
        (0.0, True, False, False),
        (0.5, True, True, False),
        (1.0, True, True, True),
        (0.0, False, True, True),
        (0.5, False, True, True),
    ],
)
def test_who_is_followed_and_only_stops_is_no_alarm(
    speed: float, *, follows: bool, gives_way: bool, alarms: bool
) -> None:
    """The estimate of somebody who stops swings; the approach keeps its distance from them."""
    drone = Drone([straight((1.6, 0.0), (-speed, 0.0))], follows=follows)
    drone.cruise = drone.velocity = np.array([1.0, 0.0, 0.0])
    drone.fly(0.5)
    assert bool(drone.gave_way) is gives_way
    assert drone.alarmed is alarms


@pytest.mark.parametrize(("speed", "waits"), [(1.2, 0), (3.5, 1)])
def test_who_is_far_must_seem_to_come_twice(
    monkeypatch: pytest.MonkeyPatch, speed: float, waits: int
) -> None:
    """A runner is given way to a frame later than without that rule; who is near, at once."""
    first = {}
    for far in (4.0, math.inf):
        monkeypatch.setattr(contact_guard, "_FAR", far)
        guard, pose = ContactGuard(LIMITS), Odometry(np.array([0.0, 0.0, 1.5]), np.zeros(3), 0.0)
        for number in range(200):
            place = (20.0 - speed * number * INTERVAL, 0.0)
            stamp = round(number * INTERVAL * NANOSECONDS)
            guard.see([seen_from(pose, place)], pose, stamp, INTERVAL)
            if guard.evade(pose, stamp) is not None:
                first[far] = number
                break
    assert first[4.0] - first[math.inf] == waits


def test_the_people_are_forgotten() -> None:
    """With another target, the drone starts anew."""
    drone = Drone([straight((4.0, 0.0), (-1.3, 0.0))])
    drone.fly(2.2)
    before = drone.guard.evading
    drone.guard.reset()
    assert (before, drone.guard.evading) == (True, False)
    pose = Odometry(drone.position, drone.velocity, 0.0)
    assert drone.guard.evade(pose, drone.stamp) is None
    assert drone.guard.away(pose, drone.stamp) == math.inf
