"""Terminal output of a flight at a provider."""

from __future__ import annotations

import threading
import time
from collections import Counter
from dataclasses import replace

from aerodaas.clock import seconds
from aerodaas.messages.mission import GROUNDED, RobotStatus
from aerodaas.protocol.schemas import MissionOut, MissionPhase
from aerodaas.terminal.live import FlightDisplay
from aerodaas.terminal.panels import Snapshot

__all__ = ["ProvidedView", "phase_text"]

_WORDS = {
    MissionPhase.SUBMITTED: "submitted",
    MissionPhase.REHEARSING: "being rehearsed in simulation",
    MissionPhase.AWAITING_APPROVAL: "waits for an operator's approval",
    MissionPhase.QUEUED: "waits for its drones",
}
_OLD_SECONDS = 2.5
"""Seconds without a new status after which what is shown of a drone in the air is called old."""


def phase_text(mission: MissionOut) -> str:
    """A mission's phase and its reason, in one line."""
    words = _WORDS.get(mission.phase, mission.phase.value)
    return f"{words}: {mission.reason}" if mission.reason and mission.reason != words else words


class ProvidedView(FlightDisplay):
    """View of a mission that a provider flies, drawn as one's own flight is."""

    def __init__(self, *, shown: bool) -> None:
        """Show it, or print new alerts alone."""
        super().__init__(shown=shown)
        self._told: Counter[str] = Counter()
        self._news: dict[str, tuple[int, float]] = {}
        """Mission clock of each robot's newest status, and the monotonic moment when it came."""
        self._lock = threading.Lock()
        self._notes: list[str] = []

    def show_message(self, text: str) -> None:
        """Show a message of this side, in any thread."""
        with self._lock:
            self._notes.append(text)
        if not self.moves:
            self.say(text)

    def print_alerts(self, mission: MissionOut) -> None:
        """Print a line for each new alert, unless they are shown anyway; in any thread."""
        with self._lock:
            before, self._told = self._told, Counter(mission.alerts)
            new = self._told - before
        if not self.moves:
            for text in new.elements():
                self.say(text)

    def update(self, mission: MissionOut) -> None:
        """Show the mission's present state."""
        self.print_alerts(mission)
        if self._view is None:
            return
        stamps = [status.mission.stamp for status in mission.status.values()]
        with self._lock:
            alerts = (*mission.alerts, *self._notes)
        self._view.update(
            Snapshot(
                title=f"{mission.name} ({mission.id})",
                mission_time=seconds(max(stamps, default=0)),
                wall_time=time.monotonic() - self._began,
                robots={name: self._shown(name, one) for name, one in mission.status.items()},
                alerts=alerts,
            )
        )

    def _shown(self, name: str, status: RobotStatus) -> RobotStatus:
        """A status with its reason; or since when nothing is known of the robot.

        A provider repeats what it knows of a flight whose process hangs, and of one that is out of
        reach the newest known state is shown.
        """
        now, mission = time.monotonic(), status.mission
        last = self._news.get(name)
        if last is None or last[0] != mission.stamp:
            last = self._news[name] = mission.stamp, now
        silent = now - last[1]
        if silent <= _OLD_SECONDS or mission.state in GROUNDED:
            return status
        reason = f"no word from it for {silent:.0f} s: this is old"
        return replace(status, mission=replace(mission, reason=reason))
