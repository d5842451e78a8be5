"""Criteria: each a property that a flight must have, measured from its recording."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import shapely

from aerodaas.recording.report.flight import Band
from aerodaas.simulation.collision import BODY, Obstacles
from missions.evidence import Evidence

__all__ = [
    "Check",
    "Criterion",
    "alerted_of",
    "climbed",
    "distance_held",
    "fence_kept",
    "followed",
    "found_between",
    "hit_nothing",
    "landed",
    "landed_upon",
    "reached",
    "states",
]

PLANNING = 0.5
"""Seconds for which a drone may hover until it knows where to fly next."""


@dataclass(frozen=True, slots=True)
class Check:
    """What a criterion found."""

    what: str
    holds: bool
    found: str


Criterion: TypeAlias = Callable[[Evidence], Check]


def states(pattern: str) -> Criterion:
    """The mission's states, in their order, match a regular expression in its verbose form.

    In real time a plan is made beside the setpoint loop; what the drone waits for it, less than
    `PLANNING` seconds, is left out.
    """

    def check(evidence: Evidence) -> Check:
        bands = [band for band in evidence.robot.bands if not _is_planning(band)]
        found = " ".join(band.state for band in bands) + " "
        words = re.sub(r"([a-z_]+)", r"(?:\1[ ])", pattern)
        return Check(f"states: {pattern}", bool(re.fullmatch(words, found, re.VERBOSE)), found)

    return check


def _is_planning(band: Band) -> bool:
    return band.reason == "waiting for a plan" and band.end - band.start < PLANNING


def reached(*ids: str, never: tuple[str, ...] = (), within: float = 0.5) -> Criterion:
    """These waypoints, and none of `never`, were visited, the drone truly `within` metres."""

    def check(evidence: Evidence) -> Check:
        robot = evidence.robot
        gaps = {
            name: float(np.linalg.norm(evidence.position - robot.plan[name], axis=1).min())
            for name in ids
            if name in robot.plan
        }
        holds = (
            set(ids) <= set(robot.visited)
            and not set(never) & set(robot.visited)
            and all(gap <= within for gap in gaps.values())
        )
        text = ", ".join(f"{name} {gap:.2f} m" for name, gap in gaps.items())
        what = f"reached within {within:g} m: {', '.join(ids)}"
        what += f"; never: {', '.join(never)}" if never else ""
        return Check(what, holds, f"visited {', '.join(robot.visited)}; nearest {text}")

    return check


def distance_held(
    thing: str,
    metres: float,
    *,
    within: float,
    share: float,
    nearest: float,
    settled: float = 10.0,
    moments: tuple[str, ...] = ("following", "diverted"),
) -> Criterion:
    """While following, `share` of the time `within` of `metres`, and never nearer than `nearest`.

    The first `settled` seconds, in which the drone comes up, count for `nearest` alone.
    """

    def check(evidence: Evidence) -> Check:
        away = evidence.to_thing(thing)
        following = evidence.during(*moments)
        steady = evidence.during(*moments, settled=settled)
        what = (
            f"{metres:g} ± {within:g} m from {thing} in {share:.0%} of the following, "
            f"never below {nearest:g} m"
        )
        if not steady.any():
            return Check(what, holds=False, found="it followed nobody")
        kept = float((np.abs(away[steady] - metres) <= within).mean())
        least = float(away[following].min())
        found = f"{kept:.1%}, median {np.median(away[steady]):.2f} m, nearest {least:.2f} m"
        return Check(what, kept >= share and least >= nearest, found)

    return check


def followed(thing: str, metres: float, *, reach: float) -> Criterion:
    """While following within `reach` metres of it, the thing covered at least `metres`."""

    def check(evidence: Evidence) -> Check:
        close = evidence.during("following", "diverted") & (evidence.to_thing(thing) <= reach)
        track = evidence.world.thing(thing)
        places = np.array([(state.x, state.y) for state in map(track.state, evidence.time[close])])
        covered = float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum()) if len(places) else 0
        return Check(
            f"followed {thing} for at least {metres:g} m", covered >= metres, f"{covered:.1f} m"
        )

    return check


def found_between(earlier: str, later: str, state: str = "following") -> Criterion:
    """The first `state` began after `earlier` was visited and before `later` was."""

    def check(evidence: Evidence) -> Check:
        bands = evidence.bands(state)
        what = f"{state} between {earlier} and {later}"
        if not bands:
            return Check(what, holds=False, found="it never came to that")
        began = bands[0].start
        flying = [band for band in evidence.bands("enroute", "loitering") if band.start < began]
        names = [band.reason.rpartition(" ")[2] for band in flying]
        holds = earlier in names and later == names[-1]
        return Check(what, holds, f"at {began:.1f} s, on the way to {names[-1] if names else '-'}")

    return check


def alerted_of(thing: str, kind: str, word: str, within: float) -> Criterion:
    """After the gesture `kind` of a person, an alert with `word` came `within` seconds."""

    def check(evidence: Evidence) -> Check:
        begun = evidence.gesture(thing, kind).start
        told = [
            time for time, name, text in evidence.flight.alerts if word in f"{name} {text}".lower()
        ]
        late = [time - begun for time in told if 0 <= time - begun <= within]
        early = [time for time in told if time < begun]
        found = f"{kind} at {begun:.1f} s, alerts at {[round(time, 1) for time in told]}"
        return Check(f"alert within {within:g} s of {kind}", bool(late) and not early, found)

    return check


def landed_upon(thing: str, kind: str, within: float) -> Criterion:
    """The landing began after the gesture `kind` of a person, `within` seconds."""

    def check(evidence: Evidence) -> Check:
        begun = evidence.gesture(thing, kind).start
        landing = [band.start for band in evidence.bands("landing")]
        found = f"{kind} at {begun:.1f} s, landing from {[round(at, 1) for at in landing]}"
        holds = len(landing) == 1 and 0 <= landing[0] - begun <= within
        return Check(f"landing within {within:g} s of {kind}", holds, found)

    return check


def climbed(thing: str, base: float, top: float, clearance: float) -> Criterion:
    """Beside the thing it went from below `base` to above `top` metres, clear of its middle."""

    def check(evidence: Evidence) -> Check:
        during = evidence.during("following")
        what = f"climbed along {thing} from below {base:g} m to {top:g} m"
        if not during.any():
            return Check(what, holds=False, found="it never inspected")
        heights = evidence.position[during, 2]
        peak = int(heights.argmax())
        low, high = float(heights[: peak + 1].min()), float(heights[peak])
        nearest = float(evidence.to_thing(thing)[during].min())
        found = f"{low:.1f} m to {high:.1f} m, {nearest:.1f} m from its middle"
        return Check(what, low <= base and high >= top and nearest >= clearance, found)

    return check


def landed(*, at_home: float | None = None, speed: float = 1.0) -> Criterion:
    """It stands at the end, came down slower than `speed` m/s, at home within `at_home` metres."""

    def check(evidence: Evidence) -> Check:
        final = evidence.states[-1] if evidence.states else "nothing"
        low = evidence.during("landing") & (evidence.position[:, 2] < 1.0)
        fastest = float(-evidence.velocity[low, 2].min()) if low.any() else 0.0
        height = float(evidence.position[-1, 2])
        away = float(np.linalg.norm(evidence.position[-1, :2] - evidence.config.start[:2]))
        near = at_home is None or away <= at_home
        holds = final == "landed" and height < BODY and fastest <= speed and near
        where = f", within {at_home:g} m of home" if at_home is not None else ""
        found = f"{final}, {height:.2f} m up, {away:.2f} m from home, last metre at {fastest:.2f}"
        return Check(f"landed below {speed:g} m/s{where}", holds, f"{found} m/s")

    return check


def hit_nothing(evidence: Evidence) -> Check:
    """Nothing of the world came within the drone's own size while it flew."""
    touched: dict[str, float] = {}
    obstacles = Obstacles(evidence.world)
    pairs = zip(evidence.time[evidence.airborne], evidence.position[evidence.airborne], strict=True)
    for time, place in list(pairs)[::2]:
        x, y, z = (float(axis) for axis in place)
        near = obstacles.within((x, y, z), float(time), BODY)
        if near is not None:
            touched.setdefault(near.thing, float(time))
    found = ", ".join(f"{name} at {time:.1f} s" for name, time in touched.items()) or "nothing"
    return Check("hit nothing", not touched, found)


def fence_kept(evidence: Evidence) -> Check:
    """The true position never left the geofence."""
    fence = evidence.config.limits.geofence
    flown = evidence.position[evidence.airborne]
    outside = flown[:, 2] > fence.ceiling
    worst = float(np.clip(flown[:, 2] - fence.ceiling, 0, None).max()) if len(flown) else 0.0
    if fence.polygon:
        area, places = shapely.Polygon(fence.polygon), shapely.points(flown[:, :2])
        outside |= ~shapely.contains(area, places)
        worst = max(worst, float(shapely.distance(area, places).max(initial=0.0)))
    count = int(outside.sum())
    return Check("kept the fence", count == 0, f"{count} of {len(flown)} moments, {worst:.2f} m")
