"""What a drone does at a waypoint with its actuators."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

from aerodaas.errors import InvalidWaypointError
from aerodaas.messages.actions import Action
from aerodaas.messages.serialization.records import shared_pickle

__all__ = ["MoveActuator"]


@shared_pickle
@dataclass(frozen=True, slots=True)
class MoveActuator(Action):
    """Have an actuator take a position at the waypoint, after picture and video."""

    purpose: ClassVar[str] = "moves actuators"
    order: ClassVar[int] = 2
    keywords: ClassVar[tuple[str, ...]] = ("actuate",)
    actuator: str
    """Its id in the environment file."""
    position: str
    """Name of one of its positions in the environment file, such as `open`."""
    type: Literal["move_actuator"] = field(default="move_actuator", repr=False)

    def __post_init__(self) -> None:
        """Refuse what is no text."""
        names: tuple[object, object] = (self.actuator, self.position)
        if not all(isinstance(name, str) for name in names):
            raise InvalidWaypointError(f"actuator and position are texts, not {names!r}")

    @classmethod
    def from_keywords(cls, given: Mapping[str, Any]) -> Iterator[Action]:
        """One of each actuator."""
        moves = given["actuate"]
        pairs = tuple(moves.items()) if isinstance(moves, Mapping) else moves
        if not (isinstance(pairs, tuple | list) and all(map(_is_pair, pairs))):
            message = f'actuate is positions by actuator, {{"hook": "release"}}, not {moves!r}'
            raise InvalidWaypointError(message)
        return (cls(*pair) for pair in pairs)

    @property
    def slot(self) -> str:
        """The actuator, which a waypoint moves once."""
        return f"actuator {self.actuator}"

    @property
    def equipment(self) -> str:
        """The actuator."""
        return self.actuator

    @property
    def names(self) -> tuple[str, str]:
        """The actuator and its position."""
        return self.actuator, self.position


def _is_pair(value: object) -> bool:
    return isinstance(value, tuple | list) and [type(one) for one in value] == [str, str]
