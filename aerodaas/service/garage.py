"""The garage: what is known of each drone, between its missions as well."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterable, Mapping
from dataclasses import replace

from aerodaas.analytics.remote.schemas import StatusOut
from aerodaas.config.model import EnvironmentConfig
from aerodaas.service.errors import RefusedError
from aerodaas.service.store import RobotState, Store

__all__ = ["Garage"]

_WRITE_SECONDS = 5.0
"""Seconds between two rows of one robot: its charge and place of a moment are not worth more."""


class Garage:
    """Charge, place and fitness of the fleet's drones; safe in any thread."""

    def __init__(self, config: EnvironmentConfig, store: Store) -> None:
        """Take up what the database has."""
        self._store = store
        self._lock = threading.Lock()
        self._states: dict[str, RobotState] = {}
        self._written: dict[str, float] = {}
        for robot in config.robots:
            self._states[robot.id] = store.robots.get(robot.id) or RobotState(robot.id)

    @property
    def states(self) -> dict[str, RobotState]:
        """State of each robot by id."""
        with self._lock:
            return dict(self._states)

    def note(self, status: Mapping[str, StatusOut], *, now: bool = False) -> None:
        """Take over where drones are and what charge they have; `now` writes it down at once."""
        for name, one in status.items():
            known = one.position is not None and None not in one.position
            place = tuple(axis for axis in one.position or () if axis is not None)
            with self._lock:
                before = self._states.get(name)
                if before is None:
                    continue
                state = self._states[name] = replace(
                    before,
                    battery=before.battery if one.battery is None else one.battery,
                    position=(place[0], place[1], place[2]) if known else before.position,
                    heard=time.time(),
                )
                moment = time.monotonic()
                due = now or moment - self._written.get(name, 0.0) >= _WRITE_SECONDS
                if due:
                    self._written[name] = moment
            if due:
                self._store.robots.put(state)

    def take_out(self, robots: Iterable[str]) -> None:
        """Take drones out of service until `enable`."""
        for name in robots:
            self._change(name, enabled=False)

    def enable(self, robot: str, *, enabled: bool) -> RobotState:
        """Put a drone into service or out of it; raises RefusedError if there is none."""
        if robot not in self._states:
            raise RefusedError(404, f"there is no robot {robot}")
        return self._change(robot, enabled=enabled)

    def require_enabled(self, robots: Iterable[str]) -> None:
        """Raise RefusedError for a drone that is out of service."""
        out = [name for name in robots if not self._states[name].enabled]
        if out:
            raise RefusedError(
                409, f"{', '.join(out)}: out of service until an operator has looked"
            )

    def _change(self, robot: str, *, enabled: bool) -> RobotState:
        with self._lock:
            state = self._states[robot] = replace(self._states[robot], enabled=enabled)
        self._store.robots.put(state)
        return state
