"""Report of one robot that a drone's actor makes in each loop cycle."""

from __future__ import annotations

from array import array
from dataclasses import dataclass

from aerodaas.types.status import MissionStatus
from aerodaas.types.vehicle import VehicleState

__all__ = ["Latencies", "RobotReport"]


@dataclass(frozen=True)
class RobotReport:
    """Status and state of one robot at one time; made by the setpoint loop, immutable."""

    status: MissionStatus
    state: VehicleState | None
    latencies: tuple[float, ...]
    """Milliseconds from capture to command, newest last."""


class Latencies:
    """Append-only list of latencies, written by one thread and read by others."""

    def __init__(self) -> None:
        self._values = array("d")

    def append(self, value: float) -> None:
        """Append the newest value."""
        self._values.append(value)

    def newest(self, count: int) -> tuple[float, ...]:
        """The newest `count` values, newest last."""
        return tuple(self._values[-count:]) if count > 0 else ()
