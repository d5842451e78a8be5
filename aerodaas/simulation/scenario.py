"""Scenario files: static and moving objects of a simulated world.

Lengths are metres in the local ENU frame, speeds m/s, times seconds of mission time, angles
degrees (these files are written by hand). Values that a scenario leaves open, such as colours,
the sun and the positions of scattered trees, are drawn from the seed.
"""

from __future__ import annotations

import itertools
import json
from pathlib import Path
from typing import Annotated, Literal, TypeAlias

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator
from typing_extensions import Self

from aerodaas.errors import ConfigError

__all__ = [
    "Building",
    "Car",
    "CropRows",
    "EntitySpec",
    "Fence",
    "Gesture",
    "Ground",
    "Motion",
    "Pause",
    "Person",
    "Road",
    "Rubble",
    "Scenario",
    "Sky",
    "Tower",
    "Tree",
    "Trees",
    "load_scenario",
    "scenario_names",
]

_WORLDS = Path(__file__).parent / "worlds"

Finite = Annotated[float, Field(allow_inf_nan=False, ge=-10_000, le=10_000)]
Length = Annotated[float, Field(gt=0, le=2_000)]
Place = tuple[Finite, Finite]
Name = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_\-]*$", max_length=64)]
Colour = tuple[
    Annotated[float, Field(ge=0, le=1)],
    Annotated[float, Field(ge=0, le=1)],
    Annotated[float, Field(ge=0, le=1)],
]
"""Red, green and blue, 0 to 1."""


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Pause(_Strict):
    """A pause along a path."""

    at: Annotated[float, Field(ge=0)]
    """Distance from the first point, metres."""
    seconds: Length


class Motion(_Strict):
    """Motion along a path with rounded corners, of a person or car."""

    points: list[Place] = Field(min_length=2)
    speed: Length = 1.0
    variation: Annotated[float, Field(ge=0, lt=1)] = 0.1
    """Relative amplitude of the speed's oscillation, with a phase drawn from the seed."""
    start: Annotated[float, Field(ge=0)] = 0.0
    """Waiting time at the first point, seconds."""
    end: Literal["stop", "loop", "vanish"] = "stop"
    """Action at the last point: stay there, continue to the first one, or disappear."""
    corner: Annotated[float, Field(ge=0)] = 1.0
    """Distance before and after a point over which its corner is rounded, metres."""
    pauses: list[Pause] = Field(default_factory=list)
    jitter: Annotated[float, Field(ge=0, le=100)] = 0.0
    """Greatest random displacement of each point except the first, metres east and north."""

    @model_validator(mode="after")
    def _moves(self) -> Self:
        if any(here == there for here, there in itertools.pairwise(self.points)):
            raise ValueError("two points in a row are the same place")
        return self


class Gesture(_Strict):
    """A person's gesture from `start` seconds on, for `duration` seconds."""

    kind: Literal["hand_raised", "fallen"]
    start: Annotated[float, Field(ge=0)]
    duration: Length = 1_000.0
    forward: bool = False
    """Whether a person falls forward, on the face, instead of on the back."""
    jitter: Annotated[float, Field(ge=0, le=1_000)] = 0.0
    """Greatest random shift of the start, seconds."""


class _Placed(_Strict):
    id: Name
    at: Place = (0.0, 0.0)
    yaw: Finite | None = None
    """Degrees counter-clockwise from east; by default drawn from the seed."""
    jitter: Annotated[float, Field(ge=0, le=100)] = 0.0
    """Greatest random displacement, metres east and north."""


class Tree(_Placed):
    """A broad-leaved tree."""

    kind: Literal["tree"]
    height: Length | None = None


class Trees(_Strict):
    """Trees scattered over an area, clear of all other objects of the scenario."""

    kind: Literal["trees"]
    id: Name
    count: Annotated[int, Field(ge=1, le=500)]
    area: tuple[Finite, Finite, Finite, Finite]
    """West, south, east and north edge."""
    clear: tuple[Finite, Finite, Finite, Finite] | None = None
    """An area within it that is kept free: west, south, east and north edge."""
    height: tuple[Length, Length] = (4.0, 9.0)
    """Least and greatest height."""


class Building(_Placed):
    """A house, barn or hall."""

    kind: Literal["building"]
    size: tuple[Length, Length, Length] = (10.0, 7.0, 4.0)
    """Length along its yaw, width, height of the walls."""
    roof: Literal["gable", "flat"] = "gable"
    walls: Literal["brick", "plaster", "wood"] | None = None


