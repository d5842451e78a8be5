"""Changes on a vehicle that are to be restored, in a file that outlives this process."""

from __future__ import annotations

from typing import NamedTuple

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from aerodaas.drivers.mavlink.microservices.plans import MissionItem
from aerodaas.errors import VehicleError
from aerodaas.files.private_file import write_private
from aerodaas.files.user_folders import state_folder

__all__ = ["Changes", "ParameterBackup", "ParameterChange"]


class ParameterChange(NamedTuple):
    """A parameter that was set."""

    before: float
    set_to: float


class Changes(BaseModel):
    """Changes of parameters and mission on one vehicle."""

    # What an item leaves open is not a number, which JSON has no word for.
    model_config = ConfigDict(extra="forbid", ser_json_inf_nan="strings")

    parameters: dict[str, ParameterChange] = Field(default_factory=dict)
    """In the order in which they were set."""
    mission: list[MissionItem] | None = None
    """The mission that it held before; None: it was left alone."""


class ParameterBackup:
    """Backup of one vehicle, a file that only its owner can read."""

    def __init__(self, vehicle: str) -> None:
        """Open nothing; `vehicle` names the vehicle and nothing else."""
        self.path = state_folder() / "vehicles" / f"{vehicle}.json"

    def read(self) -> Changes | None:
        """Changes that are still to be restored; None if there are none. Raises VehicleError."""
        try:
            content = self.path.read_text(encoding="utf-8")
        except FileNotFoundError:
            return None
        except (OSError, UnicodeDecodeError) as error:
            raise VehicleError(f"cannot read {self.path}: {error}") from None
        try:
            return Changes.model_validate_json(content)
        except ValidationError:
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
