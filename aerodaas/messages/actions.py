"""Actions: what a drone does at a waypoint, or on the way there.

Extensions bring the kinds. The order of a waypoint's actions matters among those of one kind only:
the gimbal and the lens are set on the way; once they are, a picture is taken there, then a video
begins or ends, then actuators move.
"""

from __future__ import annotations

import types
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import fields
from functools import cache
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    ClassVar,
    TypeAlias,
    Union,
    cast,
    get_args,
    get_origin,
    get_type_hints,
)

import numpy as np
from annotated_types import Ge, Le, Unit
from typing_extensions import TypedDict

from aerodaas.config.extensions import added
from aerodaas.errors import InvalidWaypointError
from aerodaas.messages.serialization.json_types import StrictlyTyped

if TYPE_CHECKING:
    from pydantic import GetCoreSchemaHandler
    from pydantic_core import CoreSchema

__all__ = [
    "LARGEST",
    "Action",
    "ActionKeywords",
    "Actions",
    "Number",
    "Place",
    "action_kinds",
    "actions_of",
    "json_of_actions",
]

LARGEST = 1e9
"""Largest number of a waypoint either way: 64 bits hold as many seconds in nanoseconds; Earth is
smaller in metres."""

Number: TypeAlias = Annotated[float, StrictlyTyped(), Ge(-LARGEST), Le(LARGEST)]
Place: TypeAlias = tuple[float, float, float]


class Action:
    """Base class of all actions, each a frozen dataclass whose last field is its `type`."""

    __slots__ = ()
    type: Any
    """Its name in JSON, the literal of its class."""
    purpose: ClassVar[str]
    """What the drone does by it, as it is said after "it"."""
    stops: ClassVar[bool] = True
    """Whether the drone stays at the waypoint until it is done."""
    order: ClassVar[int] = 3
    """Actions of a lower number come first: 1 is for pictures and video, 2 for actuators."""
    keywords: ClassVar[tuple[str, ...]] = ()
    """Those of `ActionKeywords` that it is given by."""

    @classmethod
    def from_keywords(cls, given: Mapping[str, Any]) -> Iterator[Action]:
        """The actions of this kind that keywords say.

        Args:
            given: Its `keywords`, or some of them; a value may be of any type.

        Raises:
            InvalidWaypointError: For a value that it cannot have.
        """
        del given
        return iter(())

    @property
    def slot(self) -> str:
        """Payload that the action takes for itself: a waypoint has one action of each slot."""
        return self.type

    @property
    def equipment(self) -> str:
        """Id of the robot's actuator that it moves, for which tenants need a permission."""
        return ""

    @property
    def names(self) -> tuple[str, ...]:
        """Names that it holds, which must be short in a stranger's waypoint."""
        return ()

    @property
    def place(self) -> Place | None:
        """Its x, y and z, which are counted as the waypoint's are; None if it has none."""
        return None

    def moved(self, place: Place) -> Action:
        """Return the action at another place; `place` is its new x, y and z."""
        raise NotImplementedError(f"{self.type} has no place: {place}")

    def __post_init__(self) -> None:
        """Refuse a number outside of the range of its annotation."""
        for name, (low, high, unit, optional) in _ranges(type(self)).items():
            value = getattr(self, name)
            if value is None and optional:
                continue
            if not (isinstance(value, int | float | np.number) and abs(value) <= LARGEST):
                raise InvalidWaypointError(
                    f"{name} must be a finite number, not {value!r}; at most {LARGEST:g}"
                )
            if not low <= value <= high:
                raise InvalidWaypointError(
                    f"{name} is in {unit}, from {low:g} to {high:g}, not {value:g}"
                )
            object.__setattr__(self, name, float(value) + 0.0)  # -0.0 becomes 0.0


