"""Messages between the service and its monitor's process: one JSON object a line."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field

from aerodaas.messages.health import HealthItem
from aerodaas.protocol.schemas import VehicleReport

__all__ = ["MonitorReport", "MonitorRequest", "WatchedVehicle"]


class _Line(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class MonitorRequest(_Line):
    """Vehicles that the monitor is to hold; it lets go of all others."""

    number: int
    """Counts the lines."""
    robots: frozenset[str]


class WatchedVehicle(VehicleReport):
    """One vehicle as the monitor sees it."""

    held: bool = False
    """Whether the monitor has the vehicle open, or is opening or closing it."""
    reason: str = ""
    """Why it is not connected."""
    objections: tuple[str, ...] = ()
    """Why the vehicle itself would refuse to take off now."""
    health: tuple[HealthItem, ...] = ()
    """The list before take-off."""
    wind: float | None = None
    """m/s along the ground; None if it is not known."""
    examined: float | None = None
    """Unix seconds of that list."""


class MonitorReport(_Line):
    """All vehicles as the monitor sees them."""

    number: int
    """Of the newest `MonitorRequest` that it obeys."""
    robots: dict[str, WatchedVehicle] = Field(default_factory=dict)
