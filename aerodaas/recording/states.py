"""Vehicle states of a recording, decoded to the types of the streams."""

from __future__ import annotations

from collections.abc import Iterator

from aerodaas.messages.vehicle import VehicleState
from aerodaas.recording.reader import Recording

__all__ = ["vehicle_states"]


def vehicle_states(recording: Recording, robot: str) -> Iterator[tuple[int, VehicleState]]:
    """Iterate over a robot's states in the order of recording.

    Args:
        recording: An open recording.
        robot: Id of the robot.

    Yields:
        Mission time of publishing, nanoseconds, and the state.
    """
    for record in recording.records(schemas=("aerodaas.VehicleState",)):
        if record.labels.robot == robot:
            yield record.stamp, record.value
