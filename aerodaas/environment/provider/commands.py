"""Commands to a drone of a provider's mission, as the wire has them."""

from __future__ import annotations

from pydantic import ValidationError

from aerodaas.analytics.remote.schemas import AnswerOut, WaypointsIn
from aerodaas.dataflow.mission_document import WaypointEntry
from aerodaas.environment.provider.client import ProviderClient
from aerodaas.mission.commands import AddNavigation, Answer, Command
from aerodaas.protocol.commands import word_for
from aerodaas.protocol.schemas import CommandIn
from aerodaas.types.errors import GraphError, InvalidWaypointError
from aerodaas.types.waypoints import SchedulingType

__all__ = ["send_command"]


def send_command(client: ProviderClient, mission: str, robot: str, command: Command) -> Answer:
    """Send a command over the wire and return the drone's answer.

    Raises GraphError for one that cannot be given from afar, InvalidWaypointError for waypoints
    that the wire cannot hold, and the client's errors.
    """
    if isinstance(command, AddNavigation):
        waypoints = _waypoints(robot, command) if command.navigation else None
        if command.clear_first:
            cleared = client.command(mission, CommandIn(robot=robot, command="clear"))
            if not cleared.accepted or waypoints is None:
                return _answer(cleared)
        if waypoints is None:
            return Answer(accepted=True)
        return _answer(client.add_navigation(mission, robot, waypoints))
    word = word_for(command)
    if word is None:
        raise GraphError(
            f"{robot} flies at a provider: streams of navigation are connected before "
            "start_mission(); in flight, waypoints can be added"
        )
    return _answer(client.command(mission, CommandIn(robot=robot, command=word)))


def _waypoints(robot: str, command: AddNavigation) -> WaypointsIn:
    navigation = command.navigation
    if navigation.commands:
        raise GraphError(f"{robot} flies at a provider, where velocity commands come from analyses")
    try:
        entries = [WaypointEntry.of(one) for one in navigation.waypoints]
        if command.deadline is not None:
            entries = [_due(one, command.deadline) for one in entries]
        return WaypointsIn(
            waypoints=entries,
            ordered=navigation.scheduling_type is SchedulingType.ORDERED,
            index=command.index,
        )
    except ValidationError as error:
        first = error.errors()[0]
        raise InvalidWaypointError(f"{robot}: {first['msg']}") from None


def _due(entry: WaypointEntry, deadline: float) -> WaypointEntry:
    """The waypoint with this deadline, unless its own is earlier."""
    earliest = deadline if entry.deadline is None else min(deadline, entry.deadline)
    return entry.model_copy(update={"deadline": earliest})


def _answer(answer: AnswerOut) -> Answer:
    return Answer(answer.accepted, answer.text, dict(answer.refused))
