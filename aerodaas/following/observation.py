"""Input of the follow controller for one frame, and what of it can be true."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aerodaas.clock import seconds
from aerodaas.following.relative_target import RelativeTarget
from aerodaas.messages.odometry import Odometry

__all__ = ["Observation"]

_FARTHEST = 1000.0
"""Greatest plausible distance in metres; no camera detects a person farther away."""
_FARTHEST_FROM_HOME = 1e5


@dataclass(frozen=True, slots=True)
class Observation:
    """Input of the controller for one frame: target, and odometry at capture and at present."""

    stamp: int
    """Mission time at capture, nanoseconds."""
    sighting: RelativeTarget | None
    """The target, if detected."""
    at_capture: Odometry | None = None
    now: Odometry | None = None
    now_stamp: int | None = None
    others: tuple[RelativeTarget, ...] = ()
    """Everybody and everything else that the drone must not fly into."""
    people: tuple[RelativeTarget, ...] = ()
    """Everybody who is seen, among them the target if that is a person."""
    surfaces: NDArray[np.float64] | None = None
    """Surfaces at the drone's own height, as returned by `clearance.surfaces`."""

    @property
    def pose(self) -> Odometry | None:
        """The newest odometry."""
        return self.now or self.at_capture

    @property
    def pose_stamp(self) -> int:
        """Mission time of the newest odometry, nanoseconds."""
        return max(self.stamp, self.now_stamp or 0) if self.now else self.stamp

    @property
    def latency(self) -> float:
        """Seconds from the frame's capture to the newest odometry."""
        return seconds(self.pose_stamp - self.stamp)

    def without_nonsense(self) -> Observation:
        """Remove sightings and odometry with implausible numbers, which count as not observed."""
        return replace(
            self,
            sighting=self.sighting if _can_be(self.sighting) else None,
            at_capture=self.at_capture if _is_sane(self.at_capture) else None,
            now=self.now if _is_sane(self.now) else None,
            others=tuple(filter(_can_be, self.others)),
            people=tuple(filter(_can_be, self.people)),
        )


def _can_be(sighting: RelativeTarget | None) -> bool:
    return (
        sighting is not None
        and abs(sighting.bearing) <= math.pi
        and 0.0 <= sighting.distance <= _FARTHEST
    )


def _is_sane(odometry: Odometry | None) -> bool:
    return (
        odometry is not None
        and bool((np.abs(odometry.position) <= _FARTHEST_FROM_HOME).all())
        and math.isfinite(odometry.yaw)
    )
