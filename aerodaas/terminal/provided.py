"""Terminal output of a flight at a provider."""

from __future__ import annotations

import math
import threading
import time
from collections import Counter
from collections.abc import Mapping

import numpy as np
from rich.console import Console
from typing_extensions import Self

from aerodaas.clock import NANOSECONDS
from aerodaas.messages.mission import GROUNDED, MissionState, MissionStatus, RobotStatus
from aerodaas.messages.odometry import Battery, Odometry
from aerodaas.messages.vehicle import VehicleMode, VehicleState
from aerodaas.messages.waypoints import Waypoint
from aerodaas.protocol.schemas import MissionOut, MissionPhase, StatusOut
from aerodaas.terminal.live import MissionView
from aerodaas.terminal.progress import download_view
from aerodaas.terminal.snapshot import Snapshot

__all__ = ["ProvidedView", "download_view", "phase_text"]

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


class ProvidedView:
    """View of a mission that a provider flies, drawn as one's own flight is."""

    def __init__(self, *, shown: bool, places: Mapping[str, Waypoint] | None = None) -> None:
        """Show it, or print new alerts alone; `places` are waypoints by id, in local ENU metres."""
        self._view = MissionView() if shown else None
        self._places = places or {}
        self._errors = Console(stderr=True, highlight=False, soft_wrap=True)
        self._began = time.monotonic()
        self._told: Counter[str] = Counter()
        self._news: dict[str, tuple[float, float]] = {}
        """Mission time of each robot's newest status, and the monotonic moment when it came."""
        self._lock = threading.Lock()
        self._notes: list[str] = []

    def __enter__(self) -> Self:
        """Begin to draw."""
        if self._view is not None:
            self._view.__enter__()
        return self

    def __exit__(self, *_: object) -> None:
        """Leave the last view on the terminal."""
        if self._view is not None:
            self._view.__exit__(None, None, None)

    def show_message(self, text: str) -> None:
        """Show a message of this side, in any thread."""
        with self._lock:
            self._notes.append(text)
        if self._view is None or not self._view.live:
            self._errors.print(text, markup=False)

    def print_alerts(self, mission: MissionOut) -> None:
        """Print a line for each new alert, unless they are shown anyway; in any thread."""
        with self._lock:
            before, self._told = self._told, Counter(mission.alerts)
            new = self._told - before
        if self._view is None or not self._view.live:
            for text in new.elements():
                self._errors.print(text, markup=False)

    def update(self, mission: MissionOut) -> None:
        """Show the mission's present state."""
        self.print_alerts(mission)
        if self._view is None:
            return
        times = [status.time for status in mission.status.values()]
        with self._lock:
            alerts = (*mission.alerts, *self._notes)
        self._view.update(
            Snapshot(
                title=f"{mission.name} ({mission.id})",
                mission_time=max(times, default=0.0),
                wall_time=time.monotonic() - self._began,
                robots={name: self._robot(name, one) for name, one in mission.status.items()},
                alerts=alerts,
            )
        )

    def _robot(self, name: str, status: StatusOut) -> RobotStatus:
        return RobotStatus(self._mission(name, status), _vehicle(status))

    def _reason(self, name: str, status: StatusOut, state: MissionState) -> str:
        """Why it is in its state; or since when nothing is known of it.

        A provider repeats what it knows of a flight whose process hangs, and of one that is out of
        reach the newest known state is shown.
        """
        now = time.monotonic()
        last = self._news.get(name)
        if last is None or last[0] != status.time:
            last = self._news[name] = status.time, now
        silent = now - last[1]
        if silent <= _OLD_SECONDS or state in GROUNDED:
            return status.reason
        return f"no word from it for {silent:.0f} s: this is old"

    def _mission(self, name: str, status: StatusOut) -> MissionStatus:
        states = {state.value: state for state in MissionState}
        state = states.get(status.state, MissionState.IDLE)
        ahead = [self._places[one] for one in status.pending if one in self._places]
        return MissionStatus(
            stamp=round(status.time * NANOSECONDS),
            state=state,
            reason=self._reason(name, status, state),
            target=self._places.get(status.target or ""),
            pending=tuple(ahead),
            visited=tuple(status.visited),
            given_up=tuple(status.given_up),
            distance=status.distance,
            faults=tuple(status.faults),
            visits=status.waypoints_visited,
            waypoint_counts=(status.waypoints_visited, status.waypoints_known),
            outlook=status.outlook,
        )


def _vehicle(status: StatusOut) -> VehicleState | None:
    if status.position is None:
        return None
    stamp = round(status.time * NANOSECONDS)
    charge = math.nan if status.battery is None else status.battery
    yaw = math.nan if status.yaw is None else status.yaw
    odometry = Odometry(_vector(status.position), _vector(status.velocity), yaw)
    return VehicleState(stamp, odometry, Battery(charge), VehicleMode.GUIDED, armed=True)


def _vector(axes: list[float | None] | None) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    return np.array([math.nan if one is None else one for one in axes or [None] * 3])
