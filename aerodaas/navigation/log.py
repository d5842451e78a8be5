"""What a mission has done and has to say: visits, refusals, alerts, distance."""

from __future__ import annotations

from dataclasses import dataclass, field

from aerodaas.data import Alert, Header

__all__ = ["MissionLog"]


@dataclass
class MissionLog:
    """The memory of one mission."""

    source: str
    """Source of the alerts' headers."""
    visited: list[str] = field(default_factory=list)
    given_up: dict[str, str] = field(default_factory=dict)
    """Reason by waypoint id."""
    distance: float = 0.0
    """Metres flown."""
    alerts: list[Alert] = field(default_factory=list)
    """Every alert of the mission, oldest first."""

    def alert(self, now: int, kind: str, text: str) -> None:
        """Tell people something."""
        header = Header(len(self.alerts), now, self.source)
        self.alerts.append(Alert(header, kind, text))

    def give_up(self, now: int, waypoint_id: str, reason: str) -> None:
        """Note that a waypoint will not be visited, and tell people."""
        self.given_up[waypoint_id] = reason
        self.alert(now, "given_up", reason)
