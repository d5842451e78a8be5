"""The newest that a drone's topics told, checked."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from typing import Any

from aerodaas.clock import NANOSECONDS, host_time_ns
from aerodaas.errors import AeroDaaSError
from aerodaas.extensions.ros2.driver.frames import Alignment
from aerodaas.extensions.ros2.topics.incoming import battery_of, fix_of, odometry_of, stamp_of
from aerodaas.extensions.ros2.topics.stamps import MessageClock, StampSource
from aerodaas.messages.odometry import Battery, GpsFix, Odometry

__all__ = ["RosFeed"]

_TOLD = 2.0
"""Seconds for which a refused message is reported."""
_FIX_VALID = 3.0
"""Seconds for which a fix counts."""
_BATTERY_VALID = 30.0
"""Seconds for which a battery's charge counts."""


class RosFeed:
    """Odometry, battery and fix of one drone; any thread may ask.

    Times are seconds of `clock`, which only tests replace.
    """

    def __init__(
        self,
        stamps: StampSource,
        align: Callable[[Odometry], Alignment],
        clock: Callable[[], int] = host_time_ns,
    ) -> None:
        """Take times by `stamps`; `align` is asked once, with the first odometry."""
        self._clock = clock
        self._lock = threading.Lock()
        self._message_clock = MessageClock(stamps)
        self._align = align
        self._odometry: Odometry | None = None
        self._measured = -math.inf
        self._battery, self._battery_at = Battery(math.nan), -math.inf
        self._fix: GpsFix | None = None
        self._fix_at = -math.inf
        self._refusal, self._refused_at = "", -math.inf
        self.alignment = Alignment()
        self.frames = "", ""
        """Frames of the newest odometry: `frame_id` and `child_frame_id`."""
        self.refused = 0
        """Messages refused so far."""
        self.outdated = 0
        """Messages that were no newer than one before."""

    def take_odometry(self, message: Any) -> None:  # noqa: ANN401 - of a type made at import
        """Take a `nav_msgs/Odometry`."""
        arrival = self._clock()
        try:
            odometry = odometry_of(message)
        except (ValueError, AeroDaaSError) as error:
            self._refuse(f"odometry refused: {error}")
            return
        with self._lock:
            age = self._message_clock.age(stamp_of(message), arrival)
            if age is None:
                self.outdated += 1
                return
            if self._odometry is None:
                self.alignment = self._align(odometry)
            self.frames = message.header.frame_id, message.child_frame_id
            self._odometry = self.alignment.apply(odometry)
            self._measured = (arrival - age) / NANOSECONDS

    def take_battery(self, message: Any) -> None:  # noqa: ANN401
        """Take a `sensor_msgs/BatteryState`."""
        with self._lock:
            self._battery, self._battery_at = battery_of(message), self.now()

    def take_fix(self, message: Any) -> None:  # noqa: ANN401
        """Take a `sensor_msgs/NavSatFix`."""
        try:
            fix = fix_of(message)
        except ValueError as error:
            self._refuse(f"fix refused: {error}")
            return
        with self._lock:
            self._fix, self._fix_at = fix, self.now()

    def now(self) -> float:
        """Present time, seconds."""
        return self._clock() / NANOSECONDS

    @property
    def odometry(self) -> Odometry | None:
        """The newest, in home's ENU; None before the first."""
        return self._odometry

    @property
    def age(self) -> float:
        """Seconds since the newest odometry was measured; infinite before the first."""
        with self._lock:
            return max(0.0, self.now() - self._measured)

    @property
    def battery(self) -> Battery:
        """The newest; of unknown charge, NaN, without one of the last half minute."""
        with self._lock:
            known = self.now() - self._battery_at <= _BATTERY_VALID
            return self._battery if known else Battery(math.nan)

    @property
    def fix(self) -> GpsFix | None:
        """The newest of the last seconds."""
        with self._lock:
            return self._fix if self.now() - self._fix_at <= _FIX_VALID else None

    @property
    def refusal(self) -> str:
        """Why a message was refused lately; empty otherwise."""
        with self._lock:
            return self._refusal if self.now() - self._refused_at <= _TOLD else ""

    def _refuse(self, reason: str) -> None:
        with self._lock:
            self.refused += 1
            self._refusal, self._refused_at = reason, self.now()
