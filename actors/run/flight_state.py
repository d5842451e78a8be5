"""State of a run, as the application's process sees it."""

from __future__ import annotations

from dataclasses import dataclass

from aerodaas.actors.base import ActorReport
from aerodaas.actors.drone.robot_report import RobotReport
from aerodaas.types.data import Alert

__all__ = ["FlightState"]


@dataclass(frozen=True)
class FlightState:
    """State of a run at one time."""

    robots: dict[str, RobotReport]
    reports: dict[str, ActorReport]
    over: bool
    """True after every mission has ended."""
    notes: tuple[Alert, ...] = ()
    """The newest alerts of the application's own process."""

    @property
    def alerts(self) -> list[Alert]:
        """The newest alerts of all actors and of the application's process, oldest first."""
        noted = {(note.kind, note.text) for note in self.notes}
        alerts = [
            alert
            for report in self.reports.values()
            for alert in report.alerts
            # The drones' actors repeat the application's, so that they are recorded.
            if (alert.kind, alert.text) not in noted
        ]
        return sorted([*self.notes, *alerts], key=lambda alert: alert.header.stamp)
