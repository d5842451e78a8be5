"""Immutable report of one robot, replaced by its actor each turn of the setpoint loop."""

from __future__ import annotations

from array import array
from dataclasses import dataclass

from aerodaas.types.status import MissionStatus
from aerodaas.types.vehicle import VehicleState

__all__ = ["Latencies", "RobotReport"]


@dataclass(frozen=True)
class RobotReport:
    """One robot at one moment; made by the setpoint loop, never changed afterwards."""

    status: MissionStatus
    state: VehicleState | None
    latencies: tuple[float, ...]
    """Milliseconds from capture to command, newest last."""
    loop_late: int
    """Turns of the setpoint loop that came more than half a period late."""


class Latencies:
    """Figures that one thread appends and others read; an entry is never changed."""

    def __init__(self) -> None:
        self._values = array("d")

    def append(self, value: float) -> None:
        """Add the newest."""
        self._values.append(value)

    def newest(self, count: int) -> tuple[float, ...]:
        """The newest `count`, newest last."""
        return tuple(self._values[-count:]) if count > 0 else ()
