"""The profile that a scheduler gets of each analysis: the user's figures, or measured ones."""

from __future__ import annotations

from dataclasses import replace

from aerodaas.actors.dispatch.costs import ExecutionEstimates
from aerodaas.schedulers.analytics.base import MILLISECOND, Profile
from aerodaas.types.clock import NANOSECONDS

__all__ = ["Estimates"]

_WORTH_TELLING = 0.05
"""Relative difference between the given and the measured time that is reported."""


class Estimates:
    """Profiles with measured times where the user gave none."""

    def __init__(self, speed: float, learnt: frozenset[str]) -> None:
        """Mission time runs at `speed`; the scheduler learns the times named in `learnt` itself.

        A time that both would correct would be corrected twice.
        """
        self.edge = ExecutionEstimates()
        self._second = speed * NANOSECONDS
        self._learnt = learnt
        self._told: dict[str, Profile] = {}

    def profile(
        self,
        told: Profile,
        open_times: frozenset[str],
        cloud: float | None,
        link: float = 0.0,
    ) -> Profile:
        """The profile for a new task of an analysis.

        `told` is what the environment file says, `open_times` which of its times are to be
        measured, `cloud` the host seconds that the cloud is expected to take, if known, `link`
        those that a frame sent now spends on its way alone: no time told can be less than that.
        """
        profile = self._told.setdefault(told.model, told)
        wanted = open_times - self._learnt
        edge = self._time(self.edge.seconds(told.model) if "edge_time" in wanted else None)
        there = self._time(cloud if "cloud_time" in wanted else None)
        if there is None and "cloud_time" not in self._learnt and "cloud_time" not in open_times:
            there = max(told.cloud_time, round(link * self._second))
        news = replace(
            profile,
            edge_time=edge or profile.edge_time,
            cloud_time=there or profile.cloud_time,
        )
        times = ((profile.edge_time, news.edge_time), (profile.cloud_time, news.cloud_time))
        if any(abs(new - old) > _WORTH_TELLING * old for old, new in times):
            profile = self._told[told.model] = news
        return profile

    def _time(self, seconds: float | None) -> int | None:
        """Mission time that so many host seconds take."""
        return None if seconds is None else max(MILLISECOND, round(seconds * self._second))
