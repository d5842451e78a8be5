"""Scenario files: what stands, walks and drives in a simulated world.

Lengths are metres in the local ENU frame, speeds m/s, times seconds of the mission clock, angles
degrees (people write these files). What a scenario leaves open, such as colours, the sun and the
places of scattered trees, is drawn from the seed.
"""

from __future__ import annotations

import itertools
import json
from pathlib import Path
from typing import Annotated, Literal, TypeAlias

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator
from typing_extensions import Self

from aerodaas.types.errors import ConfigError

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
    """A rest on the way."""

    at: Annotated[float, Field(ge=0)]
    """Metres from the first point."""
    seconds: Length


class Motion(_Strict):
    """A walk or drive along a path, its corners rounded."""

    points: list[Place] = Field(min_length=2)
    speed: Length = 1.0
    variation: Annotated[float, Field(ge=0, lt=1)] = 0.1
    """Share by which the speed swings, with a phase drawn from the seed."""
    start: Annotated[float, Field(ge=0)] = 0.0
    """Seconds of waiting at the first point."""
    end: Literal["stop", "loop", "vanish"] = "stop"
    """At the last point: stay there, go on to the first one, or be gone."""
    corner: Annotated[float, Field(ge=0)] = 1.0
    """How far before and after a point its corner is rounded."""
    pauses: list[Pause] = Field(default_factory=list)
    jitter: Annotated[float, Field(ge=0, le=100)] = 0.0
    """Metres east and north by which the seed may displace each point but the first, at most."""

    @model_validator(mode="after")
    def _moves(self) -> Self:
        if any(here == there for here, there in itertools.pairwise(self.points)):
            raise ValueError("two points in a row are the same place")
        return self


class Gesture(_Strict):
    """What a person does with the body from `start` seconds on, for `duration` seconds."""

    kind: Literal["hand_raised", "fallen"]
    start: Annotated[float, Field(ge=0)]
    duration: Length = 1_000.0
    forward: bool = False
    """Who falls falls on the face, not on the back."""
    jitter: Annotated[float, Field(ge=0, le=1_000)] = 0.0
    """Seconds by which the seed may shift the start, at most."""


class _Placed(_Strict):
    id: Name
    at: Place = (0.0, 0.0)
    yaw: Finite | None = None
    """Degrees counter-clockwise from east; None: drawn from the seed."""
    jitter: Annotated[float, Field(ge=0, le=100)] = 0.0
    """Metres east and north by which the seed may displace it, at most."""


class Tree(_Placed):
    """A broad-leaved tree."""

    kind: Literal["tree"]
    height: Length | None = None


class Trees(_Strict):
    """Trees scattered over an area, clear of everything else in the scenario."""

    kind: Literal["trees"]
    id: Name
    count: Annotated[int, Field(ge=1, le=500)]
    area: tuple[Finite, Finite, Finite, Finite]
    """West, south, east and north edge."""
    clear: tuple[Finite, Finite, Finite, Finite] | None = None
    """An area within it that is kept free, edges likewise."""
    height: tuple[Length, Length] = (4.0, 9.0)
    """Smallest and greatest."""


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
    """A hazard vest; `any` lets the seed choose its colour."""
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
    """At the foot."""


EntitySpec: TypeAlias = Annotated[
    Tree | Trees | Building | CropRows | Road | Rubble | Fence | Person | Car | Tower,
    Field(discriminator="kind"),
]


class Ground(_Strict):
    """What the flat ground is covered with."""

    surface: Literal["grass", "soil", "asphalt"] = "grass"


class Sky(_Strict):
    """Sun and haze; what is None is drawn from the seed."""

    sun_azimuth: Finite | None = None
    """Degrees counter-clockwise from east."""
    sun_elevation: Annotated[float, Field(ge=10, le=90)] | None = None
    clouds: Annotated[float, Field(ge=0, le=1)] | None = None
    """Cover, 0 to 1."""


class Scenario(_Strict):
    """A whole scenario file."""

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
    """Names of the scenarios that ship with the project."""
    return sorted(file.stem for file in _WORLDS.glob("*.json"))


def load_scenario(world: str) -> Scenario:
    """Load the scenario that ships under this name or lies at this path.

    Raises ConfigError that names the file and the place in it.
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
