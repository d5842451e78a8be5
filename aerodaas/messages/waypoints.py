"""Commands for a drone: waypoints, and velocity commands with the target that they follow."""

from __future__ import annotations

import enum
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias, TypeVar

import numpy as np
from annotated_types import Ge, Gt
from typing_extensions import Unpack

from aerodaas.errors import InvalidWaypointError
from aerodaas.geometry.frames import GeodeticOrigin, Vector
from aerodaas.messages.actions import (
    LARGEST,
    Action,
    ActionKeywords,
    Actions,
    Number,
    actions_of,
    json_of_actions,
)
from aerodaas.messages.serialization.json_types import Int64
from aerodaas.messages.serialization.records import fast_pickle, shared_pickle

if TYPE_CHECKING:
    from pydantic import GetCoreSchemaHandler
    from pydantic_core import CoreSchema

__all__ = [
    "DEFAULT_PRIORITY",
    "FollowedTarget",
    "HeightDatum",
    "HeightReference",
    "NavigationItem",
    "NavigationType",
    "SchedulingType",
    "TargetState",
    "VelocityCommand",
    "Waypoint",
    "WaypointType",
]

A = TypeVar("A", bound=Action)
DEFAULT_PRIORITY = 5
"""Priority of navigation that states none; smaller is more urgent, as in the paper."""


class WaypointType(str, enum.Enum):
    """The reference of a waypoint's x, y and z."""

    RELATIVE = "relative"
    """Metres east, north and up of the place where this robot took off."""
    LOCAL = "local"
    """Metres east, north and up of the environment's home."""
    GLOBAL = "global"
    """Latitude and longitude in WGS84 degrees, altitude in metres above the ellipsoid."""
    GLOBAL_RELATIVE = "global_relative"
    """Latitude and longitude in WGS84 degrees, height in metres above the environment's home."""


class HeightReference(str, enum.Enum):
    """Reference of a waypoint's z, whatever its x and y are."""

    HOME = "home"
    """The environment's home."""
    SEA = "sea"
    """Mean sea level, as on maps and in the autopilots' altitudes; not the ellipsoid of GPS."""
    GROUND = "ground"
    """The ground beneath the waypoint, by the environment's terrain; the way there follows it."""


@dataclass(frozen=True)
class HeightDatum:
    """Heights of sea and ground where a drone flies, as far as they are known."""

    sea_level: float | None = None
    """Metres of the local frame's zero above mean sea level; None if it is not known."""
    ground: Callable[[float, float], float] | None = None
    """Local height of the ground at metres east and north, NaN where it is not known; None without
    a terrain."""


_NO_DATUM = HeightDatum()


class NavigationType(str, enum.Enum):
    """Where navigation comes from."""

    DISTANCE_DRIVEN = "distance_driven"
    """Waypoints known beforehand."""
    ANALYTICS_DRIVEN = "analytics_driven"
    """Waypoints or velocities that analytics makes in flight."""


class SchedulingType(str, enum.Enum):
    """Whether a trajectory scheduler may change the order of waypoints."""

    ORDERED = "ordered"
    UNORDERED = "unordered"


_ON_THE_GLOBE = (WaypointType.GLOBAL, WaypointType.GLOBAL_RELATIVE)


def _require_finite(owner: str, record: object, names: tuple[str, ...]) -> None:
    for name in names:
        value = getattr(record, name)
        # Almost every value; a status has hundreds of them, each time that it is read.
        if value is None or (type(value) is float and abs(value) <= LARGEST):
            continue
        if not (isinstance(value, int | float | np.floating) and abs(value) <= LARGEST):
            message = f"{owner}: {name} must be a finite number, not {value!r}; at most {LARGEST:g}"
            raise InvalidWaypointError(message)
        if isinstance(value, np.generic):
            object.__setattr__(record, name, value.item())


def _require_names(owner: str, waypoint_id: object, priority: object) -> None:
    if not isinstance(waypoint_id, str) or not waypoint_id:
        raise InvalidWaypointError(f"{owner}: an id is a text that is not empty")
    if not (isinstance(priority, int | np.integer) and abs(priority) <= LARGEST):
        message = f"{owner}: priority must be a whole number, not {priority!r}; at most {LARGEST:g}"
        raise InvalidWaypointError(message)


