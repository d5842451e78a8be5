"""Criteria of the agents' tasks: places, headings, stays, rings and coverage, by true positions.

The first word of a check's sentence is its name. Places are metres east, north and up of home;
headings are degrees counter-clockwise from east.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import shapely
from missions.criteria import Check, Criterion, fence_kept, hit_nothing, landed
from missions.evidence import Evidence
from numpy.typing import NDArray

__all__ = [
    "ALWAYS",
    "Gap",
    "Leg",
    "Place",
    "arrivals",
    "at",
    "between",
    "coverage",
    "encircled",
    "hexagon",
    "inspected",
    "look",
    "none_given_up",
    "nose",
    "nose_at",
    "outline",
    "outside",
    "returned",
    "short_way",
    "stays",
]

Place: TypeAlias = tuple[float, float, float]
Floats: TypeAlias = NDArray[np.float64]
Mask: TypeAlias = NDArray[np.bool_]

LEVEL, HEIGHT = 0.5, 0.3
"""Metres within which the drone is at a place."""
STILL = 0.4
"""Speed in m/s below which it stays, in gusts."""
SHARE = 0.9
"""Of a leg's samples for its heading, or of a line that is inspected."""
MOST = 0.95
"""Of an area or an outline."""


@dataclass(frozen=True, slots=True)
class Leg:
    """Straight way from one place to the next, with the heading asked on it."""

    start: Place
    end: Place
    heading: float
    """Degrees counter-clockwise from east."""


def _near(evidence: Evidence, place: Place, level: float = LEVEL, height: float = HEIGHT) -> Mask:
    away = evidence.position - np.array(place)
    inside = np.hypot(away[:, 0], away[:, 1]) <= level
    return np.asarray(inside & (np.abs(away[:, 2]) <= height))


def _arrivals(evidence: Evidence, places: Sequence[Place]) -> list[int]:
    """Sample of each arrival, in order; shorter where a place was not reached after the others."""
    found: list[int] = []
    for place in places:
        after = np.flatnonzero(_near(evidence, place)[found[-1] if found else 0 :])
        if not len(after):
            break
        found.append(int(after[0]) + (found[-1] if found else 0))
    return found


def _off(yaw: Floats, heading: Floats | float) -> Floats:
    """Degrees between a yaw in radians and a heading in degrees."""
    return np.asarray(np.abs((np.degrees(yaw) - heading + 180.0) % 360.0 - 180.0))


def _spans(mask: Mask) -> Iterator[tuple[int, int]]:
    """First and last sample of each unbroken stretch."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        yield int(begin), int(end) - 1


def at(*places: Place) -> Criterion:
    """The drone was at each place, in this order."""

    def check(evidence: Evidence) -> Check:
        count = len(_arrivals(evidence, places))
        missed = "" if count == len(places) else f", then never at {places[count]}"
        return Check(
            f"at {len(places)} places in order",
            count == len(places),
            f"{count} of {len(places)}{missed}",
        )

    return check


def nose(*legs: Leg, within: float = 10.0) -> Criterion:
    """On each leg the nose was within degrees of its heading, for `SHARE` of the leg's samples."""

    def check(evidence: Evidence) -> Check:
        places = [legs[0].start, *(leg.end for leg in legs)]
        reached = _arrivals(evidence, places)
        what = f"nose within {within:g}° on {len(legs)} legs"
        if len(reached) < len(places):
            return Check(what, holds=False, found=f"only {len(reached)} of its places were reached")
        kept = []
        for leg, (before, arrived) in zip(legs, itertools.pairwise(reached), strict=True):
            left = before + int(np.flatnonzero(_near(evidence, leg.start)[before:arrived])[-1])
            off = _off(evidence.yaw[left + 1 : arrived + 1], leg.heading)
            kept.append(float((off <= within).mean()) if len(off) else 1.0)
        worst = min(kept)
        text = f"{worst:.0%} of leg {kept.index(worst) + 1}, the worst"
        return Check(what, worst >= SHARE, text)

    return check


