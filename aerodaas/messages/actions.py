"""Actions: what a drone does at a waypoint, or on the way there.

The order of a waypoint's actions does not matter, except among those of actuators: the gimbal and
the lens are set on the way; once they are, a picture is taken there, then a video begins or ends,
then actuators move.
"""

from __future__ import annotations

import types
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields
from functools import cache
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    ClassVar,
    Literal,
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
from aerodaas.messages.serialization.records import shared_pickle

if TYPE_CHECKING:
    from pydantic import GetCoreSchemaHandler
    from pydantic_core import CoreSchema

__all__ = [
    "LARGEST",
    "LEAST_TRIGGER",
    "Action",
    "ActionKeywords",
    "Actions",
    "AimGimbal",
    "LookAt",
    "MoveActuator",
    "Number",
    "RecordVideo",
    "SetLens",
    "TakePhoto",
    "TriggerPhotos",
    "action_kinds",
    "actions_of",
    "json_of_actions",
]

LARGEST = 1e9
"""Largest number of a waypoint either way: 64 bits hold as many seconds in nanoseconds; Earth is
smaller in metres."""
LEAST_TRIGGER = 0.1
"""Metres, and seconds, between two pictures: no camera is faster than its drone's loop."""
_HALF_TURN = 3.1416
"""pi, and the rounding of who writes it by hand."""

Number: TypeAlias = Annotated[float, StrictlyTyped(), Ge(-LARGEST), Le(LARGEST)]
Angle: TypeAlias = Annotated[Number, Ge(-_HALF_TURN), Le(_HALF_TURN), Unit("radians")]
Percent: TypeAlias = Annotated[Number, Ge(0.0), Le(100.0), Unit("percent")]
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

    @property
    def slot(self) -> str:
        """Payload that the action takes for itself: a waypoint has one action of each slot."""
        return self.type

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


@shared_pickle
@dataclass(frozen=True, slots=True)
class TakePhoto(Action):
    """Take one picture at the waypoint, once the gimbal looks where it is to."""

    purpose: ClassVar[str] = "takes pictures"
    type: Literal["take_photo"] = field(default="take_photo", repr=False)


@shared_pickle
@dataclass(frozen=True, slots=True)
class TriggerPhotos(Action):
    """Take pictures on the way to the waypoint, by distance or by time, without a stop."""

    purpose: ClassVar[str] = "takes pictures"
    stops: ClassVar[bool] = False
    distance: Annotated[Number, Ge(LEAST_TRIGGER), Unit("metres")] | None = None
    """Metres between pictures along the straight line from where the way begins."""
    interval: Annotated[Number, Ge(LEAST_TRIGGER), Unit("seconds")] | None = None
    """Seconds between pictures, on the way and during the stay."""
    type: Literal["trigger_photos"] = field(default="trigger_photos", repr=False)

    def __post_init__(self) -> None:
        """Refuse both, or none."""
        Action.__post_init__(self)
        if (self.distance is None) == (self.interval is None):
            raise InvalidWaypointError("give it trigger_distance or trigger_interval, not both")


@shared_pickle
@dataclass(frozen=True, slots=True)
class AimGimbal(Action):
    """Turn the gimbal on the way to the waypoint."""

    purpose: ClassVar[str] = "turns the gimbal"
    pitch: Angle = 0.0
    """0 at the horizon, negative downwards: -pi/2 looks straight down."""
    yaw: Angle = 0.0
    """From the nose, counter-clockwise."""
    type: Literal["aim_gimbal"] = field(default="aim_gimbal", repr=False)

    @property
    def slot(self) -> str:
        """The gimbal."""
        return "gimbal"


@shared_pickle
@dataclass(frozen=True, slots=True)
class LookAt(Action):
    """Keep the gimbal, or the nose where the gimbal cannot turn, on a place.

    From the way to the waypoint on, until one has another place or turns the gimbal.
    """

    purpose: ClassVar[str] = "turns the gimbal"
    stops: ClassVar[bool] = False
    x: Number
    """Counted as the waypoint's own, as y and z are."""
    y: Number
    z: Number
    type: Literal["look_at"] = field(default="look_at", repr=False)

    @property
    def slot(self) -> str:
        """The gimbal."""
        return "gimbal"

    @property
    def place(self) -> Place:
        """Point of interest: a waypoint has one."""
        return self.x, self.y, self.z

    def moved(self, place: Place) -> LookAt:
        """Look at another place."""
        return LookAt(*place)


