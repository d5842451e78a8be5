"""A follower and somebody who falls: a fall is no walk, and who lies is watched, not neared."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import pytest
from follow_world import World, vest_world

from aerodaas.analytics.follow.followers import VipFollowAnalytics
from aerodaas.following.follow_controller import FollowPhase


@dataclass
class Falling(World):
    """Falls forward, away from the drone, at a time: the vest goes down and a metre ahead."""

    falls: float = 12.0
    rises: float = math.inf

    def box(self) -> tuple[float, float, float, float] | None:
        """The vest as it is at the time; its feet stay where the target is."""
        share = min(max((self.time - self.falls) / 0.6, 0.0), 1.0)
        share -= min(max((self.time - self.rises) / 0.6, 0.0), 1.0)
        feet, base, height = self.target, self.target_base, self.target_height
        east, north = feet(self.time)
        self.target = lambda _: (east + 1.1 * share, north)
        self.target_base = base * (1 - share)
        self.target_height = height * (1 - share) + 0.25 * share
        try:
            return super().box()
        finally:
            self.target, self.target_base, self.target_height = feet, base, height


def falling_world(speed: float, rate: float) -> Falling:
    """A person who falls after six seconds of walking at `speed`."""
    upright = vest_world(lambda time: (4 + speed * min(max(time - 6, 0), 6), 0.0), rate)
    return Falling(**{one.name: getattr(upright, one.name) for one in fields(upright)})


@pytest.mark.parametrize("speed", [0.4, 0.7, 0.9])
@pytest.mark.parametrize("rate", [5.0, 10.0])
@pytest.mark.parametrize("unseen", [0.0, 0.4])
def test_a_fall_is_not_taken_for_walking(speed: float, rate: float, unseen: float) -> None:
    """The drone does not fly after the chest, over the feet, and knows them lying for the same."""
    world = falling_world(speed, rate)
    world.hidden = lambda time: 0 < time - world.falls - 0.3 <= unseen
    follow = VipFollowAnalytics()
    distances = world.run(follow, 22)
    assert min(distances) > 1.0
    assert distances[-1] < 2.5
    assert follow.controller.phase is FollowPhase.FOLLOWING
    assert world.alerts == []


def test_who_falls_while_the_drone_lags_behind_is_come_up_to() -> None:
    """To the wanted distance from the feet, though the chest lies farther away."""
    world = falling_world(1.0, 5.0)
    world.falls = 7.0
    world.target = lambda time: (4 + 1.4 * min(max(time - 6, 0), 1.0), 0.0)
    distances = world.run(VipFollowAnalytics(), 25)
    assert max(distances[35:45]) > 2.7
    assert min(distances) > 1.2
    assert distances[-1] == pytest.approx(2.0, abs=0.35)


def test_who_has_fallen_is_watched_even_when_out_of_sight() -> None:
    """They get up where they fell; a drone that turns round in search finds somebody else."""
    world = falling_world(0.7, 5.0)
    world.hidden = lambda time: 14 < time < 24
    world.run(VipFollowAnalytics(), 28)
    hidden = [command for command in world.commands[round(17.5 * 5) : 24 * 5] if command]
    assert len(hidden) > 20
    assert max(abs(command.yaw_rate) for command in hidden) < 0.05
    assert [alert.kind for alert in world.alerts] == ["target_lost"]


def test_who_gets_up_a_step_away_and_walks_on_is_followed_at_once() -> None:
    """Near where they fell, whatever has become of their track.

    The drone hesitates for a frame, as somebody who stops and starts may turn round.
    """
    world = falling_world(0.7, 5.0)
    world.rises = 20.0
    fell = world.target
    world.target = lambda time: (fell(time)[0] + (time > world.rises) * max(0.8, time - 20), 0.0)
    world.hidden = lambda time: 20.0 < time < 20.7
    distances = world.run(VipFollowAnalytics(), 30)
    assert max(distances[20 * 5 :]) < 4.3
    assert distances[-1] == pytest.approx(2.0, abs=0.5)
    assert world.alerts == []
