"""Names of the streams that belong to a robot or to an analysis that commands one."""

from __future__ import annotations

__all__ = ["reply_stream", "request_stream", "state_stream", "status_stream"]


def state_stream(robot: str) -> str:
    """Name of the stream of a robot's vehicle states."""
    return f"{robot}/state"


def status_stream(robot: str) -> str:
    """Name of the stream of a robot's mission status."""
    return f"{robot}/status"


def request_stream(node: str) -> str:
    """Name of the stream of an analysis' commands to the mission."""
    return f"{node}/requests"


def reply_stream(node: str) -> str:
    """Name of the stream of the mission's answers to an analysis."""
    return f"{node}/replies"
