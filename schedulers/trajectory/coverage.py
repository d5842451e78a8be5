"""Area coverage: a field becomes parallel sweeps of the camera, joined into one way.

The area is cut into strips as wide as the camera's picture on the ground less the overlap
(boustrophedon sweeps: Choset, "Coverage of Known Spaces", Autonomous Robots 9, 2000). Turns cost
time, so the best angle is mostly that with the fewest strips: along the longest edges.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeAlias

import numpy as np
import shapely
from shapely import affinity
from shapely.geometry.base import BaseGeometry

from aerodaas.errors import SchedulerError
from aerodaas.geometry.free_path import FreeArea, Place
from aerodaas.messages.waypoints import Waypoint
from aerodaas.schedulers.trajectory.survey_camera import SurveyCamera

__all__ = ["Coverage", "cover", "footprint"]

_ANGLE_STEP = 15
"""Degrees between the angles tried beside those of the area's edges."""
_SAME = 1e-6
"""Metres within which two places are one."""
_SHORTEST = 0.5
"""Metres between two pictures at least."""
_TURN = 3.0
"""Metres of straight flight that the braking and turning between two strips is worth."""
_THIN = 0.1
"""Share of the strips' width up to which what lies between two of them is not worth a line of its
own."""
_COMPLETIONS = 4
"""How often what a way leaves unseen is added to it; mostly once is enough."""
_Line: TypeAlias = tuple[Place, Place]


@dataclass(frozen=True)
class Coverage:
    """A path that covers an area."""

    waypoints: tuple[Waypoint, ...]
    """Local ENU, in order; with a camera, those at the ends of its lines have a
    `trigger_distance`."""
    angle: float
    """Direction of the sweeps, radians counter-clockwise from east."""
    length: float
    """Metres from the first waypoint to the last."""
    sweeps: int


def footprint(height: float, horizontal_fov: float, aspect: float = 16 / 9) -> tuple[float, float]:
    """Width and depth in metres of the ground that a camera looking straight down sees.

    `height` is in metres, `horizontal_fov` in radians, `aspect` is width over height in pixels.

    Args:
        height: Height above the ground, metres.
        horizontal_fov: Angle of view across, radians.
        aspect: Width over height of the picture, in pixels.
    """
    width = 2.0 * height * math.tan(horizontal_fov / 2.0)
    return width, width / aspect


def cover(
    outline: Sequence[Place],
    *,
    height: float,
    width: float | None = None,
    overlap: float = 0.2,
    camera: SurveyCamera | None = None,
    holes: Iterable[Sequence[Place]] = (),
    no_fly: Iterable[Sequence[Place]] = (),
    clearance: float = 0.0,
    start: Place | None = None,
    angle: float | None = None,
    speed: float | None = None,
) -> Coverage:
    """Plan a path over an area.

    A `camera` looks straight down and takes pictures on the strips, no farther apart than it needs,
    from one end to the other.

    Args:
        outline: Corners of the area, ENU metres.
        height: Height of the path, metres.
        width: Ground that is seen across the sweep, metres; or `camera`.
        overlap: Share of it that neighbouring strips have in common, 0 to less than 1.
        camera: Camera that knows width and overlap.
        holes: Areas that need not be seen but may be flown over, ENU metres.
        no_fly: Zones that are flown around, ENU metres.
        clearance: Distance to keep from them, metres.
        start: Where the drone comes from, ENU metres.
        angle: Direction of the strips, radians counter-clockwise from east; None for the shortest
            way.
        speed: Speed on the strips, m/s; None for the robot's cruise speed.

    Raises:
        SchedulerError: If not exactly one of width and camera is given, the area is none, or no-fly
            zones cut it in pieces that cannot all be reached.
    """
    if (width is None) == (camera is None):
        raise SchedulerError("coverage needs a width or a camera: give it one of them")
    if camera is not None:
        width, overlap = camera.footprint(height)[0], camera.side_overlap
    assert width is not None  # noqa: S101 - given, or the camera's
    if not 0.0 <= overlap < 1.0 or width <= 0.0:
        raise SchedulerError(
            "coverage needs a positive width and an overlap of 0 to less than 1, "
            f"not {width} and {overlap}"
        )
    zones = [_polygon(zone, "no-fly zone") for zone in no_fly]
    forbidden = shapely.union_all(zones).buffer(clearance, join_style="mitre")
    wanted = _polygon(outline, "area").difference(forbidden)
    for hole in holes:
        wanted = wanted.difference(_polygon(hole, "hole"))
    if wanted.is_empty:
        raise SchedulerError("no-fly zones and holes leave nothing of the area to cover")
    flyable = _polygon(outline, "area").difference(forbidden)
    angles = _angles(outline) if angle is None else [angle]
    spacing = width * (1.0 - overlap)
    chosen, strips, way = _shortest(wanted, flyable, angles, spacing, width, start)
    spacings = way.spacings(None if camera is None else camera.trigger_distance(height))
    down = -math.pi / 2 if camera is not None and camera.gimbal else None
    waypoints = tuple(
        Waypoint(
            f"sweep{number}",
            x,
            y,
            height,
            waypoint_type="local",
            speed=speed,
            gimbal_pitch=down,
            trigger_distance=distance,
            zoom=0.0 if camera is not None and camera.zooms else None,
        )
        for number, ((x, y), distance) in enumerate(zip(way.places, spacings, strict=True), start=1)
    )
    return Coverage(waypoints, chosen, _length(way.places), len(strips))