class CropRows(_Strict):
    """A field of crop rows that run from west to east."""

    kind: Literal["crop_rows"]
    id: Name
    area: tuple[Finite, Finite, Finite, Finite]
    """West, south, east and north edge."""
    spacing: Annotated[float, Field(ge=0.2, le=10)] = 0.8
    height: Annotated[float, Field(ge=0.05, le=3)] = 0.35


class Road(_Strict):
    """A path or road."""

    kind: Literal["road"]
    id: Name
    points: list[Place] = Field(min_length=2)
    width: Length = 2.0
    surface: Literal["asphalt", "gravel", "soil"] = "asphalt"


class Rubble(_Placed):
    """A heap of broken masonry."""

    kind: Literal["rubble"]
    size: tuple[Length, Length, Length] = (4.0, 3.0, 0.9)
    """Length along its yaw, width, height of the heap."""


class Fence(_Strict):
    """A wooden fence."""

    kind: Literal["fence"]
    id: Name
    points: list[Place] = Field(min_length=2)
    height: Length = 1.1


class Person(_Placed):
    """A person, standing or walking."""

    kind: Literal["person"]
    height: Annotated[float, Field(ge=1.0, le=2.2)] | None = None
    vest: Literal["none", "any", "yellow", "lime", "orange", "pink"] = "none"
    """Colour of a hazard vest; with `any`, it is drawn from the seed."""
    clothes: Annotated[int, Field(ge=0)] | None = None
    """Number that skin, hair and clothes are drawn from, the same for the same; by default they are
    drawn from the seed."""
    motion: Motion | None = None
    gestures: list[Gesture] = Field(default_factory=list)


class Car(_Placed):
    """A car, parked or driving."""

    kind: Literal["car"]
    colour: Colour | None = None
    motion: Motion | None = None


class Tower(_Placed):
    """A lattice radio tower."""

    kind: Literal["tower"]
    height: Length = 35.0
    width: Length = 3.0
    """Width at the foot."""


EntitySpec: TypeAlias = Annotated[
    Tree | Trees | Building | CropRows | Road | Rubble | Fence | Person | Car | Tower,
    Field(discriminator="kind"),
]


class Ground(_Strict):
    """Surface of the flat ground."""

    surface: Literal["grass", "soil", "asphalt"] = "grass"


class Sky(_Strict):
    """Sun and clouds; values of None are drawn from the seed."""

    sun_azimuth: Finite | None = None
    """Degrees counter-clockwise from east."""
    sun_elevation: Annotated[float, Field(ge=10, le=90)] | None = None
    clouds: Annotated[float, Field(ge=0, le=1)] | None = None
    """Cloud cover, 0 to 1."""


class Scenario(_Strict):
    """Content of a scenario file."""

    name: str
    description: str = ""
    ground: Ground = Ground()
    sky: Sky = Sky()
    entities: list[EntitySpec] = Field(default_factory=list)

    @model_validator(mode="after")
    def _unique_ids(self) -> Self:
        ids = [entity.id for entity in self.entities]
        twice = sorted({name for name in ids if ids.count(name) > 1})
        if twice:
            raise ValueError(f"more than one entity is called {', '.join(twice)}")
        return self


def scenario_names() -> list[str]:
    """Names of the shipped scenarios."""
    return sorted(file.stem for file in _WORLDS.glob("*.json"))


def load_scenario(world: str) -> Scenario:
    """Load a shipped scenario by name, or a scenario file by path.

    Raises ConfigError that names the file and the location in it.
    """
    source = _WORLDS / f"{world}.json" if world in scenario_names() else Path(world)
    if not source.is_file():
        known = ", ".join(scenario_names())
        raise ConfigError(
            f"no world is called {world!r} and no scenario file lies there; known: {known}"
        )
    try:
        return Scenario.model_validate(json.loads(source.read_text(encoding="utf-8")))
    except OSError as error:
        raise ConfigError(f"cannot read the scenario file {world}: {error.strerror}") from None
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"scenario file {world} is not JSON: {error}") from None
    except ValidationError as error:
        problems = "; ".join(
            f"{'.'.join(str(part) for part in problem['loc']) or 'file'}: {problem['msg']}"
            for problem in error.errors()
        )
        raise ConfigError(f"scenario file {world}: {problems}") from None
