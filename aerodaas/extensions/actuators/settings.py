"""What follows where an actuator fails in a mission, and when it has."""

from __future__ import annotations

from typing import Literal

from aerodaas.config.checked import Positive, Strict

__all__ = ["ActuatorMission"]


class ActuatorMission(Strict):
    """Actuators in a mission."""

    actuator_timeout: Positive = 15.0
    """Seconds that each actuator gets at a waypoint; then it has failed."""
    on_actuator_failure: Literal["continue", "pause", "return"] = "continue"
    """What follows where an actuator fails at a waypoint: the next waypoint, without the other
    actuators of this one; a pause, until somebody resumes the mission; or the way home."""
