"""Proposed missions: their hash, what an approver is told of them, and when an approval lapses.

Nothing here asks the service or its database; texts of a document are its proposer's, and are
never part of a sentence.
"""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any

import shapely
from pydantic import BaseModel, ConfigDict, Field

from aerodaas.clock import WallOffset
from aerodaas.dataflow.mission_document import (
    AnalysisEntry,
    MissionDocument,
    NavigationDocument,
)
from aerodaas.messages.mission import Place
from aerodaas.messages.waypoints import Waypoint, WaypointType
from aerodaas.protocol.proposals import ApprovalOut, Envelope

__all__ = [
    "APPROVAL_SECONDS",
    "CHARGE_POINTS",
    "VERDICT_SECONDS",
    "Conditions",
    "ProposalRecord",
    "difference",
    "encloses",
    "envelope_violation",
    "lapse_reason",
    "plain_text",
    "proposal_hash",
    "records_of",
    "summary_of",
]

APPROVAL_SECONDS = 600.0
"""For a take-off after its approval: whoever approved has the place before their eyes so long."""
VERDICT_SECONDS = 1800.0
"""For an approval after the rehearsal: time to call a person, in which weather hardly changes."""
CHARGE_POINTS = 0.03
"""Share of a full charge that a drone may lose after its rehearsal: minutes of standing ready."""
_WIND_MARGIN = 1.0
"""m/s by which the wind may exceed what was rehearsed: an anemometer's error."""
_ROUNDING = 1e-9
_MOST_TOLD = 12
"""Most sentences about changes of one robot."""


