"""Vehicle states of a recording, decoded to the types of the streams."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from aerodaas.geometry.frames import Vector
from aerodaas.messages.odometry import Battery, GpsFix, Odometry
from aerodaas.messages.payload import GimbalAttitude
from aerodaas.messages.vehicle import FlightEnd, Traffic, VehicleMode, VehicleState
from aerodaas.recording.reader import Recording

__all__ = ["odometry_of", "state_of", "vehicle_states"]


def vehicle_states(recording: Recording, robot: str) -> Iterator[tuple[int, VehicleState]]:
    """Iterate over a robot's states in the order of recording.

    Args:
        recording: An open recording.
        robot: Id of the robot.

    Yields:
        Mission time of publishing, nanoseconds, and the state.
    """
    for record in recording.records(schemas=("aerodaas.VehicleState",)):
        if record.value["robot"] == robot:
            yield record.stamp, state_of(record.value)


def odometry_of(value: dict[str, Any] | None) -> Odometry | None:
    """Decode odometry from its JSON without loss of precision; None for None."""
    if value is None:
        return None
    position, velocity = _vector(value["position"]), _vector(value["velocity"])
    angles = (value[name] for name in ("yaw", "roll", "pitch", "yaw_rate", "position_sigma"))
    return Odometry(position, velocity, *map(_number, angles))


def state_of(value: dict[str, Any]) -> VehicleState:
    """Decode a state from its JSON, an `aerodaas.VehicleState`, without loss of precision."""
    odometry = odometry_of(value["odometry"])
    assert odometry is not None  # noqa: S101 - never null
    battery, gps, ended = value["battery"], value.get("gps"), value.get("ended")
    gimbal = value.get("gimbal")
    return VehicleState(
        value["stamp"],
        odometry,
        Battery(*(_number(battery[name]) for name in ("fraction", "voltage", "current"))),
        VehicleMode(value["mode"]),
        value["armed"],
        GpsFix(**{name: _number(part) for name, part in gps.items()}) if gps else None,
        odometry_of(value.get("truth")),
        tuple(value["faults"]),
        dict(value["extra"]),
        FlightEnd(ended) if ended else None,
        gimbal=_attitude_of(gimbal) if gimbal else None,
        zoom=value.get("zoom"),
        traffic=tuple(map(_traffic_of, value.get("traffic", ()))),
        below=value.get("below"),
        actuators=dict(value.get("actuators", {})),
    )


def _attitude_of(value: dict[str, Any]) -> GimbalAttitude:
    angles = (_number(value[name]) for name in ("pitch", "yaw", "roll"))
    return GimbalAttitude(value["stamp"], *angles)


def _traffic_of(value: dict[str, Any]) -> Traffic:
    place, velocity = _vector(value["position"]), _vector(value["velocity"])
    return Traffic(value["address"], value["callsign"], place, velocity, _number(value["age"]))


def _vector(value: dict[str, float | None]) -> Vector:
    return np.array([_number(value[axis]) for axis in "xyz"], dtype=np.float64)


def _number(value: float | None) -> Any:  # noqa: ANN401 - an int stays one
    """Restore NaN from null, as which non-finite numbers are written to JSON."""
    return math.nan if value is None else value
