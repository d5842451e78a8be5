"""Commands of a mission in flight: checks of incoming navigation, and control by hand."""

from __future__ import annotations

from collections.abc import Sized
from dataclasses import replace

from aerodaas.clock import NANOSECONDS, seconds
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.errors import InvalidWaypointError
from aerodaas.messages.frames import Header
from aerodaas.messages.waypoints import HeightReference, SchedulingType, VelocityCommand
from aerodaas.mission.commands import (
    AddNavigation,
    Answer,
    CloseStream,
    OpenStream,
    RearrangeNavigation,
    ReleaseControls,
    Steer,
    StreamItem,
    TakeControls,
)
from aerodaas.mission.log import MissionLog
from aerodaas.mission.navigation.navigator import Navigator

__all__ = ["MANUAL_SECONDS", "CommandHandler", "ManualControl"]

MANUAL_SECONDS = 0.3
"""Longest validity of a velocity by hand, mission time: the dead man's switch of whoever steers.
With the setpoint loop's 0.05 s, the drone brakes within 0.35 s of the last command."""


class ManualControl:
    """The controls of one drone: one operator has them, as long as they are heard of."""

    def __init__(self) -> None:
        """Start without an operator."""
        self._session = 0
        self._operator = ""
        self._velocity: VelocityCommand | None = None
        self._expires = 0
        """Mission clock after which the holder counts as silent, nanoseconds."""

    def operator(self, now: int) -> str:
        """Name of who has the controls at `now` (mission clock, ns); empty for nobody."""
        return self._operator if now < self._expires else ""

    def handle(self, command: TakeControls | Steer | ReleaseControls, now: int) -> str:
        """Execute a command of an operator.

        Args:
            command: The operator's request; its `session` tells whether the operator has the
                controls.
            now: Mission clock, nanoseconds.

        Returns:
            Why the command is not executed, or an empty text.
        """
        holder, own = self.operator(now), command.session == self._session != 0
        match command:
            case TakeControls() if own or not holder:
                self._session, self._operator = command.session, command.operator
                self._update(None, MANUAL_SECONDS, now)
            case Steer() if own:
                velocity = command.velocity
                self._update(velocity, min(velocity.valid_for, MANUAL_SECONDS), now)
            case ReleaseControls() if own:
                self._session, self._velocity, self._expires = 0, None, 0
            case _:
                return f"{holder} has the controls" if holder else "take the controls first"
        return ""

    def _update(self, velocity: VelocityCommand | None, seconds: float, now: int) -> None:
        self._velocity, self._expires = velocity, now + round(seconds * NANOSECONDS)

    def velocity(self, now: int) -> VelocityCommand | None:
        """The velocity to fly at `now`; None to stay where the drone is."""
        moves = self._velocity
        if moves is None or now >= self._expires:
            return None
        return moves if moves.yaw_rate or moves.velocity.any() else None

    def reason(self, now: int) -> str:
        """Reason of the pause at `now`; empty if nobody has flown by hand."""
        if not self._operator:
            return ""
        if self.operator(now):
            return f"flown by hand by {self._operator}"
        silent = self._session != 0
        return f"nothing is heard of {self._operator}" if silent else f"{self._operator} let go"


DONE = Answer(accepted=True)
"""Acceptance without further text."""


