"""A vehicle whose driver does as a test tells it, and notes what is asked of it."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from aerodaas.errors import VehicleError
from aerodaas.messages.odometry import Battery, Odometry
from aerodaas.messages.vehicle import VehicleMode, VehicleState


@dataclass
class Script:
    """What the vehicle does, and what was asked of it."""

    there: bool = True
    """Whether it can be connected."""
    mode: VehicleMode = VehicleMode.GROUNDED
    armed: bool = False
    battery: float = 0.8
    breaks: Exception | None = None
    """What `read` raises."""
    stuck: threading.Event | None = None
    """What `read` waits for, as in a driver that hangs."""
    objections: list[str] = field(default_factory=list)
    asked: list[str] = field(default_factory=list)
    sensors: list[Any] = field(default_factory=list)
    settings: dict[str, Any] = field(default_factory=dict)


SCRIPT = Script()
"""The one that is now; tests replace what is in it."""


class ScriptedVehicle:
    """Implements `Vehicle`, or as much as a monitor may call; anything else fails."""

    observing: ClassVar[dict[str, str]] = {"fence": "off"}

    def __init__(self, robot: Any, environment: Any) -> None:  # noqa: ANN401, ARG002
        SCRIPT.sensors = list(robot.sensors)
        SCRIPT.settings = dict(robot.settings)

    def __getattribute__(self, name: str) -> Any:  # noqa: ANN401
        found = super().__getattribute__(name)
        if name.startswith("_") or not callable(found):
            return found

        def noted(*given: Any) -> Any:  # noqa: ANN401
            SCRIPT.asked.append(name)
            return found(*given)

        return noted

    def connect(self, timeout: float = 10.0) -> None:  # noqa: ARG002
        """Connect if it is there."""
        if not SCRIPT.there:
            raise VehicleError("nobody answers")

    def read(self) -> VehicleState:
        """Its state as the script has it."""
        if SCRIPT.stuck is not None:
            SCRIPT.stuck.wait()
        if SCRIPT.breaks is not None:
            raise SCRIPT.breaks
        zero = np.zeros(3)
        odometry = Odometry(zero, zero, 0.0, 0.0, 0.0, 0.0)
        return VehicleState(0, odometry, Battery(SCRIPT.battery), SCRIPT.mode, SCRIPT.armed)

    def preflight(self) -> list[str]:
        """The script's objections."""
        return SCRIPT.objections

    def close(self) -> None:
        """Nothing."""
