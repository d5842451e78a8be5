"""Commands to a drone of a provider's mission, as the wire has them."""

from __future__ import annotations

from pydantic import ValidationError

from aerodaas.environment.provider.client import ProviderClient
from aerodaas.errors import GraphError, InvalidWaypointError
from aerodaas.messages.waypoints import SchedulingType
from aerodaas.mission.commands import (
    Actuate,
    AddNavigation,
    Answer,
    ClearNavigation,
    Command,
    HandOver,
    RearrangeNavigation,
    ReleaseParachute,
    TakeBack,
)
from aerodaas.protocol.piloting import ActuateIn, RearrangeIn
from aerodaas.protocol.schemas import CommandIn, NavigationIn, word_for

__all__ = ["send_command"]


def send_command(client: ProviderClient, mission: str, robot: str, command: Command) -> Answer:
    """Send a command over the wire and return the drone's answer.

    Args:
        client: Client of the provider.
        mission: Id of the mission.
        robot: Id of the robot.
        command: The command.

    Raises:
        GraphError: For a command that cannot be given from afar.
        InvalidWaypointError: For waypoints that the wire cannot hold.
        AeroDaaSError: The client's errors.
    """
    if isinstance(command, AddNavigation):
        if command.navigation:
            return client.add_navigation(mission, _navigation(robot, command))
        if not command.clear_first:
            return Answer(accepted=False, text="the navigation is empty: there is nothing to fly")
        command = ClearNavigation()
    if isinstance(command, RearrangeNavigation):
        return client.rearrange(mission, _change(robot, command))
    if isinstance(command, Actuate):
        wanted = ActuateIn(robot=robot, actuator=command.actuator, position=command.position)
        return client.actuate(mission, wanted)
    if isinstance(command, ReleaseParachute):
        raise GraphError(f"{robot} flies at a provider, and no parachute is fired from afar")
    if isinstance(command, HandOver | TakeBack):
        raise GraphError(f"{robot} flies at a provider, which hands no waypoints over")
    word = word_for(command)
    if word is None:
        raise GraphError(
            f"{robot} flies at a provider: streams of navigation are connected before "
            "start_mission(); in flight, waypoints can be added"
        )
    return client.command(mission, CommandIn(robot=robot, command=word))


def _navigation(robot: str, command: AddNavigation) -> NavigationIn:
    navigation = command.navigation
    if navigation.commands:
        raise GraphError(f"{robot} flies at a provider, where velocity commands come from analyses")
    try:
        return NavigationIn(
            robot=robot,
            waypoints=list(navigation.waypoints),
            ordered=navigation.scheduling_type is SchedulingType.ORDERED,
            index=command.index,
            deadline=command.deadline,
            clear_first=command.clear_first,
        )
    except ValidationError as error:
        first = error.errors()[0]
        raise InvalidWaypointError(f"{robot}: {first['msg']}") from None


def _change(robot: str, command: RearrangeNavigation) -> RearrangeIn:
    try:
        return RearrangeIn(robot=robot, order=list(command.order), remove=list(command.remove))
    except ValidationError as error:
        first = error.errors()[0]
        raise InvalidWaypointError(f"{robot}: {first['msg']}") from None
