"""Report of one robot that a drone's actor makes in each loop cycle."""

from __future__ import annotations

from array import array
from dataclasses import dataclass

from aerodaas.types.health import HealthReport
from aerodaas.types.status import MissionStatus
from aerodaas.types.vehicle import VehicleState

__all__ = ["LATENCIES_KEPT", "Latencies", "RobotReport"]

LATENCIES_KEPT = 20_000
"""A quarter of an hour's at 20 Hz, or ten minutes' of a fast camera."""


@dataclass(frozen=True)
class RobotReport:
    """Status and state of one robot at one time; made by the setpoint loop, immutable."""

    status: MissionStatus
    state: VehicleState | None
    latencies: tuple[float, ...]
    """Milliseconds from capture to command, newest last."""
    health: HealthReport | None = None
    """The list before take-off as it was gone through last."""


class Latencies:
    """The newest latencies, appended by one thread and read by others."""

    def __init__(self) -> None:
        self._values = array("d")

    def append(self, value: float) -> None:
        """Append the newest value; of the others, at least the newest `LATENCIES_KEPT` stay."""
        self._values.append(value)
        if len(self._values) > 2 * LATENCIES_KEPT:
            del self._values[:-LATENCIES_KEPT]

    def newest(self, count: int) -> tuple[float, ...]:
        """The newest `count` values, newest last."""
        return tuple(self._values[-count:]) if count > 0 else ()
