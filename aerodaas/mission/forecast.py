"""Forecast of the battery: whether the charge lasts for the rest of the plan and the way home."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

from aerodaas.clock import NANOSECONDS
from aerodaas.config.model import LimitsConfig
from aerodaas.geometry.energy import EnergyMeter
from aerodaas.geometry.frames import Vector
from aerodaas.messages.mission import BatteryOutlook
from aerodaas.messages.vehicle import VehicleState
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.log import MissionLog
from aerodaas.mission.navigation.queue import QueuedWaypoint
from aerodaas.mission.safety.supervisor import has_position

__all__ = ["BatteryForecast"]

_PERIOD = NANOSECONDS
_PATIENCE = 10 * NANOSECONDS
"""Nanoseconds for which the forecast must find the battery too small before an alert is raised."""
_MARGIN = 1.1
"""Factor by which the plan must exceed the available charge to be reported: gauge and model are no
more accurate than that."""


class BatteryForecast:
    """Compares the battery, once a second, with the charge that the rest of the plan needs."""

    def __init__(
        self, limits: LimitsConfig, home: Vector, meter: EnergyMeter, log: MissionLog
    ) -> None:
        """Forecast by `meter` for a drone that returns to `home`, ENU metres."""
        self._fault = ""
        self._limits = limits
        self._home = home
        self._meter = meter
        self._log = log
        self._due = 0
        self._outlook: BatteryOutlook | None = None
        self._told = False
        self._short_since: int | None = None
        """Mission clock since which every forecast has found the battery too small for the plan."""

    def update(
        self, now: int, state: VehicleState, stops: Iterable[QueuedWaypoint], *, grounded: bool
    ) -> None:
        """Look at the plan `stops` at `now`.

        On the ground a shortfall raises an alert at once. In the air it must last for `_PATIENCE`:
        the battery gauge is coarse and a climb is expensive, so that a single estimate is
        unreliable.

        Args:
            now: Mission clock, nanoseconds.
            state: The vehicle's state; one without a position is passed over.
            stops: The stops ahead, in the order flown.
            grounded: Whether the drone is on the ground.
        """
        if now < self._due or not has_position(state):
            return
        self._due = now + _PERIOD
        position, speed = state.odometry.position, self._limits.cruise_speed
        route = [self._as_flown(stop) for stop in stops]
        needed = self._meter.route(position, route, self._home, speed)
        self._outlook = self._compare(state, needed)
        available = state.battery.fraction - self._limits.battery_land
        if not (route and needed > max(0.0, available) * _MARGIN):
            self._fault, self._short_since = "", None
            return
        self._fault = (
            f"at this rate the plan and the way home need {_share(needed)} of a battery, and "
            f"{_share(max(0.0, available))} is there to spend: the drone returns when only the way "
            "home is left"
        )
        if self._short_since is None:
            self._short_since = now
        surely = grounded or now - self._short_since >= _PATIENCE
        if surely and not self._told:
            self._told = True
            self._log.alert(now, "unreachable_plan", self._fault)

    def outlook(self, now: int) -> BatteryOutlook | None:
        """How far the battery lasts; None if no forecast is due, or its charge is not known."""
        return self._outlook if self._goes_on(now) else None

    def fault(self, now: int) -> str:
        """Why the battery is too small; empty while it is not, or nothing is forecast any more."""
        return self._fault if self._goes_on(now) else ""

    def _goes_on(self, now: int) -> bool:
        # The next one may be late, but has not been left out.
        return now <= self._due + _PERIOD

    def _compare(self, state: VehicleState, needed: float) -> BatteryOutlook | None:
        """Compare the charge with that at which the supervisor has the drone return."""
        charge, limits = state.battery.fraction, self._limits
        if not math.isfinite(charge):
            return None
        home = self._meter.way_home(state.odometry.position, self._home, limits.cruise_speed)
        returns_at = max(limits.battery_return, home + limits.battery_land)
        hover = max(0.0, charge - returns_at) / self._meter.hover(1.0)
        return BatteryOutlook(needed + limits.battery_land, returns_at, hover)

    def _as_flown(self, stop: QueuedWaypoint) -> Waypoint:
        """The rest of a stop: its remaining hover, at no more than the permitted speed."""
        speed = min(stop.waypoint.speed or self._limits.cruise_speed, self._limits.max_speed)
        return replace(stop.waypoint, speed=speed, hover_duration=max(0.0, stop.remaining_hover))


def _share(charge: float) -> str:
    most = 9.99
    return f"{charge:.0%}" if charge <= most else f"more than {most:.0%}"
