"""Journal of what was changed on a vehicle and is to be put back, which outlives this process."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from aerodaas.config.private_file import write_private
from aerodaas.drivers.mavlink.microservices.plans import MissionItem
from aerodaas.types.errors import VehicleError

__all__ = ["Changes", "Journal", "ParameterChange"]


class ParameterChange(NamedTuple):
    """A parameter that was set."""

    before: float
    set_to: float


class _Item(NamedTuple):
    """A mission's item; a parameter that is not a number is null in the file."""

    command: int
    values: tuple[float | None, float | None, float | None, float | None]
    x: int
    y: int
    z: float
    frame: int


class Changes(BaseModel):
    """What was changed on one vehicle."""

    model_config = ConfigDict(extra="forbid")

    parameters: dict[str, ParameterChange] = Field(default_factory=dict)
    """In the order in which they were set."""
    mission: list[_Item] | None = None
    """The mission that it held before; None: it was left alone."""

    def keep_mission(self, items: Sequence[MissionItem]) -> None:
        """Remember the vehicle's own mission."""
        self.mission = [
            _Item(one.command, _nullable(one.values), one.x, one.y, one.z, one.frame)
            for one in items
        ]

    def mission_items(self) -> list[MissionItem]:
        """The vehicle's own mission."""
        return [
            MissionItem(one.command, _numbers(one.values), one.x, one.y, one.z, one.frame)
            for one in self.mission or ()
        ]


class Journal:
    """The journal of one vehicle, a file that only its owner can read."""

    def __init__(self, vehicle: str) -> None:
        """Open nothing; `vehicle` names the vehicle and nothing else."""
        self.path = _state_folder() / "aerodaas" / "vehicles" / f"{vehicle}.json"

    def read(self) -> Changes | None:
        """What is still to be put back; None if nothing. Raises VehicleError."""
        try:
            content = self.path.read_text(encoding="utf-8")
        except FileNotFoundError:
            return None
        except (OSError, UnicodeDecodeError) as error:
            raise VehicleError(f"cannot read {self.path}: {error}") from None
        try:
            return Changes.model_validate(json.loads(content))
        except (ValueError, ValidationError, RecursionError):
            raise VehicleError(
                f"{self.path} should say what was changed on this vehicle, and cannot be read: "
                "compare its parameters with your own, then remove the file"
            ) from None

    def write(self, changes: Changes) -> None:
        """Replace it; raises VehicleError."""
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            write_private(self.path, changes.model_dump_json(indent=1))
        except OSError as error:
            raise VehicleError(
                f"cannot keep in {self.path} what is changed on the vehicle, so nothing is: "
                f"{error}; name a folder that can be written by XDG_STATE_HOME"
            ) from None

    def clear(self) -> None:
        """Remove it: everything was put back."""
        self.path.unlink(missing_ok=True)


def _state_folder() -> Path:
    """The folder of the XDG base directory specification."""
    named = os.environ.get("XDG_STATE_HOME", "")
    return Path(named) if Path(named).is_absolute() else Path.home() / ".local" / "state"


def _nullable(
    values: tuple[float, float, float, float],
) -> tuple[float | None, float | None, float | None, float | None]:
    first, second, third, fourth = (one if math.isfinite(one) else None for one in values)
    return first, second, third, fourth


def _numbers(
    values: tuple[float | None, float | None, float | None, float | None],
) -> tuple[float, float, float, float]:
    first, second, third, fourth = (math.nan if one is None else one for one in values)
    return first, second, third, fourth
