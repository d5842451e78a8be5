"""MonitoringAnalytics: selected readings as a stream, with alerts on limits and contradictions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from aerodaas.analytics.base import Analytics, Context
from aerodaas.clock import seconds
from aerodaas.config.checked import Fraction, NotNegative
from aerodaas.dataflow.interfaces import IMonitoringAnalytics
from aerodaas.errors import UnknownIdError
from aerodaas.messages.frames import Frame, Header
from aerodaas.messages.mission import MissionState, MissionStatus
from aerodaas.messages.odometry import Battery, GpsFix, Odometry
from aerodaas.messages.readings import Alert, Readings
from aerodaas.messages.vehicle import VehicleState
from aerodaas.mission.safety.reconcile import Reconciler

__all__ = ["MonitoringAnalytics"]

_READINGS = ("battery", "camera", "gps", "height", "position", "speed", "state", "yaw")


class MonitoringAnalytics(Analytics[Readings], IMonitoringAnalytics[Readings]):
    """Publishes selected readings of a drone by name, and alerts about them.

    Analyse any of the streams of odometry, vehicle state, GPS, battery, mission status
    (stat-stream) and camera; each item produces the newest values of the selected readings
    received so far. With mission status and odometry, it alerts when the two contradict.
    """

    accepts: ClassVar[tuple[type, ...]] = (
        Odometry,
        VehicleState,
        GpsFix,
        Battery,
        MissionStatus,
        Frame,
    )
    produces: ClassVar[type] = Readings

    def __init__(
        self,
        readings: Sequence[str] = ("battery", "height", "gps"),
        *,
        battery_low: Fraction = 0.25,
        max_height: float = math.inf,
        patience: NotNegative = 2.0,
    ) -> None:
        """Select readings and the limits of the alerts.

        Args:
            readings: Any of battery, camera, gps, height, position, speed, state, yaw.
            battery_low: Charge at or below which to alert, 0 to 1.
            max_height: Height above which to alert, metres; by default none.
            patience: Seconds for which state and odometry must contradict before an alert.

        Raises:
            UnknownIdError: If a name is not a reading.
        """
        for name in readings:
            if name not in _READINGS:
                raise UnknownIdError("reading", name, list(_READINGS))
        self._wanted = tuple(readings)
        self._battery_low = battery_low
        self._max_height = max_height
        self._reconciler = Reconciler(patience)
        self._values: dict[str, float] = {}
        self._odometry: Odometry | None = None
        self._last_frame: int | None = None
        self._contradictions: dict[str, str] = {}
        self._raised: set[str] = set()
        self._count = 0

    def process(
        self,
        item: Odometry | VehicleState | GpsFix | Battery | MissionStatus | Frame,
        context: Context,
    ) -> Readings:
        """Update the readings from one item.

        Args:
            item: Item of an analysed stream.
            context: Services of its node.

        Returns:
            The newest values of the selected readings.
        """
        now = context.now()
        vehicle = context.vehicle()
        if vehicle is not None:
            self._take_battery(vehicle.battery)
            self._take_gps(vehicle.gps)
        match item:
            case VehicleState():
                self._take_battery(item.battery)
                self._take_gps(item.gps)
                self._take_odometry(item.odometry, now)
            case Odometry():
                self._take_odometry(item, now)
            case GpsFix():
                self._take_gps(item)
            case Battery():
                self._take_battery(item)
            case MissionStatus():
                self._reconciler.observe_status(item)
                self._values["state"] = float(list(MissionState).index(item.state))
            case Frame():
                self._take_frame(item)
        self._alert({**self._limits_passed(), **self._contradictions}, now, context)
        chosen = {
            name: value
            for name, value in self._values.items()
            if name.partition(".")[0] in self._wanted
        }
        return Readings(now, chosen)

    def _take_battery(self, battery: Battery) -> None:
        self._values["battery"] = battery.fraction

    def _take_gps(self, fix: GpsFix | None) -> None:
        if fix is None:
            return
        self._values |= {
            "gps.latitude": fix.latitude,
            "gps.longitude": fix.longitude,
            "gps.altitude": fix.altitude,
        }
        if self._odometry is not None:
            self._reconciler.observe_gps(fix, self._odometry)

    def _take_odometry(self, odometry: Odometry, now: int) -> None:
        self._odometry = odometry
        east, north, _ = (float(axis) for axis in odometry.position)
        self._values |= {
            "height": odometry.height,
            "position.east": east,
            "position.north": north,
            "speed": float(np.linalg.norm(odometry.velocity)),
            "yaw": odometry.yaw,
        }
        self._contradictions = self._reconciler.observe_odometry(odometry, now)

    def _take_frame(self, frame: Frame) -> None:
        if self._last_frame is not None and frame.header.stamp > self._last_frame:
            self._values["camera.rate"] = 1.0 / seconds(frame.header.stamp - self._last_frame)
        self._last_frame = frame.header.stamp

    def _limits_passed(self) -> dict[str, str]:
        charge = self._values.get("battery", 1.0)
        height = self._values.get("height", -math.inf)
        found: dict[str, str] = {}
        if charge <= self._battery_low:
            found["battery_low"] = f"the battery is low at {charge:.0%}"
        if height > self._max_height:
            found["height"] = f"the drone is {height:.1f} m up, above {self._max_height:g} m"
        return found

    def _alert(self, found: dict[str, str], now: int, context: Context) -> None:
        """Publish one alert for each condition of `found` that has just begun."""
        for kind, text in found.items():
            if kind not in self._raised:
                header = Header(self._count, now, self.name or "monitoring")
                self._count += 1
                context.alert(Alert(header, kind, text))
        self._raised = set(found)