class CommandHandler:
    """Checks navigation, passes it to the navigator, and tracks which streams are open."""

    def __init__(self, navigator: Navigator, log: MissionLog) -> None:
        """Feed `navigator`; refusals go to `log`."""
        self.last_received = 0
        """Mission clock of the last navigation message, nanoseconds."""
        self._navigator = navigator
        self._log = log
        self._streams: dict[str, OpenStream] = {}
        self._groups = 0

    @property
    def is_fed(self) -> bool:
        """Whether a live stream may still deliver navigation."""
        return any(stream.feeds for stream in self._streams.values())

    def open(self, stream: OpenStream, now: int) -> None:
        """Accept items of `stream` from `now` on.

        Args:
            stream: The stream, which replaces an open one of its name.
            now: Mission clock, nanoseconds.
        """
        self._streams[stream.name] = stream
        self.last_received = now

    def close(self, stream: CloseStream) -> None:
        """Accept no further items of `stream`."""
        self._streams.pop(stream.name, None)

    def clear(self, now: int) -> None:
        """Discard all queued navigation and the live command."""
        self._navigator.clear()
        self.last_received = now

    def navigate(
        self, command: AddNavigation | StreamItem | RearrangeNavigation, now: int
    ) -> Answer:
        """Execute a command that changes the queue.

        Args:
            command: Navigation to add, an item of an open stream, or a new order of stops.
            now: Mission clock, nanoseconds.
        """
        match command:
            case AddNavigation():
                return self.add(command, now)
            case StreamItem():
                return self.receive(command, now)
            case RearrangeNavigation():
                return self.rearrange(command)

    def add(self, command: AddNavigation, now: int) -> Answer:
        """Add navigation of the application or a remote user.

        Args:
            command: The navigation, where it is queued, and whether the queue is cleared first.
            now: Mission clock, nanoseconds.
        """
        if command.clear_first:
            self.clear(now)
            if command.navigation.stream is None and not len(command.navigation):
                return DONE
        by_hand = OpenStream("", index=command.index, deadline=command.deadline)
        return self._navigate(command.navigation, by_hand, now, command.cause)

    def rearrange(self, command: RearrangeNavigation) -> Answer:
        """Change the order of queued waypoints and remove others, unless the drone is there."""
        named = [*command.order, *command.remove]
        twice = sorted({key for key in named if named.count(key) > 1})
        if twice:
            return Answer(accepted=False, text=f"{', '.join(twice)}: named more than once")
        refused = {key: text for key in named if (text := self._fixed(key))}
        if len(refused) == len(named):
            text = "; ".join(refused.values()) or "nothing was named to be moved or removed"
            return Answer(accepted=False, text=text, refused=refused)
        order = [key for key in command.order if key not in refused]
        removed = [key for key in command.remove if key not in refused]
        try:
            self._navigator.queue.rearrange(order, removed)
        except InvalidWaypointError as error:
            return Answer(accepted=False, text=str(error))
        return Answer(accepted=True, text="; ".join(refused.values()), refused=refused)

    def _fixed(self, key: str) -> str:
        """Why a waypoint can be neither moved nor removed; empty if it can."""
        stop = self._navigator.queue.find(key)
        if stop is None:
            reached = self._log.reached(key)
            return f"{key} was reached meanwhile" if reached else f"{key} is not in the plan"
        return f"the drone is at {key} by now" if stop.arrived else ""

    def receive(self, message: StreamItem, now: int) -> Answer:
        """Add an item of an open stream.

        Args:
            message: The item and the name of its stream; other items than navigation change
                nothing.
            now: Mission clock, nanoseconds.
        """
        stream = self._streams.get(message.name)
        if stream is None:
            return Answer(accepted=False, text=f"no stream called {message.name!r} is open")
        item = message.item
        if item is None or (isinstance(item, Sized) and not len(item)):
            return DONE
        if stream.clear_first:
            self.clear(now)
            stream = self._streams[stream.name] = replace(stream, clear_first=False)
        if not isinstance(item, AeroNavigation):
            return DONE
        if stream.priority is not None:
            kind, scheduling = item.navigation_type, item.scheduling_type
            item = AeroNavigation(kind, item, scheduling, priority=stream.priority)
        if message.index is not None:
            stream = replace(stream, index=message.index)
        return self._navigate(item, stream, now, message.cause, replaces=message.replaces)

    def _navigate(
        self,
        navigation: AeroNavigation,
        stream: OpenStream,
        now: int,
        cause: Header | None,
        *,
        replaces: bool = True,
    ) -> Answer:
        if navigation.stream is not None:
            text = "navigation that is a stream is opened with OpenStream, not added"
            return Answer(accepted=False, text=text)
        if not len(navigation):
            return Answer(accepted=False, text="the navigation is empty: there is nothing to fly")
        taken, refused = self._navigator.admit(
            navigation.waypoints, seconds(now), stream.deadline, stream.name if replaces else ""
        )
        self._groups += not stream.name
        ordered = navigation.scheduling_type is SchedulingType.ORDERED and stream.ordered
        group = (stream.name or f"group {self._groups}") if ordered else None
        follows = {
            asked.id: asked.z
            for asked in navigation.waypoints
            if asked.above is HeightReference.GROUND
        }
        try:
            self._navigator.add(
                taken,
                group=group,
                index=stream.index,
                source=stream.name,
                cause=cause,
                above_ground=follows,
            )
        except InvalidWaypointError as error:
            return Answer(accepted=False, text=str(error))
        for velocity in navigation.commands:
            self._navigator.obey(velocity, now, cause)
        for waypoint in taken:
            self._log.given_up.pop(waypoint.id, None)
        for waypoint_id, reason in refused.items():
            self._refuse(waypoint_id, reason, now)
        accepted = bool(taken or navigation.commands)
        if accepted:
            self.last_received = now
        return Answer(accepted, "; ".join(refused.values()), refused)

    def _refuse(self, waypoint_id: str, reason: str, now: int) -> None:
        """Give a refused waypoint up, unless another one of its id is queued or was reached."""
        if self._navigator.queue.find(waypoint_id) or self._log.reached(waypoint_id):
            self._log.alert(now, "refused", reason)
        else:
            self._log.give_up(now, waypoint_id, reason)
