"""Registry of the fleet: state of each drone, between its missions as well."""

from __future__ import annotations

import contextlib
import math
import threading
import time
from collections.abc import Iterable, Mapping
from dataclasses import replace

from aerodaas.config.model import EnvironmentConfig
from aerodaas.messages.health import HealthReport
from aerodaas.messages.mission import MissionState, RobotStatus
from aerodaas.messages.vehicle import VehicleMode
from aerodaas.protocol.schemas import LinkState
from aerodaas.service.errors import RefusedError, StoreError
from aerodaas.service.monitor.reports import WatchedVehicle
from aerodaas.service.store import RobotState, Store

__all__ = ["OUT_OF_SERVICE", "FleetRegistry"]

OUT_OF_SERVICE = "out of service until an operator has looked"
_WRITE_SECONDS = 5.0
"""Seconds between two rows of one robot: its charge and place of a moment are not worth more."""
_STILL_SECONDS = 60.0
"""The same for a drone that stands, with the same charge."""
_CHARGE, _METRES = 0.01, 1.0
"""Changes of a drone that stands which are written down earlier."""
_HOME = (0.0, 0.0, 0.0)
_SILENT_SECONDS = 5.0
"""Seconds without a new status of a mission that goes on, after which its drone counts as lost."""
_OVER = {MissionState.LANDED, MissionState.ABORTED}
_DROPOUT_SECONDS = 3.0
"""Seconds for which a link may be lost before its drone counts as out of reach."""