def look(place: Place, *headings: float, seconds: float = 1.0, within: float = 10.0) -> Criterion:
    """At a place the nose stayed at each heading in turn, for `seconds` each."""

    def check(evidence: Evidence) -> Check:
        begin, seen = 0, 0
        for heading in headings:
            looking = _near(evidence, place) & (_off(evidence.yaw, heading) <= within)
            looking[:begin] = False
            long = [
                end
                for start, end in _spans(looking)
                if evidence.time[end] - evidence.time[start] >= seconds
            ]
            if not long:
                break
            begin, seen = long[0], seen + 1
        what = f"look at {', '.join(f'{heading:g}°' for heading in headings)} from {place}"
        return Check(what, seen == len(headings), f"{seen} of {len(headings)} in turn")

    return check


def stays(
    *places: Place, seconds: tuple[float, float], level: float = LEVEL, height: float = HEIGHT
) -> Criterion:
    """The drone stood at each place in order.

    Args:
        places: Where it stood.
        seconds: Least and greatest time of each stay.
        level: Metres along the ground that count as there.
        height: Metres of height that count as there.
    """

    def check(evidence: Evidence) -> Check:
        still = np.linalg.norm(evidence.velocity, axis=1) <= STILL
        begin, found = 0, []
        for place in places:
            there = _near(evidence, place, level, height)
            there[:begin] = False
            spans = [
                (evidence.time[end] - evidence.time[start], end)
                for start, end in _spans(there & still)
            ]
            duration, last = max(spans, default=(0.0, begin))
            begin = last
            found.append(float(duration))
        least, most = seconds
        what = f"stays of {least:g} to {most:g} s at {len(places)} places"
        text = ", ".join(f"{duration:.1f} s" for duration in found)
        return Check(what, all(least <= duration <= most for duration in found), text)

    return check


def arrivals(*limits: tuple[Place, float, float]) -> Criterion:
    """The drone was at each place, in any order: (place, seconds of stay, latest mission second).

    The stay is over by that second.
    """

    def check(evidence: Evidence) -> Check:
        still = np.linalg.norm(evidence.velocity, axis=1) <= STILL
        texts, holds = [], True
        for place, stay, latest in limits:
            there = _near(evidence, place) & (still | (stay == 0.0))
            done = [
                float(evidence.time[start] + stay)
                for start, end in _spans(there)
                if evidence.time[end] - evidence.time[start] >= stay
            ]
            holds = holds and bool(done) and min(done) <= latest
            texts.append(f"{place[:2]} at {min(done):.1f} s" if done else f"never {place[:2]}")
        return Check(f"arrivals at {len(limits)} places in time", holds, ", ".join(texts))

    return check


@dataclass(frozen=True, slots=True)
class Gap:
    """Distance kept while going round something."""

    centre: tuple[float, float]
    least: float
    """Metres."""
    most: float
    thing: str | None = None
    """Object of the world whose nearest point counts; None: the centre."""

    def distance(self, evidence: Evidence) -> Floats:
        """Level metres at all times, shape (N,)."""
        if self.thing is not None:
            return evidence.to_thing(self.thing)
        return np.asarray(np.linalg.norm(evidence.position[:, :2] - self.centre, axis=1))


def encircled(gap: Gap, height: float, degrees: float = 350.0) -> Criterion:
    """The drone went round a centre, within its gap and 0.5 m of a height.

    Args:
        gap: Distance that it kept.
        height: Metres above home.
        degrees: Directions from the centre in which it was seen.
    """

    def check(evidence: Evidence) -> Check:
        away = gap.distance(evidence)
        way = evidence.position[:, :2] - gap.centre
        ring = (away >= gap.least) & (away <= gap.most)
        ring &= np.abs(evidence.position[:, 2] - height) <= LEVEL
        bearing = np.degrees(np.arctan2(way[:, 1], way[:, 0]))
        seen = len(np.unique(np.floor(bearing[ring])))
        what = f"round {gap.centre} at {gap.least:g} to {gap.most:g} m for {degrees:g}°"
        return Check(what, seen >= degrees, f"{seen}° covered")

    return check


