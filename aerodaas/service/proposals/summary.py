"""What an approver is told of a proposed mission, in sentences made from its document.

Texts of the document are its proposer's, and are never part of a sentence.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence

from aerodaas.dataflow.mission_document import (
    AnalysisEntry,
    MissionDocument,
    NavigationDocument,
)
from aerodaas.messages.waypoints import Waypoint, WaypointType

__all__ = ["difference", "records_of", "summary_of"]

_MOST_TOLD = 12
"""Most sentences about changes of one robot."""
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
    """Describe what a mission records of its surroundings and of people, a sentence each.

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
    """Describe what would fly, in sentences made from the document.

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
    """Describe the difference of two documents, a sentence each; empty if they fly the same.

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