class FleetRegistry:
    """Charge, place and fitness of the fleet's drones; safe in any thread."""

    def __init__(self, config: EnvironmentConfig, store: Store) -> None:
        """Take up what the database has."""
        self._store = store
        self._lock = threading.Lock()
        self._states: dict[str, RobotState] = {}
        self._written: dict[str, tuple[float, RobotState]] = {}
        self._return_at = {robot.id: robot.limits.battery_return for robot in config.robots}
        self._reports = {robot.id: WatchedVehicle() for robot in config.robots}
        self._told: dict[str, tuple[int, float, float]] = {}
        """Mission clock of each robot's newest status; when it came, as Unix time and by
        `time.monotonic`."""
        self._lost_at: dict[str, float] = {}
        """Since when each robot's link is lost, by `time.monotonic`."""
        self._examined_at: dict[str, float] = {}
        """When each robot's list before take-off was made, by `time.monotonic`."""
        for robot in config.robots:
            self._states[robot.id] = store.robots.get(robot.id) or RobotState(robot.id)

    @property
    def states(self) -> dict[str, RobotState]:
        """State of each robot by id."""
        with self._lock:
            return dict(self._states)

    def report(self, robot: str) -> WatchedVehicle:
        """Newest report of a robot: its link, mode and faults."""
        with self._lock:
            return self._reports[robot]

    def preflight(self, robot: str) -> HealthReport:
        """The list before take-off of a robot; raises RefusedError if there is none such."""
        if robot not in self._reports:
            raise RefusedError(404, f"there is no robot {robot}")
        with self._lock:
            report, made = self._reports[robot], self._examined_at.get(robot)
        age = None if report.examined is None or made is None else time.monotonic() - made
        return HealthReport(report.health, age)

    def record_status(
        self,
        status: Mapping[str, RobotStatus],
        *,
        ended: float | None = None,
    ) -> None:
        """Take over what a mission tells of its drones.

        The same status again is no report: who told it may hang, and with it what keeps the drone.

        Args:
            status: Newest status by robot.
            ended: Unix seconds of the end of its flight, of which this is the last status, to be
                written down at once; None while it goes on.
        """
        for name, one in status.items():
            if name not in self._reports:
                continue
            now = time.monotonic()
            mission, mode = one.mission, "" if one.vehicle is None else one.vehicle.mode
            if self._told.get(name, (None,))[0] != mission.stamp or ended is not None:
                self._told[name] = mission.stamp, time.time() if ended is None else ended, now
            _, told, came = self._told[name]
            silent = now - came > _SILENT_SECONDS and mission.state not in _OVER
            lost = silent or mode == VehicleMode.LOST
            link = LinkState.LOST if lost else LinkState.MISSION
            before = self.report(name)
            faults = [f"its mission has told nothing since {_moment(told)}"]
            report = WatchedVehicle(
                link=link,
                since=before.since if before.link is link else told,
                heard=before.heard if lost else told,
                battery=one.charge,
                position=one.place,
                mode=mode,
                faults=faults if silent else list(mission.faults),
            )
            least = _WRITE_SECONDS if ended is None else 0.0
            self._record(name, report, heard=report.heard, least=least)

    def record_reports(self, report: Mapping[str, WatchedVehicle]) -> None:
        """Take over what the monitor tells of the drones on the ground; without any, it is gone."""
        for name, before in list(self._reports.items()):
            one = report.get(name, WatchedVehicle(reason="the service looks for it again"))
            if one.link is LinkState.UNWATCHED and before.link is LinkState.MISSION:
                continue
            if one.heard is None and one.link is LinkState.LOST:
                one = one.model_copy(update={"since": self._states[name].heard or one.since})
            moved = self._moved(name, one)
            # While the database fails, the newest state is kept here, and written later.
            with contextlib.suppress(StoreError):
                self._record(
                    name, one, heard=one.heard, least=_WRITE_SECONDS if moved else _STILL_SECONDS
                )

    def set_link(self, robots: Iterable[str], link: LinkState) -> None:
        """Note that drones are a mission's from now on, or nobody's.

        Args:
            robots: Ids of the drones.
            link: State of their link.
        """
        with self._lock:
            for name in robots:
                self._reports[name] = WatchedVehicle(link=link, since=time.time())
                self._told.pop(name, None)

    def objection(self, robot: str) -> str:
        """Why a drone on the ground can be neither leased nor flown now; empty if it can."""
        with self._lock:
            enabled, report = self._states[robot].enabled, self._reports[robot]
            lost_at = self._lost_at.get(robot, math.inf)
        if not enabled:
            return OUT_OF_SERVICE
        if report.link is LinkState.LOST and time.monotonic() - lost_at > _DROPOUT_SECONDS:
            return f"not reachable since {_moment(report.since or 0.0)}: {report.reason}"
        if report.link is not LinkState.CONNECTED:
            return ""
        least = self._return_at[robot]
        if report.battery is not None and report.battery <= least:
            charge = f"its battery holds {report.battery:.0%}"
            return f"{charge}, and it comes home at {least:.0%}: charge it"
        return "; ".join(report.objections)

    def obstacle(self, robot: str) -> str:
        """Why a mission cannot have a drone from the monitor yet; empty if it can."""
        with self._lock:
            link = self._reports[robot].link
        known = link is LinkState.CONNECTED
        return self.objection(robot) or ("" if known else "the service connects to it")

    def take_out_of_service(self, robots: Iterable[str]) -> None:
        """Take drones out of service until `enable`."""
        for name in robots:
            self._change(name, enabled=False)

    def enable(self, robot: str, *, enabled: bool) -> RobotState:
        """Put a drone into service or out of it.

        Args:
            robot: Id of the drone.
            enabled: Whether it is in service.

        Raises:
            RefusedError: If there is no such drone.
        """
        if robot not in self._states:
            raise RefusedError(404, f"there is no robot {robot}")
        return self._change(robot, enabled=enabled)

    def require_fit(self, robots: Iterable[str]) -> None:
        """Raise RefusedError for a drone that cannot be flown now."""
        for name in robots:
            if objection := self.objection(name):
                raise RefusedError(409, f"{name}: {objection}")

    def _moved(self, name: str, report: WatchedVehicle) -> bool:
        """Whether a drone's charge or place differs from what was written down."""
        if name not in self._written:
            return True
        row = self._written[name][1]
        charged = abs((report.battery or 0.0) - (row.battery or 0.0)) >= _CHARGE
        return charged or math.dist(report.position or _HOME, row.position or _HOME) >= _METRES

    def _record(
        self, name: str, report: WatchedVehicle, *, heard: float | None, least: float
    ) -> None:
        """Take over report, and write them down if the last row is `least` seconds old."""
        with self._lock:
            self._stamp(name, report)
            self._reports[name] = report
            if heard is None:
                return
            before = self._states[name]
            state = self._states[name] = replace(
                before,
                battery=before.battery if report.battery is None else report.battery,
                position=report.position or before.position,
                heard=heard,
            )
            moment = time.monotonic()
            due = moment - self._written.get(name, (-math.inf, state))[0] >= least
            if due:
                self._written[name] = moment, state
        if due:
            self._store.robots.put(state)

    def _stamp(self, name: str, report: WatchedVehicle) -> None:
        """Note since when a link is lost and a list is known: the wall clock may be set later."""
        before, wall, now = self._reports[name], time.time(), time.monotonic()
        if report.link is LinkState.LOST and before.link is not LinkState.LOST:
            self._lost_at[name] = now - max(0.0, wall - (report.since or wall))
        if report.examined is not None and report.examined != before.examined:
            self._examined_at[name] = now - max(0.0, wall - report.examined)

    def _change(self, robot: str, *, enabled: bool) -> RobotState:
        with self._lock:
            state = self._states[robot] = replace(self._states[robot], enabled=enabled)
        self._store.robots.put(state)
        return state


def _moment(unix: float) -> str:
    return time.strftime("%Y-%m-%d %H:%M:%S UTC", time.gmtime(unix))
