"""Vehicle states of a recording, decoded to the types of the streams."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from aerodaas.messages.odometry import Odometry
from aerodaas.messages.schema import message_of
from aerodaas.messages.vehicle import VehicleState
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


def state_of(value: dict[str, Any]) -> VehicleState:
    """A state from its recorded JSON; raises MessageError for one of another form."""
    return message_of(VehicleState, value, unknown_fields="ignore")


def odometry_of(value: dict[str, Any] | None) -> Odometry | None:
    """Odometry from its recorded JSON, None for None; raises MessageError for another form."""
    return None if value is None else message_of(Odometry, value, unknown_fields="ignore")
