"""Position of an object moving along a path, as a pure function of time."""

from __future__ import annotations

import bisect
import itertools
import math
import random
from dataclasses import dataclass

from aerodaas.simulation.scenario import Motion

__all__ = ["Track", "TrackPoint"]

_CORNER_PIECES = 6
_SPEED_PERIOD = 17.0
"""Period of the speed's oscillation, seconds."""

_MOMENT = 1e-3
"""Accuracy of the beginning of a pause, seconds."""

_LOOK = 0.15
"""Distance in metres before and after a position over which its direction is computed."""


@dataclass(frozen=True, slots=True)
class TrackPoint:
    """State of motion on a track."""

    x: float
    y: float
    yaw: float
    """Radians counter-clockwise from east."""
    travelled: float
    """Distance from the start, metres."""
    speed: float
    """Speed, m/s."""
    present: bool
    """False once an object that vanishes at the end has disappeared."""


class Track:
    """A `Motion` with rounded corners and with a speed oscillation drawn from `seed`."""

    def __init__(self, motion: Motion, seed: str) -> None:
        """Compute the path."""
        self._motion = motion
        draw = random.Random(seed)
        self._phase = draw.uniform(0.0, math.tau)
        points = _displaced(motion, draw)
        if motion.end == "loop":
            points = [*points, points[0]]
        self._points = _rounded(points, motion.corner, closed=motion.end == "loop")
        self._lengths = [0.0]
        for here, there in itertools.pairwise(self._points):
            self._lengths.append(self._lengths[-1] + math.dist(here, there))
        ordered = sorted(motion.pauses, key=lambda pause: pause.at)
        self._pauses = [(self._time_to(pause.at), pause.seconds) for pause in ordered]

    @property
    def length(self) -> float:
        """Length from the first to the last point, metres."""
        return self._lengths[-1]

    def at(self, time: float) -> TrackPoint:
        """State at `time` seconds of mission time."""
        motion = self._motion
        moving, rests = self._moving(time)
        travelled, speed = self._travelled(moving), 0.0
        if not rests:
            turn = math.tau / _SPEED_PERIOD
            speed = motion.speed * (1.0 + motion.variation * math.cos(turn * moving + self._phase))
        ended = motion.end != "loop" and travelled >= self.length
        if ended:
            travelled, speed = self.length, 0.0
        x, y = self._place(travelled)
        before, after = self._place(travelled - _LOOK), self._place(travelled + _LOOK)
        yaw = math.atan2(after[1] - before[1], after[0] - before[0])
        return TrackPoint(x, y, yaw, travelled, speed, not (ended and motion.end == "vanish"))

    def _moving(self, time: float) -> tuple[float, bool]:
        """Seconds spent in motion until `time`, and whether it pauses then."""
        moving = time - self._motion.start
        if moving <= 0.0:
            return 0.0, True
        for reached, rest in self._pauses:
            if moving <= reached:
                break
            if moving <= reached + rest:
                return reached, True
            moving -= rest
        return moving, False

    def _travelled(self, moving: float) -> float:
        """Distance in metres after `moving` seconds in motion."""
        motion, turn = self._motion, math.tau / _SPEED_PERIOD
        swing = math.sin(turn * moving + self._phase) - math.sin(self._phase)
        return motion.speed * (moving + motion.variation * swing / turn)

    def _time_to(self, metres: float) -> float:
        """Seconds in motion until `metres` are travelled, by bisection."""
        low, high = 0.0, metres / self._motion.speed + _SPEED_PERIOD
        while high - low > _MOMENT:
            middle = (low + high) / 2
            low, high = (middle, high) if self._travelled(middle) < metres else (low, middle)
        return high

    def _place(self, travelled: float) -> tuple[float, float]:
        if self._motion.end == "loop":
            travelled %= self.length
        index = bisect.bisect_right(self._lengths, travelled) - 1
        index = min(max(index, 0), len(self._points) - 2)
        (x0, y0), (x1, y1) = self._points[index], self._points[index + 1]
        piece = self._lengths[index + 1] - self._lengths[index]
        # Points may be so close that their distance is lost by rounding in the total length.
        share = min(max((travelled - self._lengths[index]) / piece, 0.0), 1.0) if piece else 0.0
        return x0 + share * (x1 - x0), y0 + share * (y1 - y0)


def _displaced(motion: Motion, draw: random.Random) -> list[tuple[float, float]]:
    """Displace each point except the first at random, within the jitter."""
    reach = motion.jitter
    moved = [
        (x + draw.uniform(-reach, reach), y + draw.uniform(-reach, reach))
        for x, y in motion.points[1:]
    ]
    return [motion.points[0], *moved]


def _rounded(
    points: list[tuple[float, float]], corner: float, *, closed: bool
) -> list[tuple[float, float]]:
    """Replace each corner by a quadratic Bezier curve that starts `corner` metres before it."""
    if corner <= 0.0:
        return list(points)
    count = len(points)
    inner = range(count - 1) if closed else range(1, count - 1)
    result = [] if closed else [points[0]]
    for index in inner:
        here = points[index]
        before = points[index - 1] if index > 0 else points[count - 2]
        start = _towards(here, before, corner)
        end = _towards(here, points[index + 1], corner)
        for piece in range(_CORNER_PIECES + 1):
            t = piece / _CORNER_PIECES
            a, b, c = (1 - t) ** 2, 2 * t * (1 - t), t * t
            place = (
                a * start[0] + b * here[0] + c * end[0],
                a * start[1] + b * here[1] + c * end[1],
            )
            if not result or math.dist(result[-1], place) > 0.0:
                result.append(place)
    last = result[0] if closed else points[-1]
    if math.dist(result[-1], last) > 0.0:
        result.append(last)
    return result


def _towards(
    here: tuple[float, float], there: tuple[float, float], metres: float
) -> tuple[float, float]:
    """Point at most `metres` from `here` towards `there`, never past the middle."""
    share = min(metres / math.dist(here, there), 0.5)
    return here[0] + share * (there[0] - here[0]), here[1] + share * (there[1] - here[1])
