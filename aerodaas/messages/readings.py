"""Readings of monitoring, and alerts for the operator."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from aerodaas.messages.frames import Header
from aerodaas.messages.serialization.json_types import Int64, Real
from aerodaas.messages.serialization.records import fast_pickle

__all__ = ["Alert", "Readings"]


@fast_pickle
@dataclass(frozen=True, slots=True)
class Alert:
    """An alert for the operator: raised by monitoring, emergencies, the watchdogs."""

    header: Header
    kind: str
    """Short machine-readable name, such as `battery_low`."""
    text: str
    """One sentence for a person."""
    values: dict[str, Any] = field(default_factory=dict)
    """Figures behind it, by name, in SI units."""


@fast_pickle
@dataclass(frozen=True, slots=True)
class Readings:
    """Readings of monitoring by name, in SI units; a compound one is `gps.latitude` and so on.

    `state` is the index of the mission's state in `MissionState`.
    """

    stamp: Int64
    """Mission clock, nanoseconds."""
    values: dict[str, Real]
