"""Names of the streams of the project's own, apart from all that an application can name."""

from __future__ import annotations

from aerodaas.types.identifiers import INTERNAL, internal

__all__ = [
    "ACKS",
    "DECISIONS",
    "alert_stream",
    "done_stream",
    "end_stream",
    "reply_stream",
    "request_stream",
    "setpoint_stream",
    "state_stream",
    "status_stream",
    "task_stream",
    "trigger_stream",
    "vitals_stream",
]

ACKS = f"{INTERNAL}acks"
"""Prefix of the acknowledgement streams of analyses whose results have no reader."""
DECISIONS = f"{INTERNAL}decisions"
"""Stream of the analytics scheduler's decisions and their outcomes."""


def state_stream(robot: str) -> str:
    """Name of the stream of a robot's vehicle states."""
    return internal(robot, "state")


def status_stream(robot: str) -> str:
    """Name of the stream of a robot's mission status."""
    return internal(robot, "status")


def request_stream(node: str) -> str:
    """Name of the stream of an analysis' commands to the mission."""
    return internal(node, "requests")


def reply_stream(node: str) -> str:
    """Name of the stream of the mission's answers to an analysis."""
    return internal(node, "replies")


def setpoint_stream(robot: str) -> str:
    """Name of the stream of a robot's setpoint records."""
    return internal(robot, "setpoints")


def end_stream(camera: str) -> str:
    """Name of the stream on which a camera announces its end."""
    return internal(camera, "commands")


def trigger_stream(target: str, source: str) -> str:
    """Name of the stream of commands and wake-ups from the analysis `source`."""
    return f"{internal(target, 'commands')}/{source}"


def task_stream(node: str) -> str:
    """Name of the stream on which the edge executor of an analysis gets its tasks."""
    return internal(node, "tasks")


def done_stream(node: str) -> str:
    """Name of the stream on which the edge executor of an analysis answers."""
    return internal(node, "done")


def alert_stream(actor: str) -> str:
    """Name of the stream of an actor's alerts."""
    return f"{INTERNAL}alerts/{actor}"


def vitals_stream(actor: str) -> str:
    """Name of the stream of an actor's process figures."""
    return f"{INTERNAL}vitals/{actor}"
