"""What the log of an autopilot tells, whichever autopilot wrote it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

__all__ = ["Floats", "LogText", "Series", "Topic", "VehicleLog"]

Floats = NDArray[np.float64]

Topic = Literal[
    "battery",
    "attitude",
    "attitude setpoint",
    "velocity",
    "vibration",
    "motors",
]
"""The topics that a recording does not hold itself, and the velocity by which it is compared:

- battery: voltage (V), current (A);
- attitude and its setpoint: roll, pitch, heading (degrees; nose right of north is positive);
- velocity: east, north, up (m/s);
- vibration: x, y, z, or one of all axes (m/s²);
- motors: one each (percent of full thrust or of its PWM range).
"""


@dataclass(frozen=True, slots=True)
class Series:
    """One topic over time."""

    time: Floats
    """Seconds of the autopilot's clock since its start, shape (N,), not necessarily in order."""
    columns: Mapping[str, Floats]
    """Values by name, each of shape (N,); NaN where the autopilot had none."""


@dataclass(frozen=True, slots=True)
class LogText:
    """One message of the autopilot to people."""

    time: float
    """Seconds of the autopilot's clock."""
    text: str
    severity: str = ""
    """`error`, `warning`, …; empty where the log keeps none."""


@dataclass(frozen=True, slots=True)
class VehicleLog:
    """The main topics of a log."""

    autopilot: str
    """`ArduPilot` or `PX4`."""
    span: tuple[float, float]
    """First and last second of the autopilot's clock."""
    topics: Mapping[Topic, Series] = field(default_factory=dict)
    """Those that it holds."""
    texts: tuple[LogText, ...] = ()
    damage: str = ""
    """What of it could not be read, in words; empty for nothing."""
