"""What a mission can be told in flight, by the application, its streams or a remote user."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TypeAlias

from aerodaas.data import Header
from aerodaas.graph import NavigationEdge
from aerodaas.waypoints import AeroNavigation, SchedulingType

__all__ = [
    "TRIGGERED",
    "AddNavigation",
    "Answer",
    "ClearNavigation",
    "CloseStream",
    "Command",
    "End",
    "OpenStream",
    "Pause",
    "Reply",
    "Request",
    "Resume",
    "ReturnHome",
    "Start",
    "StreamItem",
    "initial_commands",
]


@dataclass(frozen=True, slots=True)
class Start:
    """Check, take off and fly what is queued."""


@dataclass(frozen=True, slots=True)
class AddNavigation:
    """Add waypoints to the queue, or obey velocity commands."""

    navigation: AeroNavigation
    index: int | None = None
    """Waypoints of the same priority to be visited before these; None lets the scheduler say."""
    deadline: float | None = None
    """Seconds of mission time for the waypoints that state none, or state a later one."""
    clear_first: bool = False
    """Empty the queue first: a mission abort."""
    cause: Header | None = None
    """Measurement that it was made from."""


@dataclass(frozen=True, slots=True)
class OpenStream:
    """A live stream will feed the mission from now on."""

    name: str
    feeds: bool = True
    """False for a stream that only empties the queue, such as one of detections."""
    ordered: bool = True
    """Waypoints of this stream keep the order in which they came."""
    priority: int | None = None
    """Overrides the priority of each item."""
    index: int | None = None
    deadline: float | None = None
    clear_first: bool = False
    """The stream's first item empties the queue."""


@dataclass(frozen=True, slots=True)
class StreamItem:
    """One item of an open stream; an item that is empty says nothing."""

    name: str
    item: object
    """AeroNavigation, or anything at all in a stream that only empties the queue."""
    cause: Header | None = None
    index: int | None = None
    """Waypoints to be visited before these, as in AddNavigation; None as the stream says."""
    replaces: bool = True
    """A waypoint takes the place of the one of its id that the stream queued before, for its
    target has moved; False refuses it."""


@dataclass(frozen=True, slots=True)
class CloseStream:
    """A live stream has ended."""

    name: str


@dataclass(frozen=True, slots=True)
class ClearNavigation:
    """Empty the queue; what was in it never comes back."""


@dataclass(frozen=True, slots=True)
class Pause:
    """Hover until told to resume."""


@dataclass(frozen=True, slots=True)
class Resume:
    """Go on where the mission was paused."""


@dataclass(frozen=True, slots=True)
class ReturnHome:
    """Fly back to the place of take-off and land."""

    reason: str = "asked to return"


@dataclass(frozen=True, slots=True)
class End:
    """Land here, now."""

    reason: str = "asked to land"


Command: TypeAlias = (
    Start
    | AddNavigation
    | OpenStream
    | StreamItem
    | CloseStream
    | ClearNavigation
    | Pause
    | Resume
    | ReturnHome
    | End
)


TRIGGERED: Mapping[str, Command] = {
    "end_mission": End("an analysis asked to land"),
    "pause_mission": Pause(),
    "resume_mission": Resume(),
}
"""What an analysis' trigger may have a robot do, by the robot's method."""


@dataclass(frozen=True, slots=True)
class Answer:
    """What the mission says to a command."""

    accepted: bool
    """Whether anything was done."""
    text: str = ""
    """One sentence for a person."""
    refused: Mapping[str, str] = field(default_factory=dict)
    """Reason by waypoint id, for the waypoints that were not taken."""


@dataclass(frozen=True, slots=True)
class Request:
    """A command whose sender waits for a `Reply` of the same number."""

    number: int
    command: Command


@dataclass(frozen=True, slots=True)
class Reply:
    """What the mission said to a `Request`."""

    number: int
    answer: Answer


def initial_commands(edges: Iterable[NavigationEdge]) -> list[Command]:
    """Turn the navigation edges of one robot's graph into commands, in the order written.

    A stream that both feeds navigation and empties the queue (or is written twice) is opened once.
    """
    commands: list[Command] = []
    streams: dict[str, OpenStream] = {}
    for edge in edges:
        stream = edge.navigation.stream
        if stream is None:
            commands.append(AddNavigation(edge.navigation, edge.index, edge.deadline))
        else:
            earlier = streams.get(stream.name)
            streams[stream.name] = OpenStream(
                stream.name,
                feeds=issubclass(stream.item, AeroNavigation),
                ordered=edge.navigation.scheduling_type is SchedulingType.ORDERED,
                priority=edge.navigation.priority,
                index=edge.index,
                deadline=edge.deadline,
                clear_first=edge.clear_on == stream.name
                or (earlier is not None and earlier.clear_first),
            )
        if edge.clear_on is not None and (stream is None or edge.clear_on != stream.name):
            streams.setdefault(
                edge.clear_on, OpenStream(edge.clear_on, feeds=False, clear_first=True)
            )
    return [*commands, *streams.values()]
