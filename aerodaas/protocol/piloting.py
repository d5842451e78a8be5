"""What a pilot and a flying mission say to each other beyond simple commands: JSON models.

Units are metres, seconds, radians and m/s in the local ENU frame; a charge is 0 to 1.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from aerodaas.messages.waypoints import VelocityCommand
from aerodaas.mission.commands import (
    Actuate,
    RearrangeNavigation,
    ReleaseControls,
    Steer,
    TakeControls,
)
from aerodaas.protocol.base import AnswerModel, RequestModel
from aerodaas.protocol.schemas import Word

__all__ = [
    "ActuateIn",
    "ControlsIn",
    "ControlsOut",
    "RearrangeIn",
    "SteerIn",
    "told_of_controls",
]

_MOST_WAYPOINTS = 1000
_Id = Annotated[str, Field(min_length=1, max_length=64)]
_Ids = Annotated[list[_Id], Field(max_length=_MOST_WAYPOINTS)]
_Axis = Annotated[float, Field(ge=-100, le=100)]


class RearrangeIn(RequestModel):
    """Change of the coming waypoints of one robot: one command, carried out whole."""

    robot: Word
    order: _Ids = Field(default_factory=list)
    """Waypoints that change places among themselves; all others keep theirs."""
    remove: _Ids = Field(default_factory=list)
    """Waypoints that are not flown to."""

    def command(self) -> RearrangeNavigation:
        """The command."""
        return RearrangeNavigation(tuple(self.order), tuple(self.remove))


class ActuateIn(RequestModel):
    """An actuator of one robot, and the position that it is to take now."""

    robot: Word
    actuator: Word
    position: Word

    def command(self) -> Actuate:
        """The command."""
        return Actuate(self.actuator, self.position)


class SteerIn(RequestModel):
    """A velocity by hand, in the drone's level frame; it is good for a third of a second."""

    forward: _Axis = 0.0
    left: _Axis = 0.0
    up: _Axis = 0.0
    yaw_rate: _Axis = 0.0
    """rad/s, counter-clockwise."""
    at: Annotated[float, Field(ge=0, le=1e15)]
    """Milliseconds of the sender's own clock: what was under way for too long is not obeyed."""

    def velocity(self) -> VelocityCommand:
        """The command."""
        return VelocityCommand(self.forward, self.left, self.up, self.yaw_rate)


class ControlsIn(RequestModel):
    """A command of manual control, as the service hands it to a flight's own process."""

    robot: Word
    command: Annotated[TakeControls | Steer | ReleaseControls, Field(union_mode="left_to_right")]


class ControlsOut(AnswerModel):
    """Answer to a velocity by hand."""

    held: bool
    """Whether the sender has the controls; if not, the connection ends."""
    at: float = 0.0
    """Of the velocity that is answered."""
    text: str = ""


def told_of_controls(command: TakeControls | Steer | ReleaseControls) -> str:
    """Words for a command in an alert; empty for a velocity, of which many come."""
    if isinstance(command, TakeControls):
        return f"be flown by hand by {command.operator}"
    return "be let go of" if isinstance(command, ReleaseControls) else ""
