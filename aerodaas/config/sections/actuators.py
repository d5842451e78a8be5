"""The actuators that a robot carries, by the names that applications use for them."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Annotated, Literal, TypeAlias

from pydantic import Field, model_validator

from aerodaas.config.checked import Strict, near
from aerodaas.identifiers import Identifier

__all__ = [
    "ACTUATOR_TYPES",
    "ActuatorConfig",
    "GripperConfig",
    "ParachuteConfig",
    "RelayConfig",
    "ServoConfig",
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