def hexagon(centre: tuple[float, float], radius: float, height: float) -> Criterion:
    """The drone flew a regular hexagon of any orientation, in either sense."""
    points_needed = 12

    def check(evidence: Evidence) -> Check:
        level = np.abs(evidence.position[:, 2] - height) <= HEIGHT
        way = np.asarray(shapely.points(evidence.position[level, :2]))
        best = 0
        for turn in range(60):
            angles = np.radians(turn + 60.0 * np.arange(6))
            corners = np.array(centre) + radius * np.stack([np.cos(angles), np.sin(angles)], -1)
            # Between corners a circle is too far out: the sides' middles count as well.
            middles = (corners + np.roll(corners, 1, axis=0)) / 2
            places = np.asarray(shapely.points(np.concatenate([corners, middles])))[:, None]
            near = (shapely.distance(places, way) <= LEVEL).any(axis=1)
            best = max(best, int(near.sum()))
        text = f"{best} of {points_needed} corners and middles met"
        return Check(f"hexagon of {radius:g} m round {centre}", best == points_needed, text)

    return check


def outline(points: Sequence[tuple[float, float]], *, within: float) -> Criterion:
    """The drone went along 95 % of a closed outline (east, north), `within` metres of it."""

    def check(evidence: Evidence) -> Check:
        ring = shapely.LinearRing(points)
        way = shapely.MultiPoint(evidence.position[evidence.position[:, 2] > 1.0, :2])
        steps = shapely.line_interpolate_point(ring, np.arange(0.0, ring.length, 0.5))
        covered = float((shapely.distance(steps, way) <= within).mean())
        what = f"outline of {ring.length:g} m within {within:g} m"
        return Check(what, covered >= MOST, f"{covered:.0%} of it")

    return check


def nose_at(
    middle: tuple[float, float], ring: Sequence[tuple[float, float]], *, within: float
) -> Criterion:
    """While it went along a closed outline, the nose was `within` degrees of a place."""

    def check(evidence: Evidence) -> Check:
        away = shapely.distance(shapely.LinearRing(ring), shapely.points(evidence.position[:, :2]))
        moving = np.linalg.norm(evidence.velocity[:, :2], axis=1) > STILL
        going = (away <= 1.0) & moving & evidence.during("enroute", "loitering")
        way = np.array(middle) - evidence.position[going, :2]
        off = _off(evidence.yaw[going], np.degrees(np.arctan2(way[:, 1], way[:, 0])))
        share = float((off <= within).mean()) if len(off) else 0.0
        return Check(f"nose at {middle} within {within:g}°", share >= SHARE, f"{share:.0%}")

    return check


def inspected(
    points: Sequence[tuple[float, float]],
    distance: float,
    height: float,
    *,
    within: float,
    degrees: float,
) -> Criterion:
    """90 % of a line was passed at a distance with the nose at it.

    Args:
        points: The line's corners (east, north).
        distance: Metres from it.
        height: Metres above home.
        within: Metres by which the distance may differ.
        degrees: Degrees by which the nose may be off.
    """

    def check(evidence: Evidence) -> Check:
        line = shapely.LineString(points)
        level = np.abs(evidence.position[:, 2] - height) <= LEVEL
        flown, yaw = evidence.position[level, :2], evidence.yaw[level]
        seen = []
        for metre in np.arange(0.25, line.length, 0.5):
            way = shapely.get_coordinates(line.interpolate(metre))[0] - flown
            near = np.abs(np.linalg.norm(way, axis=1) - distance) <= within
            facing = _off(yaw, np.degrees(np.arctan2(way[:, 1], way[:, 0]))) <= degrees
            seen.append(bool((near & facing).any()))
        share = float(np.mean(seen))
        what = f"inspected {line.length:g} m from {distance:g} m, {height:g} m up"
        return Check(what, share >= SHARE, f"{share:.0%} of it")

    return check