def _shortest(
    wanted: BaseGeometry,
    flyable: BaseGeometry,
    angles: Sequence[float],
    spacing: float,
    width: float,
    start: Place | None,
) -> tuple[float, list[_Line], _Way]:
    """Of these angles, that with the shortest way: itself, its strips, and the way that sees all.

    Raises SchedulerError where not all strips can be reached.
    """
    free = FreeArea(flyable)
    best: tuple[float, float, list[_Line], _Way] | None = None
    for candidate in angles:
        strips = _strips(wanted, candidate, spacing, width)
        way = _join(strips, flyable, free, start)
        if way is None:
            continue
        cost = _length(way.places) + _TURN * len(strips)
        if best is None or cost < best[0] - 1e-9:
            best = cost, candidate, strips, way
    if best is None:
        raise SchedulerError("no-fly zones cut the area in pieces that cannot all be reached")
    _, chosen, strips, way = best
    for _ in range(_COMPLETIONS):
        missed = _missed(wanted, way.places, width)
        more = _join([*strips, *missed], flyable, free, start) if missed else None
        if more is None:
            break
        strips, way = [*strips, *missed], more
    return chosen, strips, way


@dataclass
class _Way:
    """Places to fly to, and on which strip each leg lies that leads to one."""

    places: list[Place]
    strips: list[int | None]
    """None for a leg between two strips."""

    def spacings(self, most: float | None) -> list[float | None]:
        """Metres between pictures on each leg, at most `most`, which divide its strip evenly.

        From the beginning of one shorter than half of that a single picture sees all of it.
        """
        lengths: dict[int, float] = {}
        for (a, b), strip in zip(pairwise(self.places), self.strips[1:], strict=True):
            if strip is not None:
                lengths[strip] = lengths.get(strip, 0.0) + math.dist(a, b)
        return [
            None if most is None or strip is None else _spacing(lengths[strip], most)
            for strip in self.strips
        ]


def _spacing(length: float, most: float) -> float:
    if length < most / 2.0:
        return max(most, _SHORTEST)
    return max(length / max(1, math.ceil(length / most - 1e-9)), _SHORTEST)


def _polygon(outline: Sequence[Place], what: str) -> shapely.Polygon:
    corners = 3
    polygon = shapely.Polygon(outline) if len(outline) >= corners else shapely.Polygon()
    if polygon.is_empty or not polygon.is_valid or polygon.area == 0.0:
        raise SchedulerError(f"the {what} {list(outline)} encloses no area or crosses itself")
    return polygon


def _angles(outline: Sequence[Place]) -> list[float]:
    edges = zip(outline, [*outline[1:], outline[0]], strict=True)
    along = {round(math.atan2(b[1] - a[1], b[0] - a[0]) % math.pi, 6) for a, b in edges}
    spread = {round(math.radians(degrees), 6) for degrees in range(0, 180, _ANGLE_STEP)}
    return sorted(along | spread)


