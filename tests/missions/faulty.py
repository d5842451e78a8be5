"""Plug-ins that fail in flight, each in its own way."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

from aerodaas import (
    AeroNavigation,
    Frame,
    NavigableAnalytics,
    NavigationType,
    Odometry,
    TrajectoryScheduler,
    VelocityCommand,
    Waypoint,
)
from aerodaas.analytics.base import Context
from aerodaas.clock import seconds
from aerodaas.schedulers.trajectory.base import PlanningContext

__all__ = ["DyingScheduler", "Forward", "HangingScheduler", "Mortal", "RaisingScheduler", "Stuck"]

_EVER = 1000.0


class Stuck(NavigableAnalytics):
    """Steers well, until it gets stuck for ever."""

    accepts: ClassVar[tuple[type, ...]] = (Odometry,)
    isolated = True

    def process(self, item: Odometry, context: Context) -> AeroNavigation:  # noqa: ARG002
        """Fly forward; hang from second 8 of the mission."""
        if seconds(context.now()) > 8.0:
            time.sleep(_EVER)
        command = VelocityCommand(forward=1.0)
        return AeroNavigation(NavigationType.ANALYTICS_DRIVEN, [command])


class Mortal(NavigableAnalytics):
    """Steers well, but its process dies once."""

    accepts: ClassVar[tuple[type, ...]] = (Odometry,)
    isolated = True

    def __init__(self, marker: Path) -> None:
        """Remember the death in the file `marker`."""
        self._marker = marker

    def process(self, item: Odometry, context: Context) -> AeroNavigation:  # noqa: ARG002
        """Fly forward and die at second 8; restarted, fly on for 5 s, then say no more."""
        if not self._marker.exists() and seconds(context.now()) > 8.0:
            self._marker.write_text(str(context.now()))
            os._exit(1)
        if self._marker.exists():
            self._again = getattr(self, "_again", context.now())
            if seconds(context.now() - self._again) > 5.0:
                return AeroNavigation(NavigationType.ANALYTICS_DRIVEN)
        command = VelocityCommand(forward=1.0)
        return AeroNavigation(NavigationType.ANALYTICS_DRIVEN, [command])


class Forward(NavigableAnalytics):
    """Steers forward for as long as pictures come."""

    accepts: ClassVar[tuple[type, ...]] = (Frame,)

    def process(self, item: Frame, context: Context) -> AeroNavigation:  # noqa: ARG002
        """Fly on."""
        command = VelocityCommand(forward=0.5)
        return AeroNavigation(NavigationType.ANALYTICS_DRIVEN, [command])


class RaisingScheduler(TrajectoryScheduler):
    """Raises."""

    def plan(self, pending: Sequence[Waypoint], situation: PlanningContext) -> Sequence[Waypoint]:  # noqa: ARG002
        """Fail."""
        raise ZeroDivisionError("a bug of the user's own")


class HangingScheduler(TrajectoryScheduler):
    """Never answers, and holds the interpreter."""

    def plan(self, pending: Sequence[Waypoint], situation: PlanningContext) -> Sequence[Waypoint]:
        """Wait in vain."""
        while True:
            sorted(pending, key=lambda waypoint: (waypoint.x - situation.now) ** 2)


class DyingScheduler(TrajectoryScheduler):
    """Takes its process with it."""

    def plan(self, pending: Sequence[Waypoint], situation: PlanningContext) -> Sequence[Waypoint]:  # noqa: ARG002
        """Die."""
        os._exit(1)
