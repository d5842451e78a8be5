"""Commands that a mission accepts in flight from the application, its streams or a remote user."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TypeAlias

from aerodaas.dataflow.graph import NavigationEdge
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.messages.frames import Header
from aerodaas.messages.waypoints import SchedulingType, VelocityCommand

__all__ = [
    "TRIGGERED",
    "Actuate",
    "AddNavigation",
    "Answer",
    "ClearNavigation",
    "CloseStream",
    "Command",
    "End",
    "HandOver",
    "OpenStream",
    "Pause",
    "RearrangeNavigation",
    "ReleaseControls",
    "ReleaseParachute",
    "Resume",
    "ReturnHome",
    "Start",
    "Steer",
    "StreamItem",
    "TakeBack",
    "TakeControls",
    "initial_commands",
]


@dataclass(frozen=True, slots=True)
class Start:
    """Run the preflight checks, take off and fly the queue."""


@dataclass(frozen=True, slots=True)
class AddNavigation:
    """Add waypoints to the queue, or execute velocity commands."""

    navigation: AeroNavigation
    index: int | None = None
    """Number of waypoints of the same priority to visit first; None leaves it to the scheduler."""
    deadline: float | None = None
    """Seconds of mission time for waypoints that have no deadline, or a later one."""
    clear_first: bool = False
    """Empty the queue first: a mission abort."""
    cause: Header | None = None
    """Header of the measurement that the navigation was made from."""


@dataclass(frozen=True, slots=True)
class OpenStream:
    """Announce a live stream that will feed the mission from now on."""

    name: str
    feeds: bool = True
    """False for a stream that only empties the queue, such as a stream of detections."""
    ordered: bool = True
    """Waypoints of this stream keep their order of arrival."""
    priority: int | None = None
    """Overrides the priority of each item."""
    index: int | None = None
    deadline: float | None = None
    clear_first: bool = False
    """The stream's first item empties the queue."""


@dataclass(frozen=True, slots=True)
class StreamItem:
    """One item of an open stream; an empty item is a result without navigation."""

    name: str
    item: object
    """AeroNavigation, or an item of any type in a stream that only empties the queue."""
    cause: Header | None = None
    index: int | None = None
    """Number of waypoints to visit first, as in AddNavigation; None uses the stream's setting."""
    replaces: bool = True
    """A waypoint replaces the one of its id that the stream queued before, because its target has
    moved; False refuses it."""


@dataclass(frozen=True, slots=True)
class CloseStream:
    """Announce the end of a live stream."""

    name: str


@dataclass(frozen=True, slots=True)
class ClearNavigation:
    """Empty the queue; removed waypoints are not restored."""


@dataclass(frozen=True, slots=True)
class Pause:
    """Hover until the mission is resumed."""


@dataclass(frozen=True, slots=True)
class Resume:
    """Continue where the mission was paused."""


@dataclass(frozen=True, slots=True)
class RearrangeNavigation:
    """Change the order of coming waypoints and remove others, as a whole.

    Waypoints that were reached, or at which the drone is by then, are left out.
    """

    order: tuple[str, ...] = ()
    """Ids that change places among themselves, and stay there; all others keep their places."""
    remove: tuple[str, ...] = ()
    """Ids that are not flown to."""


@dataclass(frozen=True, slots=True)
class TakeControls:
    """Pause the mission, and fly by hand from now on."""

    operator: str
    """Name for the others to read."""
    session: int
    """Number of this takeover, not 0; the operator's commands carry it."""


@dataclass(frozen=True, slots=True)
class Steer:
    """Fly at a velocity until it expires, and then brake and hold."""

    session: int
    """That of the `TakeControls` before."""
    velocity: VelocityCommand


@dataclass(frozen=True, slots=True)
class ReleaseControls:
    """Let go of the controls: the drone holds, and the mission stays paused."""

    session: int


@dataclass(frozen=True, slots=True)
class HandOver:
    """Have the autopilot fly the waypoints ahead by its own mission mode.

    It flies them until they are taken back: by `TakeBack`, by any command that changes what is to
    be flown, by a failsafe, or by the guard of the limits.
    """


@dataclass(frozen=True, slots=True)
class TakeBack:
    """Fly the waypoints that the autopilot has not reached by setpoints again."""


@dataclass(frozen=True, slots=True)
class Actuate:
    """Have an actuator take a position now, wherever the drone is."""

    actuator: str
    position: str


@dataclass(frozen=True, slots=True)
class ReleaseParachute:
    """Fire a parachute: the flight is over, and the drone comes down where it is.

    It lands until the vehicle has answered. No trigger, document, wire or recording has this
    command: it is the application's own, where the environment file permits it.
    """

    parachute: str


@dataclass(frozen=True, slots=True)
class ReturnHome:
    """Fly back to the place of take-off and land."""

    reason: str = "asked to return"


@dataclass(frozen=True, slots=True)
class End:
    """Land now, at the current position."""

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
    | RearrangeNavigation
    | TakeControls
    | Steer
    | ReleaseControls
    | HandOver
    | TakeBack
    | Actuate
    | ReleaseParachute
    | ReturnHome
    | End
)


TRIGGERED: Mapping[str, Command] = {
    "end_mission": End("an analysis asked to land"),
    "pause_mission": Pause(),
    "resume_mission": Resume(),
}
"""Commands that an analysis' trigger can give to a robot, by the robot's method."""


@dataclass(frozen=True, slots=True)
class Answer:
    """The mission's answer to a command."""

    accepted: bool
    """Whether the command had an effect."""
    text: str = ""
    """One sentence for the operator."""
    refused: Mapping[str, str] = field(default_factory=dict)
    """Reason by waypoint id, for refused waypoints."""


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