def _strips(wanted: BaseGeometry, angle: float, spacing: float, width: float) -> list[_Line]:
    """Middle lines of the strips, spread evenly over the area's extent across the sweeps.

    Each is drawn out to where the strip, as wide as the camera sees, leaves the area.
    """
    turned = affinity.rotate(wanted, -angle, origin=(0, 0), use_radians=True)
    left, bottom, right, top = turned.bounds
    count = max(1, math.ceil((top - bottom - width) / spacing - 1e-9) + 1)
    spread = np.linspace(bottom + width / 2, top - width / 2, count)
    middles = spread if count > 1 else np.array([(bottom + top) / 2])
    strips: list[_Line] = []
    for middle in middles:
        band = shapely.box(left - 1.0, middle - width / 2, right + 1.0, middle + width / 2)
        seen = turned.intersection(band)
        for part in _merged_extents(seen):
            ends = shapely.LineString([(part[0], middle), (part[1], middle)])
            flown = affinity.rotate(ends, angle, origin=(0, 0), use_radians=True)
            a, b = ((float(x), float(y)) for x, y in flown.coords)
            strips.append((a, b))
    return strips


def _missed(wanted: BaseGeometry, places: Sequence[Place], width: float) -> list[_Line]:
    """Lines over what a drone along `places` does not see, such as corners at slanting ends."""
    if len(places) < 2:  # noqa: PLR2004 - a single place is no way
        return []
    seen = shapely.LineString(places).buffer(width / 2, cap_style="flat")
    thin = _THIN * width / 2
    left = wanted.difference(seen).buffer(-thin).buffer(thin, join_style="mitre")
    lines: list[_Line] = []
    for part in () if left.is_empty else shapely.get_parts(left):
        corners = shapely.get_coordinates(shapely.minimum_rotated_rectangle(part))
        a, b = max(pairwise(corners[:3]), key=lambda side: math.dist(*side))
        lines += _strips(part, math.atan2(b[1] - a[1], b[0] - a[0]), width, width)
    return lines


def _merged_extents(seen: BaseGeometry) -> list[tuple[float, float]]:
    """Extents of the parts of a band along the sweep, joined where they overlap."""
    extents = sorted(
        (part.bounds[0], part.bounds[2])
        for part in shapely.get_parts(seen)
        if part.geom_type == "Polygon"
    )
    merged: list[tuple[float, float]] = []
    for low, high in extents:
        if merged and low <= merged[-1][1]:
            merged[-1] = merged[-1][0], max(high, merged[-1][1])
        else:
            merged.append((low, high))
    return merged


def _join(
    strips: list[_Line],
    flyable: BaseGeometry,
    free: FreeArea,
    start: Place | None,
) -> _Way | None:
    """Fly the strips one after the other, always the one whose end is nearest, around obstacles."""
    left = list(strips)
    way: list[Place] = []
    on: list[int | None] = []
    here = start
    while left:
        origin = here if here is not None else left[0][0]
        _, number, backwards = min(
            (math.dist(origin, strip[side]), number, side)
            for number, strip in enumerate(left)
            for side in (0, 1)
        )
        strip = left.pop(number)
        entry, leave = (strip[1], strip[0]) if backwards else strip
        if way and not _append(way, flyable, free, entry):
            return None
        way = way or [entry]
        on += [None] * (len(way) - len(on))
        if not _append(way, flyable, free, leave):
            return None
        on += [len(left)] * (len(way) - len(on))
        here = way[-1]
    return _Way(way, on)


def _append(way: list[Place], flyable: BaseGeometry, free: FreeArea, target: Place) -> bool:
    """Go on to `target`, or to the flyable place nearest to it; False without a path."""
    if not shapely.covers(flyable, shapely.Point(target)):
        nearest = shapely.shortest_line(flyable, shapely.Point(target))
        x, y = shapely.get_coordinates(nearest)[0]
        target = float(x), float(y)
    if not shapely.covers(flyable, shapely.Point(way[-1])):
        nearest = shapely.shortest_line(flyable, shapely.Point(way[-1]))
        x, y = shapely.get_coordinates(nearest)[0]
        way[-1] = float(x), float(y)
    path = free.path(way[-1], target)
    if path is None:
        return False
    way.extend(place for place in path[1:] if math.dist(place, way[-1]) > _SAME)
    return True


def _length(way: list[Place]) -> float:
    return math.fsum(math.dist(a, b) for a, b in pairwise(way))