class _Record(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Conditions(_Record):
    """What a rehearsal is good for: charge, wind and limits, at one moment."""

    at: float
    """Unix seconds."""
    offset: WallOffset
    """Of the wall clock by which `at` and the approval's moment are meant."""
    battery: dict[str, float] = Field(default_factory=dict)
    """Charge by robot, 0 to 1."""
    wind: float = 0.0
    """m/s: the larger of the environment's with its gusts, and of the newest reported."""
    limits: dict[str, Any] = Field(default_factory=dict)
    """The flight's limits by robot, and the wind of the environment."""


class ProposalRecord(_Record):
    """What the database keeps of a proposal, beside its document and its verdict."""

    conditions: Conditions
    """Of its newest rehearsal; before the first, of the moment when it was proposed."""
    parent: str | None = None
    change_of: str | None = None
    why: str = ""
    difference: list[str] = Field(default_factory=list)
    seeds: int = 1
    """Flights of its newest rehearsal."""
    approval: ApprovalOut | None = None
    """None also for one that has lapsed."""


def proposal_hash(
    document: MissionDocument,
    record: ProposalRecord,
    minutes: float,
    verdict: Mapping[str, Any] | None,
) -> str:
    """SHA-256, hexadecimal, of all that an approval is bound to.

    Args:
        document: The mission document.
        record: Its conditions, with the limits and the moment of the rehearsal.
        minutes: Of the lease, which has the whole fence for its area.
        verdict: The rehearsal's; None before it.
    """
    content = {
        "document": document.model_dump(mode="json"),
        "conditions": record.conditions.model_dump(mode="json"),
        "lease": {"minutes": minutes, "area": None},
        "verdict": verdict,
        "change_of": record.change_of,
    }
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()


def lapse_reason(rehearsed: Conditions, present: Conditions, spare: float = CHARGE_POINTS) -> str:
    """Why a rehearsal says nothing of a flight any more; empty if it still does.

    Args:
        rehearsed: Conditions of the rehearsal.
        present: Conditions now; without limits where these were not looked at.
        spare: Share of a full charge that each robot may have lost since.
    """
    for robot, charge in rehearsed.battery.items():
        now = present.battery.get(robot, charge)
        if charge - now > spare + _ROUNDING:
            return f"{robot} holds {now:.0%}, and was rehearsed with {charge:.0%}"
    if present.wind > rehearsed.wind + _WIND_MARGIN:
        return f"the wind is {present.wind:.1f} m/s, and was rehearsed up to {rehearsed.wind:.1f}"
    if present.limits and present.limits != rehearsed.limits:
        names = rehearsed.limits.keys() | present.limits.keys()
        changed = [
            name for name in sorted(names) if rehearsed.limits.get(name) != present.limits.get(name)
        ]
        return f"limits have changed since: {', '.join(changed)}"
    return ""


def encloses(area: Sequence[tuple[float, float]]) -> bool:
    """Whether corners in this order enclose an area."""
    polygon = shapely.Polygon(area)
    return polygon.is_valid and polygon.area > 0.0


def envelope_violation(envelope: Envelope, places: Sequence[Place], minutes: float) -> str:
    """What of a way lies outside an envelope; empty if nothing does.

    Args:
        envelope: Bounds that were approved.
        places: Where the robot is and its waypoints, which it flies to on straight legs.
        minutes: From its take-off to its landing.
    """
    way = shapely.LineString([(east, north) for east, north, _ in places])
    if not shapely.Polygon(envelope.area).covers(way):
        return "a leg leaves the approved area"
    heights = [up for _, _, up in places]
    if min(heights) < envelope.floor:
        return f"it flies {min(heights):.1f} m high, and {envelope.floor:g} m are the least"
    if max(heights) > envelope.ceiling:
        return f"it flies {max(heights):.1f} m high, and {envelope.ceiling:g} m are the most"
    if not minutes <= envelope.minutes:
        return f"it lands after {minutes:.1f} min, and {envelope.minutes:g} min were approved"
    return ""


def plain_text(text: str) -> str:
    """A stranger's text on one line, whose controls and formats are replaced."""
    return "".join(one if one.isprintable() else " " for one in text).strip()


_OF_PEOPLE = frozenset(
    {
        "BodyPoseEmergencyAnalytics",
        "CrowdDensityAnalytics",
        "PersonFollowAnalytics",
        "PoseAnalytics",
        "VipDetectionAnalytics",
        "VipFollowAnalytics",
    }
)
"""Analyses that look for people, whatever their settings."""


def records_of(document: MissionDocument, cameras: Collection[str]) -> list[str]:
    """What a mission records of its surroundings and of people, a sentence each.

    Args:
        document: The mission document.
        cameras: Full ids of the fleet's cameras.
    """
    told = [f"The camera {name} runs." for name in document.sensors if name in cameras]
    seen = set(cameras)
    for entry in document.analyses:
        if not seen.intersection(entry.reads):
            continue
        seen.add(entry.id)
        if entry.analysis in _OF_PEOPLE:
            told.append(f"{entry.analysis} looks for people in the pictures.")
        else:
            told.append(f"{entry.analysis} reads the pictures, and may find people.")
    return list(dict.fromkeys(told))


_HEIGHTS = {
    WaypointType.RELATIVE: "above its take-off",
    WaypointType.LOCAL: "above home",
    WaypointType.GLOBAL: "above the ellipsoid",
    WaypointType.GLOBAL_RELATIVE: "above home",
}


def summary_of(document: MissionDocument, minutes: float) -> list[str]:
    """What would fly, in sentences made from the document.

    Args:
        document: The mission document.
        minutes: Of the lease.
    """
    analyses = {entry.id: entry for entry in document.analyses}
    told = [
        line for entry in document.navigation for line in _navigation_sentences(entry, analyses)
    ]
    for name, entry in analyses.items():
        commands = sorted({one.command for one in entry.triggers if one.command is not None})
        if commands:
            words = ", ".join(one.replace("_", " ") for one in commands)
            told.append(f"Results of {_named(name, analyses)} may give the command: {words}.")
    if document.sensors:
        told.append(f"Sensors that run: {', '.join(document.sensors)}.")
    told.append(f"The drones are leased for {minutes:g} min.")
    return told


def _navigation_sentences(
    entry: NavigationDocument, analyses: Mapping[str, AnalysisEntry]
) -> Iterator[str]:
    robot = entry.robot
    if entry.stream is not None:
        yield f"{robot} is steered by {_named(entry.stream, analyses)}."
    if not entry.waypoints:
        return
    order = "in this order" if entry.ordered else "in an order that the scheduler chooses"
    heights = "; ".join(_height_ranges(entry.waypoints))
    count = len(entry.waypoints)
    noun = "waypoint" if count == 1 else "waypoints"
    yield f"{robot} flies to {count} {noun} {order}: {heights}."
    waiting = sum(waypoint.hover_duration for waypoint in entry.waypoints)
    if waiting:
        yield f"{robot} waits for {waiting:g} s at waypoints, all together."
    speeds = [waypoint.speed for waypoint in entry.waypoints if waypoint.speed is not None]
    if speeds:
        yield f"{robot} flies up to {max(speeds):g} m/s where the document says so."
    purposes = Counter(one.purpose for waypoint in entry.waypoints for one in waypoint.actions)
    for purpose, times in purposes.items():
        yield f"{robot} {purpose} ({times} times)."


def _height_ranges(waypoints: Sequence[Waypoint]) -> Iterator[str]:
    """Heights of waypoints, by what they are counted from."""
    by_reference: dict[str, list[float]] = {}
    for waypoint in waypoints:
        above = waypoint.above
        reference = _HEIGHTS[WaypointType(waypoint.waypoint_type)]
        if above is not None:
            reference = f"above {getattr(above, 'value', above)}"
        by_reference.setdefault(reference, []).append(waypoint.z)
    for reference, heights in by_reference.items():
        low, high = min(heights), max(heights)
        extent = f"{low:g} m" if low == high else f"{low:g} to {high:g} m"
        yield f"{extent} {reference}"


def _named(stream: str, analyses: Mapping[str, AnalysisEntry]) -> str:
    """An analysis by its registered name: its id is the proposer's own text."""
    entry = analyses.get(stream)
    return "a sensor" if entry is None else str(entry.analysis)


def difference(before: MissionDocument, after: MissionDocument) -> list[str]:
    """What differs between two documents, a sentence each; empty if they fly the same.

    Args:
        before: The earlier one.
        after: The later one.
    """
    old, new = _navigations(before), _navigations(after)
    told = [f"{robot} does not fly any more." for robot in old if robot not in new]
    for robot, entries in new.items():
        if robot not in old:
            told.append(f"{robot} flies, too.")
        else:
            told += _changes(robot, old[robot], entries)
    told += _set_changes("Sensor", before.sensors, after.sensors)
    told += _set_changes(
        "Analysis",
        [str(one.analysis) for one in before.analyses],
        [str(one.analysis) for one in after.analyses],
    )
    if Counter(one.analysis for one in before.analyses) == Counter(
        one.analysis for one in after.analyses
    ):
        told += [
            f"{later.analysis}: its settings, inputs or triggers differ."
            for earlier, later in zip(before.analyses, after.analyses, strict=True)
            if earlier != later
        ]
    if before.trajectory_scheduler != after.trajectory_scheduler:
        told.append("The trajectory scheduler differs.")
    if before.analytics_scheduler != after.analytics_scheduler:
        told.append("The analytics scheduler differs.")
    return told


def _navigations(document: MissionDocument) -> dict[str, list[NavigationDocument]]:
    found: dict[str, list[NavigationDocument]] = {}
    for entry in document.navigation:
        found.setdefault(entry.robot, []).append(entry)
    return found


def _changes(
    robot: str, before: Sequence[NavigationDocument], after: Sequence[NavigationDocument]
) -> list[str]:
    """Sentences about one robot's navigation."""
    old = [waypoint for entry in before for waypoint in entry.waypoints]
    new = [waypoint for entry in after for waypoint in entry.waypoints]
    told = [
        f"{robot}: waypoint {number} moves from {_place(one)} to {_place(other)}."
        if _place(one) != _place(other)
        else f"{robot}: waypoint {number} is flown otherwise."
        for number, (one, other) in enumerate(zip(old, new, strict=False), 1)
        if one != other
    ]
    if len(told) > _MOST_TOLD:
        told = [*told[:_MOST_TOLD], f"{robot}: {len(told) - _MOST_TOLD} more waypoints differ."]
    if len(old) != len(new):
        told.append(f"{robot}: {len(new)} waypoints instead of {len(old)}.")
    bare = {"waypoints"}
    if [one.model_dump(exclude=bare) for one in before] != [
        one.model_dump(exclude=bare) for one in after
    ]:
        told.append(f"{robot}: order, deadline or stream of its navigation differs.")
    return told


def _place(waypoint: Waypoint) -> str:
    kind = WaypointType(waypoint.waypoint_type).value
    return f"({waypoint.x:g}, {waypoint.y:g}, {waypoint.z:g}) {kind}"


def _set_changes(noun: str, before: Sequence[str], after: Sequence[str]) -> list[str]:
    old, new = Counter(before), Counter(after)
    return [f"{noun} {name} is added." for name in sorted(new - old)] + [
        f"{noun} {name} is left out." for name in sorted(old - new)
    ]
