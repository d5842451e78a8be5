"""Finds the gains of a follower by flying: a random search that narrows, on walks by seed.

Every candidate flies the same walks in the same gusts, so that costs compare; what is found is
judged on walks that the search has not seen, and kept only if it is better there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerodaas.analytics.follow.followers import VipFollowAnalytics
from aerodaas.errors import ConfigError
from aerodaas.following.follow_settings import FollowGains
from tools.tuning.chase import TELLO, Chase, ChaseResult
from tools.tuning.perception import TruthPerception
from tools.tuning.walk import PERSON, walk

__all__ = ["FollowTask", "Tuned", "cost", "tune_follow"]

_SETTLED = 12.0
"""Seconds of take-off and first steps that don't count."""
_WIDEST, _NARROWEST = 0.4, 0.1
"""Standard deviations of the steps at the beginning and the end, in natural logarithms."""
_UNSEEN_SEEDS = 1000
"""Added to the seed for the walks that judge."""


@dataclass(frozen=True)
class FollowTask:
    """What is flown to try gains; lengths in metres, times in seconds, speeds in m/s.

    Raises ConfigError for numbers that cannot be.
    """

    distance: float = 2.0
    height: float = 1.5
    rate: float = 10.0
    latency: float = 0.15
    speeds: tuple[float, ...] = (0.4, 1.0)
    duration: float = 40.0
    seed: int = 0

    def __post_init__(self) -> None:
        """Check the numbers."""
        for name in ("distance", "height", "rate", "duration"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise ConfigError(f"{name} must be above 0, not {getattr(self, name)}")
        if not 0.0 <= self.latency < 1.0:
            raise ConfigError(f"latency must lie between 0 and 1 s, not {self.latency}")
        if self.duration <= _SETTLED:
            raise ConfigError(f"a walk must last longer than {_SETTLED:g} s, not {self.duration}")
        if not self.speeds or not all(0.0 < speed <= 2.0 for speed in self.speeds):  # noqa: PLR2004 - m/s
            raise ConfigError(f"speeds of a walk lie above 0 and up to 2 m/s, not {self.speeds}")

    def fly(self, gains: FollowGains, *, unseen: bool = False) -> list[ChaseResult]:
        """Fly all walks with `gains`; with `unseen`, those that judge."""
        flown = []
        seed = self.seed + (_UNSEEN_SEEDS if unseen else 0)
        for speed in self.speeds:
            world = walk(speed, self.duration, seed)
            person = world.thing(PERSON)
            follow = VipFollowAnalytics(distance=self.distance, height=self.height, gains=gains)
            eyes = TruthPerception(person, "vest", TELLO, seed=seed)
            chase = Chase(person, rate=self.rate, latency=self.latency, seed=seed)
            flown.append(chase.fly(follow, eyes, self.duration).after(_SETTLED))
        return flown

    def cost(self, flown: Sequence[ChaseResult]) -> float:
        """Mean cost of the walks."""
        return float(np.mean([cost(one, self.distance, self.height) for one in flown]))


@dataclass(frozen=True)
class Tuned:
    """What a search found; the flights are those that judge."""

    before: FollowGains
    after: FollowGains
    flown_before: list[ChaseResult]
    flown_after: list[ChaseResult]
    cost_before: float
    cost_after: float

    @property
    def better(self) -> bool:
        """Whether anything better than the gains before was found."""
        return self.after != self.before


def cost(flown: ChaseResult, distance: float, height: float) -> float:
    """Errors in units of the aims (0.3 m, 0.1 m), time out of view, and restlessness."""
    off = math.sqrt(float(np.mean((flown.distance - distance) ** 2))) / 0.3
    high = math.sqrt(float(np.mean((flown.height - height) ** 2))) / 0.1
    lost = 1.0 - float(flown.in_view.mean())
    step = np.diff(flown.time).mean()
    push = np.diff(flown.place, n=2, axis=0) / step**2
    restless = math.sqrt(float(np.mean(np.sum(push**2, axis=1))))
    return off + 0.5 * high + 10.0 * lost + 0.2 * restless


def tune_follow(
    task: FollowTask,
    *,
    trials: int = 24,
    start: FollowGains | None = None,
    progress: Callable[[int, float], None] = lambda *_: None,
) -> Tuned:
    """Try `trials` gains around the best so far, from `start` on; repeatable by the task's seed.

    `progress` is told how many have flown and the least cost. Raises ConfigError for no trials.
    """
    if trials < 1:
        raise ConfigError(f"trials must be 1 or more, not {trials}")
    random = np.random.default_rng(task.seed)
    before = best = start or FollowGains()
    least = task.cost(task.fly(best))
    for number in range(trials):
        share = number / max(1, trials - 1)
        spread = _WIDEST * (_NARROWEST / _WIDEST) ** share
        candidate = _near(best, random.normal(0, spread, 7))
        found = task.cost(task.fly(candidate))
        if found < least:
            best, least = candidate, found
        progress(number + 1, least)
    flown_before = task.fly(before, unseen=True)
    flown_after = task.fly(best, unseen=True) if best != before else flown_before
    judged_before, judged_after = task.cost(flown_before), task.cost(flown_after)
    if judged_after >= judged_before:
        best, flown_after, judged_after = before, flown_before, judged_before
    return Tuned(before, best, flown_before, flown_after, judged_before, judged_after)


def _near(gains: FollowGains, steps: NDArray[np.float64]) -> FollowGains:
    """Scale each gain by a step; a derivative of zero moves off zero."""
    p, i, d, yaw_p, yaw_i, yaw_d, height = np.exp(steps).tolist()
    aside, yaw_aside = (0.05 * abs(float(steps[index])) for index in (2, 5))
    return FollowGains(
        distance=_rounded(
            gains.distance[0] * p, gains.distance[1] * i, gains.distance[2] * d + aside
        ),
        yaw=_rounded(gains.yaw[0] * yaw_p, gains.yaw[1] * yaw_i, gains.yaw[2] * yaw_d + yaw_aside),
        height=round(gains.height * height, 3),
    )


def _rounded(p: float, i: float, d: float) -> tuple[float, float, float]:
    return round(p, 3), round(i, 3), round(d, 3)
