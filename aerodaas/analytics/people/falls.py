"""Fall detection by the height of a body's top above the ground that it stands on.

A box says more surely than joints how tall a body appears: one that has fallen hides its own
joints, but still ends at its feet and begins at its highest part. Heights are computed from the
drone's odometry at capture, so that a drone that climbs, brakes or turns does not cause an
apparent fall.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from statistics import median

import numpy as np
from numpy.typing import NDArray

from aerodaas.analytics.people.lying import feet_below
from aerodaas.clock import seconds
from aerodaas.following.ground_point import GroundView
from aerodaas.geometry.frames import body_to_enu, enu_to_body
from aerodaas.messages.detections import Detection, Detections

__all__ = ["FallDetector"]

_STANDS = (1.3, 2.3)
"""Least and greatest height of a standing body's top, metres."""

_LOW = 1.1
"""Greatest apparent height in metres of a body that has fallen: it appears tallest if it lies
lengthwise before the camera, as its far end is above its near end in the image."""

_SEEN, _GONE = (0.5, 1.3), (0.2, 1.0)
"""Least drop of a falling body's top in metres, and its greatest speed on the way in m/s: sitting
down or bending is slower than 1.3 m/s (Bourke, O'Donovan and O'Laighin, Medical Engineering &
Physics 30, 2008). Less suffices for a person who is out of the image in the next frame."""

_FLAT = 0.48
"""Share of the standing height below which a body lies, however slowly it sank, or between however
few frames: who sits on the ground is 0.52 of it tall (Drillis and Contini, 1966)."""

_SPAN = (0.15, 1.0)
"""Seconds between two compared observations; shorter spans would measure the noise of boxes."""

_CHEST = 1.2
"""Height in metres of the part of a standing body that must be within the image."""

_CUT = 0.03
"""Distance of a box from an edge, in heights or widths of the image, within which it is cut off."""

_SLENDER = 1.5
"""Widths in its height from which what is left of a body beside an edge is upright. A body that
falls past the edge is wider."""

_FASTEST = 2.5
"""Greatest speed in m/s at which a person whose feet are below the image may come nearer: who
walks up to a camera above their head sinks in the image, too."""

_NEAREST = 0.3
"""Metres from the camera nearer than which nobody stands."""

_NARROWEST = 0.25
"""Least width in metres of a person, from the side: who is near is wide in the image."""

_LOWEST = 0.5
"""Least height of the camera in metres: the error of a box's lower edge is a share of the body, and
the distance of the feet is wrong by that error divided by this height."""

_MOMENT, _FORGOTTEN = 1.5, 3.0
"""Seconds after standing within which a fall must begin, and after the last observation until which
a fall is remembered."""

_REACH, _LONGEST = 1.5, 2.5
"""Metres from the standing position within which a standing person is the same, and a body lies."""

_TALLER = 0.1
"""Error in metres of a standing body's height."""

_KEPT = 12
"""Number of observations kept."""

_GROWN = 5.0
"""Seconds of standing of which the median top is a body's height: who waves is no taller."""

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class _Look:
    stamp: int
    top: float
    """Height of the body's top above its feet, metres."""