@shared_pickle
@dataclass(frozen=True, slots=True)
class SetLens(Action):
    """Set the camera's zoom and focus on the way to the waypoint; None leaves one as it is."""

    purpose: ClassVar[str] = "sets the camera's lens"
    zoom: Percent | None = None
    """0 sees most."""
    focus: Percent | None = None
    """0 is near, 100 far."""
    type: Literal["set_lens"] = field(default="set_lens", repr=False)


@shared_pickle
@dataclass(frozen=True, slots=True)
class RecordVideo(Action):
    """Begin or end the camera's recording on its own card, at the waypoint after the picture.

    A recording that the mission has begun ends with it.
    """

    purpose: ClassVar[str] = "begins or ends a video"
    on: Annotated[bool, StrictlyTyped()] = True
    """Whether it begins."""
    type: Literal["record_video"] = field(default="record_video", repr=False)

    def __post_init__(self) -> None:
        """Refuse what is no flag."""
        on: object = self.on
        if not isinstance(on, bool):
            raise InvalidWaypointError(f"video must be True, False or None, not {on!r}")


@shared_pickle
@dataclass(frozen=True, slots=True)
class MoveActuator(Action):
    """Have an actuator take a position at the waypoint, after picture and video."""

    purpose: ClassVar[str] = "moves actuators"
    actuator: str
    """Its id in the environment file."""
    position: str
    type: Literal["move_actuator"] = field(default="move_actuator", repr=False)

    def __post_init__(self) -> None:
        """Refuse what is no text."""
        names: tuple[object, object] = (self.actuator, self.position)
        if not all(isinstance(name, str) for name in names):
            raise InvalidWaypointError(f"actuator and position are texts, not {names!r}")

    @property
    def slot(self) -> str:
        """The actuator, which a waypoint moves once."""
        return f"actuator {self.actuator}"

    @property
    def names(self) -> tuple[str, str]:
        """The actuator and its position."""
        return self.actuator, self.position


_KINDS = (TriggerPhotos, LookAt, AimGimbal, SetLens, TakePhoto, RecordVideo, MoveActuator)


def action_kinds() -> Mapping[str, type[Action]]:
    """Classes of actions by their type in JSON, in the order in which a drone does them.

    Those of extensions are the last.
    """
    kinds: list[type[Any]] = [*_KINDS, *added("actions")]
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
    if unknown := sorted(keywords.keys() - ActionKeywords.__annotations__.keys()):
        raise InvalidWaypointError(f"a waypoint has no {', '.join(unknown)}")
    return tuple(_actions_of(keywords))


def _actions_of(given: Mapping[str, Any]) -> Iterator[Action]:
    photo = given.get("photo", False)
    if not isinstance(photo, bool):
        raise InvalidWaypointError(f"photo must be True or False, not {photo!r}")
    if photo:
        yield TakePhoto()
    triggers = given.get("trigger_distance"), given.get("trigger_interval")
    if triggers != (None, None):
        yield TriggerPhotos(*triggers)
    pitch, yaw = given.get("gimbal_pitch"), given.get("gimbal_yaw")
    if (pitch, yaw) != (None, None):
        yield AimGimbal(0.0 if pitch is None else pitch, 0.0 if yaw is None else yaw)
    place = given.get("look_at")
    if place is not None:
        if not (isinstance(place, tuple | list) and len(place) == len("xyz")):
            raise InvalidWaypointError(f"look_at must be three numbers (x, y, z), not {place!r}")
        yield LookAt(*place)
    lens = given.get("zoom"), given.get("focus")
    if lens != (None, None):
        yield SetLens(*lens)
    if (video := given.get("video")) is not None:
        yield RecordVideo(video)
    moves = given.get("actuate", ())
    pairs = tuple(moves.items()) if isinstance(moves, Mapping) else moves
    if not (isinstance(pairs, tuple | list) and all(map(_is_pair, pairs))):
        message = f'actuate is positions by actuator, {{"hook": "release"}}, not {moves!r}'
        raise InvalidWaypointError(message)
    yield from (MoveActuator(*pair) for pair in pairs)


def _is_pair(value: object) -> bool:
    return isinstance(value, tuple | list) and [type(one) for one in value] == [str, str]
