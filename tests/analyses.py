"""Analyses that the tests of the actors send into flight."""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import ClassVar

from aerodaas import (
    AeroNavigation,
    Analytics,
    Frame,
    NavigableAnalytics,
    NavigationType,
    Odometry,
    VelocityCommand,
    Waypoint,
)
from aerodaas.analytics.base import Context
from aerodaas.messages.readings import Readings

__all__ = [
    "Above",
    "Broken",
    "FrameNumbers",
    "Jitter",
    "ProcessId",
    "Ticker",
    "Unwritten",
    "Weave",
    "Wish",
]


def dawdle() -> None:
    """Take a different time on each call, as a busy host does."""
    time.sleep(os.urandom(1)[0] / 255 * 0.004)


class Weave(NavigableAnalytics):
    """Steers by where the drone is: any difference in its input grows in its output."""

    accepts: ClassVar[tuple[type, ...]] = (Odometry,)

    def process(self, item: Odometry, context: Context) -> AeroNavigation:
        """Fly a curve, for as long as the drone is within 8 metres."""
        dawdle()
        state = context.vehicle()
        climb = 0.1 * (2.0 - item.height) + (0.01 * state.battery.fraction if state else 0.0)
        command = VelocityCommand(1.0, 0.2 * float(item.velocity[1]), climb, 0.4)
        near = float(item.position[0]) < 8.0
        return AeroNavigation(NavigationType.ANALYTICS_DRIVEN, [command] if near else [])


class FrameNumbers(Analytics[Readings]):
    """Says which frame it was given; under an analytics scheduler, where there is one."""

    scheduled = True
    produces: ClassVar[type] = Readings

    def process(self, item: Frame, context: Context) -> Readings:
        """The frame's number, and its stamp."""
        assert item.image.any()
        dawdle()
        return Readings(context.now(), {"number": item.header.id, "stamp": item.header.stamp})


class Jitter(Analytics[float]):
    """Passes the height on, after a while that differs from call to call."""

    accepts: ClassVar[tuple[type, ...]] = (Odometry,)
    produces: ClassVar[type] = float

    def process(self, item: Odometry, context: Context) -> float:  # noqa: ARG002
        """Return the height in metres."""
        dawdle()
        return item.height


class Above(Analytics[float]):
    """Says how high the drone is, once it is higher than asked."""

    accepts: ClassVar[tuple[type, ...]] = (Odometry,)
    produces: ClassVar[type] = float

    def __init__(self, height: float, name: str = "above") -> None:
        """Stay silent below `height` metres."""
        self.name = name
        self._height = height

    def process(self, item: Odometry, context: Context) -> float | None:  # noqa: ARG002
        """Return the height in metres, or None."""
        dawdle()
        return item.height if item.height > self._height else None


class Unwritten(Analytics[float]):
    """Writes what it has found when it is closed, and cannot."""

    def close(self) -> None:
        """Fail."""
        raise OSError("the disk is full")

    def process(self, item: Odometry, context: Context) -> None:
        """Find nothing."""


class Broken(Analytics[float]):
    """Raises for every item."""

    accepts: ClassVar[tuple[type, ...]] = (Odometry, Frame)
    produces: ClassVar[type] = float

    def process(self, item: object, context: Context) -> float:  # noqa: ARG002
        """Raise."""
        raise ZeroDivisionError("a bug of the user's own")


class ProcessId(Analytics[int]):
    """Says in which process it runs; takes long to restart, as a neural network does."""

    accepts: ClassVar[tuple[type, ...]] = (Odometry,)
    produces: ClassVar[type] = int
    isolated = True

    def __init__(self, marker: str) -> None:
        """`marker` is a file that tells that it was opened before."""
        self._marker = marker

    def open(self) -> None:
        """Be slow the second time."""
        marker = Path(self._marker)
        if marker.exists():
            time.sleep(6.5)
        marker.touch()

    def process(self, item: Odometry, context: Context) -> int:  # noqa: ARG002
        """Return the process id."""
        return os.getpid()


class Ticker(Analytics[int]):
    """An external source: counts its calls."""

    produces: ClassVar[type] = int
    rate = 4.0

    def open(self) -> None:
        """Begin at zero."""
        self._count = 0

    def process(self, item: None, context: Context) -> int:  # noqa: ARG002
        """Count on."""
        dawdle()
        self._count += 1
        return self._count


class Wish(NavigableAnalytics):
    """An external source of navigation: asks for one waypoint, once."""

    rate = 2.0

    def process(self, item: None, context: Context) -> AeroNavigation | None:  # noqa: ARG002
        """Ask for the waypoint `wish` at the third call."""
        self._calls = getattr(self, "_calls", 0) + 1
        if self._calls != 3:
            return None
        wish = Waypoint("wish", 3.0, -2.0, 2.0)
        return AeroNavigation(NavigationType.ANALYTICS_DRIVEN, [wish])
