"""Fleets for the monitor: simulated drones, and one whose connecting never ends."""

from __future__ import annotations

import time
from typing import Any

HANGING = "scripted_fleet:HangingVehicle"


def fleet_of(*names: str, **changes: object) -> dict[str, Any]:
    """An environment file of drones with a camera; `changes` are of each one."""
    camera = {"id": "cam", "type": "camera"}
    robots = [
        {"id": name, "start": [10.0 * east, 0.0, 0.0], "sensors": [camera], **changes}
        for east, name in enumerate(names)
    ]
    return {"name": "campus", "robots": robots, "simulation": {"world": "empty"}}


class HangingVehicle:
    """Implements as much of `Vehicle` as it takes to hang."""

    def __init__(self, robot: Any, environment: Any) -> None:  # noqa: ANN401
        """Take whatever is given."""

    def connect(self, timeout: float = 10.0) -> None:  # noqa: ARG002
        """Hang."""
        time.sleep(3600.0)
