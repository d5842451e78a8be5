"""Rehearsal: the order flown in simulation by the flight's own process, and judged."""

from __future__ import annotations

from pathlib import Path

from aerodaas.service.flights.folder import FlightFolder
from aerodaas.service.flights.order import FlightOrder
from aerodaas.service.flights.process import fly

__all__ = ["rehearse"]


def rehearse(path: Path) -> None:
    """Fly the order in the folder `path` in simulation, and write its verdict and its picture."""
    folder, order = FlightFolder(path), FlightOrder.read(FlightFolder(path).order)
    fly(path)
