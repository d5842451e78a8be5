"""Names of the project's internal streams, distinct from all names in applications."""

from __future__ import annotations

from aerodaas.identifiers import INTERNAL, internal

__all__ = [
    "DECISIONS",
    "alert_stream",
    "done_stream",
    "end_stream",
    "photo_stream",
    "setpoint_stream",
    "state_stream",
    "status_stream",
    "task_stream",
    "trigger_stream",
    "vitals_stream",
    "whereabouts_stream",
]

DECISIONS = f"{INTERNAL}decisions"
"""Stream of the analytics scheduler's decisions and their outcomes."""


def state_stream(robot: str) -> str:
    """Name of the stream of a robot's vehicle states."""
    return internal(robot, "state")


def status_stream(robot: str) -> str:
    """Name of the stream of a robot's mission status."""
    return internal(robot, "status")


def setpoint_stream(robot: str) -> str:
    """Name of the stream of a robot's requested and sent setpoints."""
    return internal(robot, "setpoints")


def photo_stream(robot: str) -> str:
    """Name of the stream of the pictures that a robot's own camera took."""
    return internal(robot, "photos")


def end_stream(camera: str) -> str:
    """Name of the stream on which a camera reports that it has no more images."""
    return internal(camera, "commands")


def trigger_stream(target: str, source: str) -> str:
    """Name of the stream of trigger commands to a robot or analysis.

    Args:
        target: Id of the robot or analysis that is triggered.
        source: Id of the analysis that triggers it.
    """
    return f"{internal(target, 'commands')}/{source}"


def task_stream(node: str) -> str:
    """Name of the stream of tasks for the edge executor of an analysis."""
    return internal(node, "tasks")


def done_stream(node: str) -> str:
    """Name of the stream of answers of an analysis' edge executor."""
    return internal(node, "done")


def alert_stream(actor: str) -> str:
    """Name of the stream of a part's alerts; in real time a part is an actor."""
    return f"{INTERNAL}alerts/{actor}"


def vitals_stream(actor: str) -> str:
    """Name of the stream of the vitals of a part's process."""
    return f"{INTERNAL}vitals/{actor}"


def whereabouts_stream(actor: str) -> str:
    """Name of the stream of where the drones of a drone's actor are."""
    return f"{INTERNAL}whereabouts/{actor}"
