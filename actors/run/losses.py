"""Errors for lost actors: which drone is affected, and what its autopilot does now."""

from __future__ import annotations

import time

from aerodaas.errors import MissionError
from aerodaas.runtime.reports import ActorReport

__all__ = [
    "ALONE",
    "DeadError",
    "SuspensionMonitor",
    "actor_silent",
    "drone_lost",
]

ALONE = "alone"
"""Key of a drone actor's report: each vehicle's behaviour without its actor, by robot."""
_FROZEN = 5.0
"""Seconds without a heartbeat after which the drones consider the application dead."""


class DeadError(MissionError):
    """An actor's process has died."""


class SuspensionMonitor:
    """Detects suspensions of this process so long that its drones returned home."""

    def __init__(self) -> None:
        self._last = float("inf")
        self._frozen = 0.0

    @property
    def frozen(self) -> float:
        """Seconds of the last such suspension; 0 without any.

        It may have been since the last beat, in a call that waited for the very actor that ended.
        """
        self.beat()
        return self._frozen

    def beat(self) -> None:
        """Record that this process runs; to be called regularly."""
        now = time.monotonic()
        if now - self._last > _FROZEN:
            self._frozen = now - self._last
        self._last = now


def actor_silent(name: str, report: ActorReport, seconds: float) -> MissionError:
    """Error for an actor that has not answered for a while, but has not died.

    Args:
        name: Name of the actor.
        report: Its last report.
        seconds: For how long it has not answered.
    """
    hence = "its work is not done meanwhile"
    if "path" in report.values:
        hence = "what happens meanwhile may be missing in the recording"
    elif ALONE in report.values:
        hence = f"it obeys no command, take over by other means; {_behaviour(report)}"
    return MissionError(f"the actor {name} has not answered for {seconds:.0f} s: {hence}")


def drone_lost(name: str, report: ActorReport, frozen: float) -> MissionError:
    """Error for a lost drone actor.

    Args:
        name: Name of the actor.
        report: Its last report.
        frozen: Seconds for which the application did not run; 0 for none.
    """
    robots = ", ".join(name.rpartition("/")[2].split("+"))
    if frozen:
        return MissionError(
            f"{robots}: this application did not run for {frozen:.0f} s, after which a drone comes "
            "home by itself; its processes have ended"
        )
    return MissionError(f"the actor of {robots} died: {_behaviour(report)}")


def _behaviour(report: ActorReport) -> str:
    """Text of how vehicles behave without their actor."""
    alone = report.values.get(ALONE, {})
    return "; ".join(dict.fromkeys(alone.values())) or "its own failsafe is what remains"
