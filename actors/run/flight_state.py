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

    @property
    def alerts(self) -> list[Alert]:
        """The newest alerts of all actors, oldest first."""
        alerts = [alert for report in self.reports.values() for alert in report.alerts]
        return sorted(alerts, key=lambda alert: alert.header.stamp)
