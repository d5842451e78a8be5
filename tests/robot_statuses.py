"""Statuses of a drone, as a test wants them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from aerodaas.messages.mission import MissionState, MissionStatus, RobotStatus
from aerodaas.messages.odometry import Battery, Odometry
from aerodaas.messages.vehicle import VehicleMode, VehicleState

__all__ = ["robot_status"]


def robot_status(
    time: float = 3.0,
    state: MissionState = MissionState.ENROUTE,
    mode: VehicleMode = VehicleMode.GUIDED,
    *,
    battery: float = 0.9,
    position: tuple[float, float, float] = (math.nan, math.nan, math.nan),
    **mission: Any,  # noqa: ANN401 - fields of a MissionStatus
) -> RobotStatus:
    """A drone at a mission time in seconds, on its way but for the changes."""
    stamp = round(time * 1e9)
    odometry = Odometry(np.array(position), np.array([1.0, 0.0, 0.0]), 0.0)
    vehicle = VehicleState(stamp, odometry, Battery(battery), mode, armed=True)
    return RobotStatus(MissionStatus(stamp, state, **mission), vehicle)
