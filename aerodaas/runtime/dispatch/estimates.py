"""Profiles of the analyses for a scheduler: the user's times, or else measured ones."""

from __future__ import annotations

from dataclasses import replace

from aerodaas.clock import NANOSECONDS
from aerodaas.runtime.dispatch.costs import ExecutionEstimates
from aerodaas.schedulers.analytics.base import MILLISECOND, Profile

__all__ = ["Estimates"]

_WORTH_TELLING = 0.05
"""Relative difference of a measured time from which the profile is updated."""


class Estimates:
    """Profiles whose times follow the measurements if the user gave none."""

    def __init__(self, speed: float, learnt: frozenset[str]) -> None:
        """Create the estimates for mission seconds per wall second `speed`.

        The times named in `learnt` are left to the scheduler, which learns them itself: otherwise
        they would be corrected twice.
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
        """Profile for a new task of an analysis.

        `told` is the environment file's profile, `open_times` are those of its times to be
        measured, `cloud` is the expected time of the cloud in host seconds, if known, and `link`
        that of the transfer alone of a frame sent now: a lower bound of the cloud time.
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
        """Mission nanoseconds of a duration in host seconds; at least a millisecond."""
        return None if seconds is None else max(MILLISECOND, round(seconds * self._second))
