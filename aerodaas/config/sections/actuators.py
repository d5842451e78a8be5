"""The actuators that a robot carries, by the names that applications use for them."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from typing import Annotated, Literal, TypeAlias

from pydantic import Field, model_validator

from aerodaas.config.checked import Strict, near
from aerodaas.identifiers import Identifier
from aerodaas.messages.actions import Action, MoveActuator

__all__ = [
    "ACTUATOR_TYPES",
    "ActuatorConfig",
    "GripperConfig",
    "ParachuteConfig",
    "RelayConfig",
    "ServoConfig",
    "actuator_objection",
    "parachute_objection",
    "permitted",
]

_Pulse = Annotated[int, Field(ge=500, le=2500)]
"""Microseconds."""


class GripperConfig(Strict):
    """A gripper, or a winch that the autopilot treats as one: `grab` and `release`."""

    id: Identifier
    type: Literal["gripper"]
    instance: Annotated[int, Field(ge=1, le=6)] = 1
    """Number of the autopilot's gripper, from 1."""

    @property
    def positions(self) -> tuple[str, ...]:
        """The positions that it can take."""
        return ("grab", "release")


class RelayConfig(Strict):
    """A relay: `on` and `off`."""

    id: Identifier
    type: Literal["relay"]
    instance: Annotated[int, Field(ge=0, le=15)] = 0
    """Number of the autopilot's relay, from 0."""
    rest: Literal["on", "off"] | None = None
    """Position that it is given once the drone comes home, lands or is given up; none stays."""

    @property
    def positions(self) -> tuple[str, ...]:
        """The positions that it can take."""
        return ("on", "off")


class ServoConfig(Strict):
    """A servo, with positions of one's own."""

    id: Identifier
    type: Literal["servo"]
    channel: Annotated[int, Field(ge=1, le=32)]
    """The autopilot's output, from 1."""
    positions: Annotated[dict[Identifier, _Pulse], Field(min_length=1, max_length=16)]
    """Length of the pulse by position, microseconds from 500 to 2500."""
    rest: Identifier | None = None
    """One of its positions, which it is given once the drone comes home, lands or is given up; none
    stays."""

    @model_validator(mode="after")
    def _rests_where_it_can(self) -> ServoConfig:
        if self.rest is not None and self.rest not in self.positions:
            raise ValueError(
                f"no position is called {self.rest!r}{near(self.rest, self.positions)}"
            )
        return self


class ParachuteConfig(Strict):
    """A parachute: `enable` and `disable`; its release is a command of its own."""

    id: Identifier
    type: Literal["parachute"]
    may_release: bool = False
    """Whether the application may fire it, which ends the flight."""

    @property
    def positions(self) -> tuple[str, ...]:
        """The positions that it can take; firing it is none of them."""
        return ("enable", "disable")


ActuatorConfig: TypeAlias = Annotated[
    GripperConfig | RelayConfig | ServoConfig | ParachuteConfig, Field(discriminator="type")
]


ACTUATOR_TYPES = frozenset({"gripper", "relay", "servo", "parachute"})
"""All types, for drivers that can move each."""


def permitted(
    robot: str, actuators: Sequence[ActuatorConfig], names: Collection[str]
) -> list[ActuatorConfig]:
    """The actuators of a robot that somebody else may move; never a parachute.

    >>> permitted("drone", [RelayConfig(id="pump", type="relay")], ["drone/pump"])[0].id
    'pump'

    Args:
        robot: Id of the robot.
        actuators: Its actuators.
        names: Those that are permitted, as `robot/actuator`.
    """
    return [
        one
        for one in actuators
        if f"{robot}/{one.id}" in names and not isinstance(one, ParachuteConfig)
    ]


def actuator_objection(
    actuators: Sequence[ActuatorConfig], actions: Iterable[Action], *, by_waypoint: bool
) -> str:
    """Why actuators cannot be moved as `actions` say; empty if they can.

    Args:
        actuators: Those of the robot.
        actions: The actions, of which those of other kinds are left out.
        by_waypoint: Whether a waypoint asks, which has no say over a parachute.
    """
    known = {one.id: one for one in actuators}
    for action in actions:
        if not isinstance(action, MoveActuator):
            continue
        name, position = action.actuator, action.position
        actuator = known.get(name)
        if actuator is None:
            return f"no actuator is called {name!r}{near(name, known)}"
        if by_waypoint and isinstance(actuator, ParachuteConfig):
            return f"{name!r} is a parachute, which no waypoint touches"
        if position not in actuator.positions:
            return f"{name!r} has no position {position!r}{near(position, actuator.positions)}"
    return ""


def parachute_objection(actuators: Sequence[ActuatorConfig], name: str) -> str:
    """Why a parachute is not fired; empty if it is permitted.

    Args:
        actuators: Those of the robot.
        name: Id of the parachute.
    """
    chutes = {one.id: one for one in actuators if isinstance(one, ParachuteConfig)}
    if name not in chutes:
        return f"no parachute is called {name!r}{near(name, chutes)}"
    if not chutes[name].may_release:
        return f"{name!r} may not be fired: its may_release in the environment file is false"
    return ""