@cache
def _ranges(kind: type[Action]) -> Mapping[str, tuple[float, float, str, bool]]:
    """Least and largest value, unit, and whether it may be None, of each number of an action."""
    found = {}
    for name, hint in get_type_hints(kind, include_extras=True).items():
        union = get_origin(hint) in {Union, types.UnionType}
        number = get_args(hint)[0] if union else hint
        if get_origin(number) is Annotated and get_args(number)[0] is float:
            known = get_args(number)[1:]
            low = max(cast("float", one.ge) for one in known if isinstance(one, Ge))
            high = min(cast("float", one.le) for one in known if isinstance(one, Le))
            unit = next((one.unit for one in known if isinstance(one, Unit)), "metres")
            found[name] = (low, high, unit, union)
    return found


def action_kinds() -> Mapping[str, type[Action]]:
    """Classes of actions by their type in JSON, in the order in which a drone does them."""
    kinds: list[type[Any]] = sorted(added("actions"), key=lambda kind: kind.order)
    return {str(fields(kind)[-1].default): kind for kind in kinds}


class _AnyKind:
    """A tuple of actions of any kind that is known, as a list of objects with a `type`."""

    def __get_pydantic_core_schema__(
        self, source: object, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Schema by which pydantic reads and writes the actions."""
        from pydantic_core import core_schema  # noqa: PLC0415 - slow to load

        del source
        kinds = {name: handler.generate_schema(kind) for name, kind in action_kinds().items()}
        items = core_schema.list_schema(core_schema.tagged_union_schema(kinds, "type"))
        # A strict check refuses a list for a tuple, and a tuple for a list.
        listed = core_schema.no_info_before_validator_function(_list_of, items)
        written = core_schema.plain_serializer_function_ser_schema(json_of_actions)
        return core_schema.no_info_after_validator_function(tuple, listed, serialization=written)


Actions: TypeAlias = Annotated[tuple[Action, ...], _AnyKind()]


def _list_of(value: object) -> object:
    return list(value) if isinstance(value, tuple) else value


def json_of_actions(actions: Iterable[Action]) -> list[dict[str, Any]]:
    """The JSON value of actions: of each its type, and the fields that are not None."""
    found = []
    for action in actions:
        names = [one.name for one in fields(action)]  # type: ignore[arg-type] - a dataclass
        values = ((name, getattr(action, name)) for name in ("type", *names[:-1]))
        found.append({name: value for name, value in values if value is not None})
    return found


class ActionKeywords(TypedDict, total=False):
    """Actions as keyword arguments of `Waypoint`; None, False and an empty tuple are no action."""

    photo: bool
    """TakePhoto."""
    trigger_distance: float | None
    """TriggerPhotos."""
    trigger_interval: float | None
    gimbal_pitch: float | None
    """AimGimbal; the other angle is 0 where one is given."""
    gimbal_yaw: float | None
    look_at: Place | None
    """LookAt."""
    zoom: float | None
    """SetLens."""
    focus: float | None
    video: bool | None
    """RecordVideo."""
    actuate: Mapping[str, str] | tuple[tuple[str, str], ...]
    """MoveActuator: positions by actuator, in order."""


def actions_of(keywords: Mapping[str, Any]) -> tuple[Action, ...]:
    """The actions that keywords of `Waypoint` say, or the fields of its JSON up to version 0.1.

    Raises:
        InvalidWaypointError: For an unknown keyword, and a value that it cannot have.
    """
    kinds = action_kinds().values()
    if unknown := sorted(keywords.keys() - ActionKeywords.__annotations__.keys()):
        raise InvalidWaypointError(f"a waypoint has no {', '.join(unknown)}")
    known = {name for kind in kinds for name in kind.keywords}
    absent = [name for name in keywords if name not in known and not _is_empty(keywords[name])]
    if absent:
        raise InvalidWaypointError(
            f"this installation has no extension for {', '.join(absent)}: install aerodaas anew, "
            "whole"
        )
    return tuple(
        action
        for kind in kinds
        if not keywords.keys().isdisjoint(kind.keywords)
        for action in kind.from_keywords(keywords)
    )


def _is_empty(value: object) -> bool:
    return value is None or value is False or value in ((), [], {})
