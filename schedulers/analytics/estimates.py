"""Online distributions of execution times, and the chance of finishing within a given time."""

from __future__ import annotations

from dataclasses import dataclass
from math import erf, sqrt

from aerodaas.clock import NANOSECONDS
from aerodaas.schedulers.analytics.base import MILLISECOND, Profile

__all__ = ["TimeEstimate", "TimeEstimates", "chance"]

_PRIOR_VARIATION = 0.05
_PRIOR_WEIGHT = 5
_SLOWEST = 0.02
"""Least weight of a new observation: the estimates never stop following."""
_DRIFT = (15.0 * MILLISECOND) ** 2 / NANOSECONDS
"""Variance that the shared delay gains per nanosecond: 15 ms after one second."""
_LEAST_VARIANCE = MILLISECOND * MILLISECOND
CERTAIN = 4.0
"""Standard deviations from the mean beyond which a chance counts as none or as certainty."""
SQRT_HALF = 0.7071067811865476


@dataclass(slots=True)
class TimeEstimate:
    """One model's execution time in one place: normal, nanoseconds."""

    mean: float
    sigma: float


class TimeEstimates:
    """Per model a normal distribution around the profile's time, plus a delay shared by all.

    A model's own offset and variance are running averages of what was observed. The shared delay
    (the network's share, the same for every model) is a scalar Kalman filter (Kalman, 1960)
    whose state is a random walk, so that the results of every model tell about all of them.
    """

    def __init__(self, *, shared: bool) -> None:
        self.delay = 0.0
        """Shared delay, nanoseconds."""
        self._shared = shared
        self._uncertainty = 0.0
        self._at = 0
        self._models: dict[str, list[float]] = {}
        self._cache: dict[str, TimeEstimate] = {}

    def observe(self, profile: Profile, taken: int, now: int) -> None:
        """Learn from one execution.

        Args:
            profile: Profile of the task executed.
            taken: Time that the execution took, nanoseconds.
            now: Time of its end, nanoseconds.
        """
        model = self._model(profile)
        offset, variance, count = model
        error = taken - self._nominal(profile) - offset - self.delay
        if not self._shared:
            error_left = error
            self._cache.pop(profile.model, None)
        else:
            self._uncertainty += _DRIFT * (now - self._at)
            self._at = now
            gain = self._uncertainty / (self._uncertainty + variance)
            self.delay += gain * error
            self._uncertainty *= 1 - gain
            error_left = error * (1 - gain)
            self._cache.clear()
        weight = max(1 / (count + _PRIOR_WEIGHT + 1), _SLOWEST)
        model[0] += weight * error_left
        model[1] += weight * (error * error - variance)
        model[2] += 1

    def belief(self, profile: Profile) -> TimeEstimate:
        """The present belief about a model's execution time."""
        found = self._cache.get(profile.model)
        if found is None:
            offset, variance, _ = self._model(profile)
            mean = self._nominal(profile) + offset + self.delay
            spread = variance + self._uncertainty + _LEAST_VARIANCE
            found = self._cache[profile.model] = TimeEstimate(mean, sqrt(spread))
        return found

    def _nominal(self, profile: Profile) -> int:
        return profile.cloud_time if self._shared else profile.edge_time

    def _model(self, profile: Profile) -> list[float]:
        found = self._models.get(profile.model)
        if found is None:
            nominal = self._nominal(profile)
            found = self._models[profile.model] = [0.0, (_PRIOR_VARIATION * nominal) ** 2, 0]
        return found


def chance(belief: TimeEstimate, room: float) -> float:
    """Probability that an execution ends within `room`, 0 to 1.

    Args:
        belief: Mean and deviation of its time, nanoseconds.
        room: Time that it may take, nanoseconds.
    """
    z = (room - belief.mean) / belief.sigma
    if z > CERTAIN:
        return 1.0
    if z < -CERTAIN:
        return 0.0
    return 0.5 + 0.5 * erf(z * SQRT_HALF)