class FallDetector:
    """Fall detector for one person, taller than 1.3 m, from standing to lying.

    The ground is flat and the camera 0.5 to about 2 m above it: from higher up a body that lies
    lengthwise before the camera appears as tall as one that stands.
    """

    def __init__(self, min_confidence: float) -> None:
        """Treat keypoints below `min_confidence` (0 to 1) as missing."""
        self.last: Detection | None = None
        """Last detection of the person."""
        self._least = min_confidence
        self._places: deque[Array] = deque(maxlen=_KEPT // 2)
        """Recent standing positions, metres east, north and up of home."""
        self._looks: deque[_Look] = deque(maxlen=_KEPT)
        self._tops: deque[_Look] = deque()
        """The standing body's recent tops, raised hands included."""
        self._stature = 0.0
        """Height of the body that stands, metres."""
        self._stood = 0
        self._fell = False

    def shows(self, person: Detection | None, seen: Detections) -> bool:
        """Process a frame of people.

        Args:
            person: The person, one of `seen`; None if not detected.
            seen: People in the frame.

        Returns:
            Whether the person has fallen; always False for a camera of unknown calibration, and of
            unknown height or nearer to the ground than 0.5 m.
        """
        view = _view_of(seen)
        if view is None:
            return False
        stamp = seen.header.stamp
        self._forget_by(stamp)
        if person is not None and self._stands(person, seen, view):
            self._fell = False
            return False
        if not self._places:
            return False
        feet = self._feet(seen)
        there = [one for one in seen if _is_there(one, seen, feet, view)]
        if any(_hides_top(one, seen) for one in there):
            return False
        if not there:
            self._fell = self._fell or self._sinks(*_GONE)
            return self._fell and view.sees(np.array([*feet, _CHEST]))
        # A falling body changes too much for a tracker, so the nearest body is accepted as well.
        body = max(there, key=lambda one: (one is person, one.area))
        top = self._top(body, feet, seen, view)
        self._update(body, stamp, top)
        self._fell = self._fell or self._sinks(*_SEEN) or top <= _FLAT * self._stature
        return self._fell and top <= _LOW

    def _stands(self, body: Detection, seen: Detections, view: GroundView) -> bool:
        """Store the standing position; False if not standing, or if it is another person."""
        feet = self._standing_at(body, seen, view)
        if feet is None or seen.odometry is None:
            return False
        top = view.height_above(feet, _crown(body))
        if not _STANDS[0] <= top <= _STANDS[1]:
            return False
        place = body_to_enu(np.array([*feet, 0.0]), seen.odometry.yaw) + seen.odometry.position
        if self._places and np.hypot(*(place - self._places[-1])[:2]) > _REACH:
            return False
        if _hides_top(body, seen) and self._looks:
            top = max(top, self._looks[-1].top)
        self._stood = seen.header.stamp
        self._places.append(place)
        self._measure(self._stood, top)
        self._update(body, self._stood, min(top, self._stature + _TALLER))
        return True

    def _measure(self, stamp: int, top: float) -> None:
        """Tell the body's height by one more top of it."""
        tops = self._tops
        tops.append(_Look(stamp, top))
        while seconds(stamp - tops[0].stamp) > _GROWN:
            tops.popleft()
        self._stature = median(look.top for look in tops)

    def _standing_at(self, body: Detection, seen: Detections, view: GroundView) -> Array | None:
        """Where a body stands, metres forward and left, if it does; None if that is unknown."""
        if not _is_cut(body, seen):
            ends = _end_of(body, view)
            return ends if np.isfinite(ends).all() else None
        if body.keypoints is None:
            return None
        return feet_below(body.keypoints, view, self._least)

    def _feet(self, seen: Detections) -> Array:
        """Median standing position, metres in the level body frame (forward, left)."""
        return _from_drone(np.median(self._places, axis=0), seen)

    def _top(self, body: Detection, feet: Array, seen: Detections, view: GroundView) -> float:
        """Height of a body's top that stands, or fell, at `feet`."""
        crown = _crown(body)
        if not _is_cut(body, seen):
            return view.height_above(_end_of(body, view), crown)
        top = view.height_above(feet, crown)
        if not self._fell:
            # Not the median, which lags behind who walks.
            last = _from_drone(self._places[-1], seen)
            away = max(_NEAREST, np.hypot(*last))
            walked = _FASTEST * seconds(seen.header.stamp - self._stood)
            nearest = last * max(_nearest(body, seen), away - walked) / away
            if view.height_above(nearest, crown) >= self._stature - _TALLER:
                return max(top, self._stature)
        return top

    def _update(self, body: Detection, stamp: int, top: float) -> None:
        self._looks.append(_Look(stamp, top))
        self.last = body

    def _sinks(self, least: float, speed: float) -> bool:
        """Whether the body sank by `least` metres up to now, at `speed` m/s on the way."""
        now, *earlier = reversed(self._recent())
        later, fastest = [now], 0.0
        for look in earlier:
            for after in later:
                span = seconds(after.stamp - look.stamp)
                if span >= _SPAN[0]:
                    fastest = max(fastest, (look.top - after.top) / span)
            if look.top - now.top >= least and fastest >= speed:
                return True
            later.append(look)
        return False

    def _recent(self) -> list[_Look]:
        """The observations of the last second, which are compared."""
        newest = self._looks[-1].stamp
        return [look for look in self._looks if seconds(newest - look.stamp) <= _SPAN[1]]

    def _forget_by(self, stamp: int) -> None:
        """Reset if the last observation is too old at `stamp`, or if time ran backwards."""
        known = self._looks[-1].stamp if self._fell else self._stood
        if not 0 <= seconds(stamp - known) <= (_FORGOTTEN if self._fell else _MOMENT):
            self._places.clear()
            self._looks.clear()
            self._tops.clear()
            self._fell = False


def _view_of(seen: Detections) -> GroundView | None:
    try:
        view = GroundView(seen)
    except ValueError:
        return None
    return view if view.height >= _LOWEST else None


def _from_drone(place: Array, seen: Detections) -> Array:
    """A place, metres in the level body frame (forward, left)."""
    assert seen.odometry is not None  # noqa: S101 - a view has one
    return enu_to_body(place - seen.odometry.position, seen.odometry.yaw)[:2]


def _crown(body: Detection) -> Array:
    """Pixel at the middle of the box's upper edge."""
    left, top, right, _ = body.box
    return np.array([(left + right) / 2, top])


def _end_of(body: Detection, view: GroundView) -> Array:
    """Ground point at the middle of the box's lower edge; NaN above the horizon."""
    left, _, right, bottom = body.box
    (point,) = view.points(np.array([[(left + right) / 2, bottom]]))
    return np.asarray(point)


def _nearest(body: Detection, seen: Detections) -> float:
    """Metres from the camera nearer than which this body cannot stand, as wide as it appears."""
    left, _, right, _ = body.box
    assert seen.camera is not None  # noqa: S101 - a view has one
    return max(_NEAREST, _NARROWEST * seen.camera.fx / max(right - left, 1.0))


def _is_there(body: Detection, seen: Detections, feet: Array, view: GroundView) -> bool:
    """Whether a body is at the person's standing position, rather than a false detection.

    One cut off by the lower edge is at most as far away as the ground there.
    """
    ends = _end_of(body, view)
    if _is_cut(body, seen):
        return not np.hypot(*feet) > np.hypot(*ends) + _LONGEST
    return bool(np.hypot(*(ends - feet)) <= _LONGEST)


def _is_cut(body: Detection, seen: Detections) -> bool:
    """Whether the image's lower edge cuts the body."""
    return body.box[3] >= (1 - _CUT) * seen.height


def _hides_top(body: Detection, seen: Detections) -> bool:
    """Whether the image cuts off the body's top, so that it is unknown.

    The upper edge does; and a side does, of a body that is slender: an arm and a leg remain.
    """
    left, top, right, bottom = body.box
    if top <= _CUT * seen.height:
        return True
    edge = _CUT * seen.width
    beside = left <= edge or right >= seen.width - edge
    return beside and bottom - top > _SLENDER * (right - left)
