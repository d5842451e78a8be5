"""Whether somebody who stood a moment ago is down, though their feet are below the picture.

Before a narrow lens, one who has fallen near is cut off by the lower edge, or gone. What is still
known is where they stood, and that the top of their body sank faster than anybody bends. Heights
are reckoned above that place, from the drone as it was at capture: a drone that climbs, brakes or
turns makes nobody sink.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerodaas.analytics.people.lying import feet_below
from aerodaas.following.ground import GroundView
from aerodaas.types.clock import seconds
from aerodaas.types.data import Detection, Detections
from aerodaas.types.geometry import body_to_enu, enu_to_body

__all__ = ["Downfall"]

_STANDS = (1.3, 2.3)
"""Metres of the top of a body that stands, at least and at most."""

_HIGHER = 0.2
"""Metres of a camera above their head: higher, who walks below it sinks in the picture, too."""

_SEEN, _GONE = (0.5, 1.3), (0.2, 1.0)
"""Metres, and m/s, by which a body sinks that falls: whoever sits down or bends is slower than
1.3 m/s (Bourke, O'Donovan and O'Laighin, Medical Engineering & Physics 30, 2008). Less is enough
of one who is gone at the next look."""

_SPAN = (0.15, 1.0)
"""Seconds between two looks that are compared; less would measure the noise of boxes."""

_LOW = 1.1
"""Metres above where they stood, at which the top of one who lies farther away seems to be."""

_CHEST = 1.2
"""Metres up of what would be seen of one who still stood there."""

_CUT = 0.03
"""Part of the picture's height within which a box counts as cut by its lower or upper edge."""

_NEAR = 3.5
"""Metres within which a fall is told; farther away all of the body is seen, and its posture."""

_MOMENT, _FORGOTTEN = 1.5, 3.0
"""Seconds after standing within which a fall begins, and for which one who is gone is missed."""

_REACH, _LONGEST = 1.5, 2.5
"""Metres from there, within which who stands is the same person, and a body lies."""

_KEPT = 12
"""Looks."""

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class _Look:
    stamp: int
    top: float
    """Metres of the body's top above where it stood."""


class Downfall:
    """Follows one person, who must be taller than 1.3 m to count, from standing to lying."""

    def __init__(self, min_confidence: float) -> None:
        """Keypoints of less than `min_confidence` (0 to 1) count as missing."""
        self.last: Detection | None = None
        """The person as last seen."""
        self._least = min_confidence
        self._places: deque[Array] = deque(maxlen=_KEPT // 2)
        """East, north and up of home where the person stood of late."""
        self._looks: deque[_Look] = deque(maxlen=_KEPT)
        self._stood = 0
        self._fell = False

    def shows(self, person: Detection | None, seen: Detections, *, upright: bool) -> bool:
        """Take in a frame of people; tell whether it shows the person down.

        `person` is None if not found; `upright` is what their gestures say. Always False from a
        camera of unknown height or calibration.
        """
        try:
            view = GroundView(seen)
        except ValueError:
            return False
        self._forget_by(seen.header.stamp)
        if person is not None and upright and self._stands(person, seen, view):
            self._fell = False
            return False
        if not self._places:
            return False
        feet = self._feet(seen)
        there = [one for one in seen if _is_there(one, seen, feet, view)]
        if np.hypot(*feet) > _NEAR or any(_is_headless(one, seen) for one in there):
            return False
        if not there:
            self._fell = self._fell or self._sinks(*_GONE)
            return self._fell and view.sees(np.array([*feet, _CHEST]))
        # A body that falls changes too much for a tracker: the nearest is the person, too.
        body = max(there, key=lambda one: (one is person, one.area))
        top = view.height_above(feet, _crown(body))
        self._look(body, seen.header.stamp, top)
        self._fell = self._fell or self._sinks(*_SEEN)
        return self._fell and top <= _LOW

    def _stands(self, body: Detection, seen: Detections, view: GroundView) -> bool:
        """Remember where they stand; False for who does not, or is somebody else."""
        if body.keypoints is None or seen.odometry is None:
            return False
        feet = feet_below(body.keypoints, view, self._least)
        if feet is None:
            return False
        top, least = view.height_above(feet, _crown(body)), max(_STANDS[0], view.height - _HIGHER)
        if not least <= top <= _STANDS[1]:
            return False
        place = body_to_enu(np.array([*feet, 0.0]), seen.odometry.yaw) + seen.odometry.position
        if self._places and np.hypot(*(place - self._places[-1])[:2]) > _REACH:
            return False
        if _is_headless(body, seen) and self._looks:
            top = max(top, self._looks[-1].top)
        self._stood = seen.header.stamp
        self._places.append(place)
        self._look(body, self._stood, top)
        return True

    def _feet(self, seen: Detections) -> Array:
        """Where they stood, metres in the level body frame (forward, left)."""
        assert seen.odometry is not None  # noqa: S101 - a view has one
        way = np.median(self._places, axis=0) - seen.odometry.position
        return enu_to_body(way, seen.odometry.yaw)[:2]

    def _look(self, body: Detection, stamp: int, top: float) -> None:
        self._looks.append(_Look(stamp, top))
        self.last = body

    def _sinks(self, least: float, speed: float) -> bool:
        """Whether they were sinking by `least` metres at `speed` m/s when last seen."""
        *earlier, now = self._looks
        for look in earlier:
            span, drop = seconds(now.stamp - look.stamp), look.top - now.top
            if _SPAN[0] <= span <= _SPAN[1] and drop >= max(least, speed * span):
                return True
        return False

    def _forget_by(self, stamp: int) -> None:
        """Begin anew where what is known is too old at `stamp`, or the clock ran back."""
        known = self._looks[-1].stamp if self._fell else self._stood
        if not 0 <= seconds(stamp - known) <= (_FORGOTTEN if self._fell else _MOMENT):
            self._places.clear()
            self._looks.clear()
            self._fell = False


def _crown(body: Detection) -> Array:
    """Pixel in the middle of the box's upper edge."""
    left, top, right, _ = body.box
    return np.array([(left + right) / 2, top])


def _is_there(body: Detection, seen: Detections, feet: Array, view: GroundView) -> bool:
    """Whether it is where they stood, and no other thing that is taken for somebody."""
    left, _, right, bottom = body.box
    (lowest,) = view.points(np.array([[(left + right) / 2, bottom]]))
    cut = bottom >= (1 - _CUT) * seen.height
    return cut or bool(np.hypot(*(lowest - feet)) <= _LONGEST)


def _is_headless(body: Detection, seen: Detections) -> bool:
    """Whether the picture's upper edge cuts it, so that its top is not known."""
    return body.box[1] <= _CUT * seen.height