@shared_pickle
@dataclass(frozen=True, slots=True, init=False)
class Waypoint:
    """A place to fly to, with hover time, yaw, speed and priority.

    Raises InvalidWaypointError for numbers that are not finite or out of range.
    """

    id: str
    """Its name, which no other waypoint of the robot has."""
    x: Number
    """Metres east, or latitude in degrees for a global waypoint."""
    y: Number
    """Metres north, or longitude in degrees for a global waypoint."""
    z: Number
    """Metres up, or altitude in metres for a global waypoint; see WaypointType."""
    hover_duration: Annotated[Number, Ge(0.0)] = 0.0
    """Seconds to stay after arrival."""
    waypoint_type: WaypointType | str = WaypointType.RELATIVE
    """What x, y and z are counted from: `relative`, `local`, `global` or `global_relative`."""
    yaw: Number | None = None
    """Radians counter-clockwise from east on arrival; None keeps the direction of flight."""
    speed: Annotated[Number, Gt(0.0)] | None = None
    """m/s towards it; None takes the robot's cruise speed."""
    priority: Int64 = DEFAULT_PRIORITY
    """Smaller is more urgent; a more urgent waypoint preempts the plan."""
    deadline: Number | None = None
    """Seconds of mission time by which to arrive; None for no deadline."""
    above: HeightReference | str | None = None
    """What z is counted from: `home`, `sea` or `ground`; None: as `waypoint_type` says."""
    actions: Actions = ()
    """What is done there, or on the way there."""

    def __init__(
        self,
        id: str,  # noqa: A002 - the field's name
        x: float,
        y: float,
        z: float,
        hover_duration: float = 0.0,
        waypoint_type: WaypointType | str = WaypointType.RELATIVE,
        yaw: float | None = None,
        speed: float | None = None,
        priority: int = DEFAULT_PRIORITY,
        deadline: float | None = None,
        above: HeightReference | str | None = None,
        actions: Iterable[Action] = (),
        **keywords: Unpack[ActionKeywords],
    ) -> None:
        """Hold the fields, with the actions as such or by keywords, as `photo=True`."""
        values = (id, x, y, z, hover_duration, waypoint_type, yaw, speed, priority, deadline, above)
        for name, value in zip(_FIELDS, (*values, tuple(actions)), strict=True):
            object.__setattr__(self, name, value)
        if keywords:
            object.__setattr__(self, "actions", self._actions_by(keywords))
        self.__post_init__()

    def _actions_by(self, keywords: Mapping[str, Any]) -> tuple[Action, ...]:
        try:
            found = actions_of(keywords)
        except InvalidWaypointError as error:
            raise InvalidWaypointError(f"waypoint {self.id!r}: {error}") from None
        if found and self.actions:
            told = ", ".join(keywords)
            message = f"waypoint {self.id!r}: give it actions or {told}, not both: see with_actions"
            raise InvalidWaypointError(message)
        return found or self.actions

    @classmethod
    def __get_pydantic_core_schema__(
        cls, source: type[Waypoint], handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Schema by which pydantic reads a waypoint, and writes what is not at its default."""
        from pydantic_core import core_schema  # noqa: PLC0415 - slow to load

        schema = handler(source)
        # A status is sent often, and most of its many waypoints have little more than a place.
        schema["serialization"] = core_schema.plain_serializer_function_ser_schema(
            _given, when_used="json"
        )
        return core_schema.no_info_before_validator_function(_current_form, schema)

    def __post_init__(self) -> None:
        """Check the numbers and turn the type's name into a WaypointType."""
        owner = f"waypoint {self.id!r}"
        _require_names(owner, self.id, self.priority)
        _require_finite(owner, self, _NUMBERS)
        if type(self.waypoint_type) is not WaypointType:
            object.__setattr__(self, "waypoint_type", self._type_named(owner))
        if self.above is not None and type(self.above) is not HeightReference:
            object.__setattr__(self, "above", self._reference_named(owner))
        if self.hover_duration < 0:
            message = f"{owner}: hover_duration must not be negative, not {self.hover_duration}"
            raise InvalidWaypointError(message)
        if self.speed is not None and self.speed <= 0:
            message = f"{owner}: speed must be positive, not {self.speed}"
            raise InvalidWaypointError(message)
        self._require_on_the_globe(owner, self.x, self.y)
        if self.actions:
            self._check_actions(owner)

    def _check_actions(self, owner: str) -> None:
        taken: dict[str, Action] = {}
        for action in self.actions:
            other = taken.setdefault(action.slot, action)
            if other is not action:
                raise InvalidWaypointError(
                    f"{owner}: give it one of {other} and {action}, not both: "
                    "a second waypoint at its place may have the other"
                )
            if action.place is not None:
                self._require_on_the_globe(owner, *action.place[:2])

    def _require_on_the_globe(self, owner: str, x: float, y: float) -> None:
        north_pole, date_line = 90.0, 180.0
        if self.waypoint_type in _ON_THE_GLOBE and (abs(x) > north_pole or abs(y) > date_line):
            message = f"{owner}: ({x}, {y}) is no latitude and longitude in degrees"
            raise InvalidWaypointError(message)

    def _type_named(self, owner: str) -> WaypointType:
        try:
            return WaypointType(self.waypoint_type)
        except ValueError:
            choices = ", ".join(kind.value for kind in WaypointType)
            message = f"{owner}: waypoint_type must be one of {choices}, not {self.waypoint_type!r}"
            raise InvalidWaypointError(message) from None

    def _reference_named(self, owner: str) -> HeightReference:
        try:
            return HeightReference(str(self.above))
        except ValueError:
            choices = ", ".join(kind.value for kind in HeightReference)
            message = f"{owner}: above must be one of {choices}, not {self.above!r}"
            raise InvalidWaypointError(message) from None

    def resolve(
        self, takeoff: Vector, origin: GeodeticOrigin | None, datum: HeightDatum = _NO_DATUM
    ) -> Waypoint:
        """Convert the waypoint to the local ENU frame of the environment.

        Args:
            takeoff: Where this robot took off, ENU metres.
            origin: Geodetic home of the environment; None if it has none.
            datum: Heights of home and ground above the sea.

        Raises:
            InvalidWaypointError: For a global waypoint without `origin`, and for one above sea or
                ground where home's own height is not known.
        """
        if any(action.place is not None for action in self.actions):
            there = replace(self, actions=()).resolve(takeoff, origin, datum)
            resolved = (self._resolved(one, takeoff, origin, datum) for one in self.actions)
            return replace(there, actions=tuple(resolved))
        if self.above is not None:
            kind = self.waypoint_type
            if kind is WaypointType.GLOBAL:
                kind = WaypointType.GLOBAL_RELATIVE
            level = replace(self, z=float(takeoff[2]), waypoint_type=kind, above=None)
            place = level.resolve(takeoff, origin)
            return replace(place, z=self._local_height(place, datum))
        if self.waypoint_type is WaypointType.LOCAL:
            return self
        if self.waypoint_type is WaypointType.RELATIVE:
            x, y, z = np.array([self.x, self.y, self.z]) + takeoff
        elif origin is None:
            message = f"waypoint {self.id!r} is global, but the environment file gives no home"
            raise InvalidWaypointError(message)
        elif self.waypoint_type is WaypointType.GLOBAL:
            x, y, z = origin.to_local(self.x, self.y, self.z)
        else:
            # Height is over home's level, as barometers have it, not over its tangent plane.
            x, y, _ = origin.to_local(self.x, self.y, origin.altitude)
            z = self.z
        return replace(self, x=float(x), y=float(y), z=float(z), waypoint_type=WaypointType.LOCAL)

    def _resolved(
        self, action: Action, takeoff: Vector, origin: GeodeticOrigin | None, datum: HeightDatum
    ) -> Action:
        if action.place is None:
            return action
        x, y, z = action.place
        place = replace(self, x=x, y=y, z=z, actions=()).resolve(takeoff, origin, datum)
        return action.moved((place.x, place.y, place.z))

    def _local_height(self, place: Waypoint, datum: HeightDatum) -> float:
        """Metres over the local frame's zero, of a waypoint that says what it is counted from."""
        if self.above is HeightReference.HOME:
            return self.z
        if self.above is HeightReference.SEA:
            if datum.sea_level is None:
                raise InvalidWaypointError(
                    f"waypoint {self.id!r} is above the sea, and home's own height above it is not "
                    "known: give home.above_sea in the environment file (a map's height; GPS "
                    "counts from the ellipsoid)"
                )
            return self.z - datum.sea_level
        if datum.ground is None:
            raise InvalidWaypointError(
                f"waypoint {self.id!r} is above ground, and the environment file names no terrain"
            )
        ground = datum.ground(place.x, place.y)
        if math.isnan(ground):
            raise InvalidWaypointError(
                f"waypoint {self.id!r} is above ground that the terrain does not know"
            )
        return ground + self.z

    def action(self, kind: type[A]) -> A | None:
        """The first action of a kind; None if there is none."""
        return next((one for one in self.actions if isinstance(one, kind)), None)

    def with_actions(self, *actions: Action) -> Waypoint:
        """A copy with further actions, each in the place of one that excludes it."""
        slots = {action.slot for action in actions}
        kept = (action for action in self.actions if action.slot not in slots)
        return replace(self, actions=(*kept, *actions))

    @property
    def position(self) -> Vector:
        """x, y and z as an array of shape (3,)."""
        return np.array([self.x, self.y, self.z], dtype=np.float64)


_NUMBERS = ("x", "y", "z", "hover_duration", "yaw", "speed", "deadline")
_DEFAULTS = {field.name: field.default for field in fields(Waypoint)}
_FIELDS = tuple(_DEFAULTS)


def _given(waypoint: Waypoint) -> dict[str, Any]:
    """The fields of a waypoint that are not at their default value; its numbers are floats."""
    values = ((name, getattr(waypoint, name), default) for name, default in _DEFAULTS.items())
    given = {
        name: float(value) if name in _NUMBERS else value
        for name, value, default in values
        if value != default
    }
    if waypoint.actions:
        given["actions"] = json_of_actions(waypoint.actions)
    return given


def _current_form(value: object) -> object:
    """A waypoint's JSON, in which actions were fields of its own up to version 0.1."""
    keywords = ActionKeywords.__annotations__.keys()
    if not (isinstance(value, dict) and keywords & value.keys()):
        return value
    kept = {name: one for name, one in value.items() if name not in keywords}
    actions = actions_of({name: value[name] for name in keywords & value.keys()})
    return {**kept, "actions": (*kept.get("actions", ()), *actions)}


class TargetState(str, enum.Enum):
    """How sure a follower is of its target in one frame."""

    SURE = "sure"
    LIKELY = "likely"
    """Another one came close, and they were not told apart since: this is the likelier one."""
    UNCERTAIN = "uncertain"
    """It is not known which of those seen it is; the drone holds."""
    UNSEEN = "unseen"
    """It was not found in this frame: the drone slows, holds or searches."""


@fast_pickle
@dataclass(frozen=True, slots=True)
class FollowedTarget:
    """The target of a velocity command. Its frame is the one that the command was made from."""

    state: TargetState
    box: tuple[float, float, float, float] | None = None
    """Left, top, right, bottom in the frame's pixels; None where it is not known."""
    track_id: Int64 | None = None
    """Of the follower's own tracker."""


@fast_pickle
@dataclass(frozen=True, slots=True)
class VelocityCommand:
    """A velocity asked for by analytics, in the level body frame (FLU).

    It is valid for `valid_for` seconds from arrival at the drone; after that the drone holds.
    Raises InvalidWaypointError for numbers that are not finite.
    """

    forward: float = 0.0
    """m/s."""
    left: float = 0.0
    """m/s."""
    up: float = 0.0
    """m/s."""
    yaw_rate: float = 0.0
    """rad/s, counter-clockwise."""
    priority: Int64 = DEFAULT_PRIORITY
    valid_for: float = 0.5
    """Seconds."""
    evasive: bool = False
    """Whether it gives way to a person: it takes effect at once, without a ramp of the setpoints.
    All boundaries hold."""
    target: FollowedTarget | None = None
    """What it follows; for people who look on, not for the drone."""

    def __post_init__(self) -> None:
        """Refuse numbers that are not finite and a validity that is not positive."""
        names = ("forward", "left", "up", "yaw_rate", "valid_for")
        _require_finite("velocity command", self, names)
        if self.valid_for <= 0:
            message = f"velocity command: valid_for must be positive, not {self.valid_for}"
            raise InvalidWaypointError(message)

    @property
    def velocity(self) -> Vector:
        """Forward, left and up as an array of shape (3,), m/s."""
        return np.array([self.forward, self.left, self.up], dtype=np.float64)


NavigationItem: TypeAlias = Waypoint | VelocityCommand