def coverage(area: tuple[float, float, float, float], reach: float) -> Criterion:
    """95 % of an area (west, south, east, north) lay within `reach` metres of the way."""

    def check(evidence: Evidence) -> Check:
        west, south, east, north = area
        steps = np.meshgrid(np.arange(west, east, 0.25), np.arange(south, north, 0.25))
        way = shapely.LineString(evidence.position[evidence.during("enroute", "loitering"), :2])
        share = float((shapely.distance(way, shapely.points(*steps)) <= reach).mean())
        return Check(f"coverage of {area} within {reach:g} m", share >= MOST, f"{share:.1%}")

    return check


def outside(area: Sequence[tuple[float, float]]) -> Criterion:
    """The drone never entered an area (east, north)."""

    def check(evidence: Evidence) -> Check:
        places = shapely.points(evidence.position[:, :2])
        entered = np.asarray(shapely.contains(shapely.Polygon(area), places))
        text = f"{int(entered.sum())} of {len(entered)} samples inside"
        return Check("outside the no-fly area", not entered.any(), text)

    return check


def short_way(places: Sequence[Place], factor: float) -> Criterion:
    """The way flown, home included, is at most `factor` times the best order's."""

    def check(evidence: Evidence) -> Check:
        home = (*evidence.config.start[:2], places[0][2])
        tours = (
            sum(itertools.starmap(math.dist, itertools.pairwise((home, *order, home))))
            for order in itertools.permutations(places)
        )
        best = min(tours) + 2 * (home[2] - evidence.config.start[2])
        text = f"{evidence.distance:.1f} m, the best {best:.1f} m"
        return Check(
            f"way at most {factor:g} of the best", evidence.distance <= factor * best, text
        )

    return check


def returned(charge: float, within: float) -> Criterion:
    """The return began when the charge (0 to 1) fell below a limit, `within` seconds after it."""

    def check(evidence: Evidence) -> Check:
        robot = evidence.robot
        below = np.flatnonzero(robot.battery < charge)
        fell = float(robot.time[below[0]]) if len(below) else math.inf
        began = next((band.start for band in evidence.bands("returning")), math.inf)
        what = f"return within {within:g} s of a charge of {charge:.0%}"
        text = f"charge at {fell:.1f} s, return at {began:.1f} s"
        return Check(what, 0.0 <= began - fell <= within, text)

    return check


def between(places: Sequence[Place], floor: float) -> Criterion:
    """From the first of these places to the last, beyond 1 m from each, it stayed above a height.

    Args:
        places: The places.
        floor: Metres above home.
    """

    def check(evidence: Evidence) -> Check:
        spots = np.array(places)[:, :2]
        away = np.linalg.norm(evidence.position[:, None, :2] - spots, axis=2)
        near = np.flatnonzero((away <= 1.0).any(axis=1))
        far = np.zeros(len(away), np.bool_)
        if len(near):
            far[near[0] : near[-1]] = (away[near[0] : near[-1]] > 1.0).all(axis=1)
        lowest = float(evidence.position[far, 2].min()) if far.any() else math.nan
        return Check(f"between at {floor:g} m or higher", lowest >= floor, f"{lowest:.2f} m")

    return check


def none_given_up(evidence: Evidence) -> Check:
    """No waypoint was given up."""
    given_up = evidence.robot.given_up
    return Check("no waypoint given up", not given_up, ", ".join(given_up) or "none")


ALWAYS: tuple[Criterion, ...] = (hit_nothing, fence_kept, none_given_up, landed(at_home=1.0))
