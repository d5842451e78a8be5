"""Watcher of one vehicle: connects by the ordinary driver, and reads; it commands nothing."""

from __future__ import annotations

import contextlib
import math
import threading
import time
from collections.abc import Callable

from aerodaas.config.model import EnvironmentConfig, RobotConfig
from aerodaas.drivers.loading import load_vehicle
from aerodaas.errors import AeroDaaSError, VehicleError, failure_line
from aerodaas.messages.health import MeasuredVehicle
from aerodaas.messages.vehicle import Vehicle, VehicleMode, VehicleState
from aerodaas.mission.safety.checklist import Checklist
from aerodaas.protocol.schemas import LinkState
from aerodaas.service.monitor.reports import WatchedVehicle

__all__ = ["VehicleWatcher"]

_CONNECT_SECONDS = 5.0
_READ_SECONDS = 0.5
_ANEW_SECONDS = 10.0
"""Seconds without a word after which it is connected anew: it may have been replaced."""
_SILENT_SECONDS = 5.0
"""Seconds without a reading after which a vehicle is not called connected any more."""
_PAUSE, _LONGEST_PAUSE = 1.0, 10.0
"""Seconds between two attempts to connect, which grow."""


class VehicleWatcher:
    """Holds one vehicle while it is wanted, in a thread of its own.

    It calls `connect`, `read`, `preflight`, `health` and `close` of the driver and no more, with
    the settings by which the driver changes nothing at the vehicle (`observing`, if it has any). A
    driver lands what it has flown when it is closed, and some land what is in the air, whoever
    flies it: so a vehicle that is armed is not closed before it has been disarmed.
    """

    def __init__(
        self, robot: RobotConfig, environment: EnvironmentConfig, changed: Callable[[], None]
    ) -> None:
        """Watch `robot`; `changed` is called in any thread after each change of its link."""
        # Without its sensors: nobody looks at a camera's video between missions.
        self._robot = robot.model_copy(update={"sensors": ()})
        self._environment = environment
        self._changed = changed
        self._lock = threading.Condition()
        self._wanted = False
        self._report = WatchedVehicle()
        self._read_at = -math.inf
        """Monotonic seconds of the newest reading."""

    def start(self) -> None:
        """Start; holds nothing before it is wanted."""
        threading.Thread(target=self._run, name=self._robot.id, daemon=True).start()

    def want(self, *, wanted: bool) -> None:
        """Hold the vehicle from now on, or let go of it."""
        with self._lock:
            self._wanted = wanted
            self._lock.notify_all()

    @property
    def report(self) -> WatchedVehicle:
        """The vehicle as it was last seen; lost, if its driver has hung since."""
        with self._lock:
            report, silence = self._report, time.monotonic() - self._read_at
        if report.link is not LinkState.CONNECTED or silence <= _SILENT_SECONDS:
            return report
        reason = f"its driver has not answered for {silence:.0f} s"
        return report.model_copy(
            update={"link": LinkState.LOST, "since": report.heard, "reason": reason}
        )

    def _run(self) -> None:
        pause = _PAUSE
        while True:
            with self._lock:
                self._lock.wait_for(lambda: self._wanted)
                # Under the lock: from here on it is held, before anything is opened.
                self._report = self._report.model_copy(update={"held": True})
            reached = self._hold()
            pause = _PAUSE if reached else min(2.0 * pause, _LONGEST_PAUSE)
            with self._lock:
                self._lock.wait_for(lambda: not self._wanted, pause)

    def _hold(self) -> bool:
        """Connect, and watch until it is wanted no more or lost; returns whether it was reached."""
        reached, reason = False, ""
        if self._report.link is LinkState.UNWATCHED:
            fresh = WatchedVehicle(held=True, link=LinkState.CONNECTING, since=time.time())
            self._update(**dict(fresh))
        try:
            vehicle = load_vehicle(self._robot, self._environment, observing=True)
            vehicle.connect(_CONNECT_SECONDS)
            try:
                reached = True
                reason = self._watch(vehicle)
            finally:
                vehicle.close()
        except AeroDaaSError as error:
            reason = str(error)
        except Exception as error:  # noqa: BLE001 - a driver of others may raise anything
            reason = failure_line(error)
        with self._lock:
            wanted = self._wanted
        if wanted:
            self._lose(reason, held=False)
        else:
            self._update(link=LinkState.UNWATCHED, since=time.time(), held=False, reason="")
        return reached

    def _watch(self, vehicle: Vehicle) -> str:
        """Read until it is wanted no more, or silent; returns why it is lost."""
        armed = False
        with self._lock:
            self._read_at = time.monotonic()
        checklist = Checklist(vehicle, self._robot.limits, self._robot.preflight)
        while True:
            try:
                state, objections = vehicle.read(), vehicle.preflight()
                # The list before take-off: of one in the air, it stays as it was then.
                items = None if state.armed else checklist.examine(state)
                wind = _wind(vehicle)
            except Exception as error:
                if not armed:
                    raise
                self._lose(failure_line(error))
                time.sleep(_READ_SECONDS)
                continue
            armed, now = state.armed, time.time()
            if state.mode is VehicleMode.LOST:
                self._lose("; ".join(state.faults) or "it is silent")
            else:
                self._see(state, objections, now)
                if items is not None:
                    self._update(health=tuple(items), examined=now, wind=wind)
            if not state.armed and self._silence() > _ANEW_SECONDS:
                return self._report.reason
            with self._lock:
                unwanted = self._lock.wait_for(lambda: not self._wanted, _READ_SECONDS)
            if unwanted and not state.armed:
                return ""
            if unwanted:
                time.sleep(_READ_SECONDS)

    def _silence(self) -> float:
        """Seconds since the vehicle was heard last, while its link is lost."""
        lost = self._report.link is LinkState.LOST
        return time.monotonic() - self._read_at if lost else 0.0

    def _see(self, state: VehicleState, objections: list[str], now: float) -> None:
        charge = state.battery.fraction
        place = tuple(float(axis) for axis in state.odometry.position)
        connected = self._report.link is LinkState.CONNECTED
        with self._lock:
            self._read_at = time.monotonic()
        self._update(
            link=LinkState.CONNECTED,
            since=self._report.since if connected else now,
            reason="",
            heard=now,
            battery=charge if math.isfinite(charge) else None,
            position=place if all(map(math.isfinite, place)) else None,
            mode=state.mode.value,
            faults=list(state.faults),
            objections=tuple(objections),
        )

    def _lose(self, reason: str, **more: object) -> None:
        report = self._report
        before = time.time() if report.heard is None else report.heard
        since = report.since if report.link is LinkState.LOST else before
        self._update(link=LinkState.LOST, since=since, reason=reason, **more)

    def _update(self, **changes: object) -> None:
        with self._lock:
            before, self._report = self._report, self._report.model_copy(update=changes)
            told = (before.link, before.held) != (self._report.link, self._report.held)
        if told:
            self._changed()


def _wind(vehicle: Vehicle) -> float | None:
    """Wind along the ground that a vehicle tells of, m/s; None without."""
    if isinstance(vehicle, MeasuredVehicle):
        with contextlib.suppress(VehicleError):  # its own objections say what is missing
            return vehicle.health().wind
    return None
