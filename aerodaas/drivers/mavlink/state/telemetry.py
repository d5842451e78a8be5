"""The newest message of each kind of a vehicle."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from aerodaas.drivers.mavlink.microservices.events import EventReader
from aerodaas.drivers.mavlink.microservices.texts import Texts
from aerodaas.drivers.mavlink.state.boot_clock import BootClock
from aerodaas.drivers.mavlink.state.frames import Attitude, attitude_from_frd
from aerodaas.drivers.mavlink.state.health import Health
from aerodaas.drivers.mavlink.state.rangefinder import Rangefinder
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.errors import VehicleError
from aerodaas.geometry.frames import Vector
from aerodaas.messages.odometry import Battery, GpsFix

__all__ = ["Sensors", "Telemetry"]

_FRESH = 1.0
"""Seconds after which a position or an attitude is invalid."""
_GAP = 0.9
"""Seconds without any message that count as a silence: less than a position is valid for."""
_BEATS = 5.0
"""Seconds without a HEARTBEAT, of which one comes each second, after which the mode is unknown."""
_FIX = 2
"""GPS fix types from this one on are positions."""
_FAR = 5.0
"""Seconds by which time stamps may go back, as packets overtake each other; more is a restart."""
_FULL = 100
"""Percent."""
_HOME_MOVED = 2.0
"""Metres from where its motors started at which its home has been moved."""
_UNKNOWN_SATELLITES = 255
_BREACHES = {
    mavlink.FENCE_BREACH_MINALT: "too low",
    mavlink.FENCE_BREACH_MAXALT: "too high",
    mavlink.FENCE_BREACH_BOUNDARY: "outside",
}
_UNKNOWN_VOLTAGE = 65535


class Sensors(NamedTuple):
    """Bits of MAV_SYS_STATUS_SENSOR."""

    present: int
    enabled: int
    health: int


class Telemetry:
    """Newest messages of one vehicle in its own frames, with arrival times in monotonic seconds."""

    def __init__(self, *, measures_ground: bool = False) -> None:
        """Know nothing; heed a rangefinder, and miss it, where one `measures_ground`."""
        self.heard_at = self.back_at = -math.inf
        """Any message at all, and the first one after the latest silence."""
        self.ticked_at = -math.inf
        """The latest message whose stamp was newer than all before."""
        self.beat_at = -math.inf
        """The latest HEARTBEAT."""
        self.custom_mode = 0
        self.armed = self.critical = False
        """Whether its motors turn, and whether its own protection is at work."""
        self.position: Vector | None = None
        """NED metres from the autopilot's own origin."""
        self.velocity: Vector = np.zeros(3)
        self.position_at = -math.inf
        self.attitude, self.attitude_at = Attitude(), -math.inf
        self.home: Vector | None = None
        """Where its own return leads, NED metres; others may move it in flight."""
        self._armed_at: Vector | None = None
        """Where its motors started, NED metres; its first home if it was met in the air."""
        self.altitude: float | None = None
        """Metres above mean sea level, by its own estimate."""
        self.place: tuple[float, float] | None = None
        """Latitude and longitude in degrees, by its own estimate."""
        self.gps: GpsFix | None = None
        self.battery = Battery(math.nan)
        self.on_ground: bool | None = None
        self.breach = ""
        """How it says that it is outside its own fence; empty if it does not."""
        self.sensors: Sensors | None = None
        """Bits of SYS_STATUS; None before it has come."""
        self.health = Health()
        """Faults by name."""
        self.boot_time = math.nan
        """Seconds of the autopilot's own clock since it started."""
        self.clock = math.nan
        """The same clock in seconds since the Unix epoch."""
        self.mission_item = self.mission_reached = math.nan
        """Numbers of the items of its own mission: that it flies or would fly, and the last that it
        has reached."""
        self.reboots = 0
        self._booting: bool | None = None
        self.software = self.hardware = ""
        """Its version, and its board's own number in hexadecimal digits; empty before
        AUTOPILOT_VERSION has come, the latter also if it has none."""
        self._stamps: dict[str, int] = {}
        self.seen: dict[str, float] = {}
        """Arrival time of each kind of message."""
        self.rangefinder = Rangefinder() if measures_ground else None
        self.texts, self.events, self.boot_clock = Texts(), EventReader(), _boot_clock()
        self._takers: dict[str, Callable[[Any, float], None]] = {
            "HEARTBEAT": self._heartbeat,
            "LOCAL_POSITION_NED": self._local_position,
            "ATTITUDE": self._attitude,
            "GLOBAL_POSITION_INT": self._global_position,
            "GPS_RAW_INT": self._gps,
            "SYS_STATUS": self._status,
            "EXTENDED_SYS_STATE": self._landed,
            "HOME_POSITION": self._home,
            "FENCE_STATUS": self._fence,
            "SYSTEM_TIME": self._time,
            "TIMESYNC": lambda message, _: self.boot_clock.on_timesync(message),
            "AUTOPILOT_VERSION": self._version,
            "MISSION_CURRENT": self._mission,
            "MISSION_ITEM_REACHED": self._reached,
            "STATUSTEXT": self._text,
            "EVENT": self._event,
            "DISTANCE_SENSOR": self._distance,
        }

    @property
    def messages(self) -> frozenset[str]:
        """Names of the messages that update it."""
        return frozenset((*self._takers, *self.health.messages))

    def on_message(self, message: Any, now: float) -> None:  # noqa: ANN401 - pymavlink has no types
        """Update by a message of the vehicle.

        Args:
            message: The message.
            now: Monotonic clock, seconds.
        """
        if now - self.heard_at > _GAP:
            self.back_at = now
        self.heard_at = now
        kind = message.get_type()
        self.seen[kind] = now
        if not self._fresh(kind, message, now):
            return
        self.health.on_message(message, now)
        taker = self._takers.get(kind)
        if taker is not None:
            taker(message, now)

    def silence(self, now: float) -> float:
        """Seconds since its last new data; repeated timestamps are no new data."""
        return now - min(self.heard_at, self.ticked_at)

    def shows_mode(self, now: float) -> bool:
        """Whether its HEARTBEATs show the mode that it has: one has come since the last silence."""
        return self.beat_at >= self.back_at and now - self.beat_at <= _BEATS

    def in_touch(self, now: float) -> bool:
        """Whether it is heard at present, and its mode is known."""
        return now - self.heard_at <= _GAP and self.shows_mode(now)

    def knows_place(self, now: float) -> bool:
        """Whether position and attitude are recent, and valid by its own estimate."""
        fresh = now - self.position_at < _FRESH and now - self.attitude_at < _FRESH
        return fresh and not self.health.lost(now)

    @property
    def home_off(self) -> float:
        """Metres by which its own return would miss the place of take-off; 0 within 2 m."""
        if not self.armed or self.home is None or self._armed_at is None:
            return 0.0
        off = float(np.linalg.norm(self.home - self._armed_at))
        return off if off > _HOME_MOVED else 0.0

    @property
    def up(self) -> float:
        """Metres above the autopilot's own origin; minus infinity while that is not known."""
        return -math.inf if self.position is None else -float(self.position[2])

    def whereabouts(self) -> tuple[tuple[float, float], Vector]:
        """Latitude and longitude (degrees), and local position (NED metres).

        Raises VehicleError if it does not know them now: what was there a moment ago may be lost.
        """
        place, position = self.place, self.position
        if place is None or position is None:
            raise VehicleError("it lost its position while being connected; connect again")
        return place, position

    def _heartbeat(self, message: Any, now: float) -> None:  # noqa: ANN401
        met, was_armed, self.beat_at = self.beat_at > -math.inf, self.armed, now
        self.custom_mode = message.custom_mode
        # A terminated autopilot reports itself as armed for ever, but no motor turns.
        self.armed = (
            bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
            and message.system_status != mavlink.MAV_STATE_FLIGHT_TERMINATION
        )
        if self.armed and not was_armed:
            self._armed_at = self.position if met else self.home
        self.critical = message.system_status in {
            mavlink.MAV_STATE_CRITICAL,
            mavlink.MAV_STATE_EMERGENCY,
        }
        booting = message.system_status == mavlink.MAV_STATE_BOOT
        # The first one may find it just starting, which is no restart.
        if booting and self._booting is False:
            self._restarted()
        self._booting = booting

    def _local_position(self, message: Any, now: float) -> None:  # noqa: ANN401
        position = np.array([message.x, message.y, message.z], dtype=np.float64)
        velocity = np.array([message.vx, message.vy, message.vz], dtype=np.float64)
        if np.isfinite(position).all() and np.isfinite(velocity).all():
            self.position, self.velocity, self.position_at = position, velocity, now

    def _attitude(self, message: Any, now: float) -> None:  # noqa: ANN401
        angles = (message.roll, message.pitch, message.yaw, message.yawspeed)
        if all(map(math.isfinite, angles)):
            self.attitude, self.attitude_at = attitude_from_frd(*angles), now

    def _global_position(self, message: Any, _: float) -> None:  # noqa: ANN401
        # Zero is an autopilot's value for "unknown".
        if (message.lat == 0 and message.lon == 0) or not _on_earth(message):
            self.altitude = self.place = None
            return
        self.altitude = message.alt / 1e3
        self.place = message.lat / 1e7, message.lon / 1e7

    def _gps(self, message: Any, _: float) -> None:  # noqa: ANN401
        if message.fix_type < _FIX or not _on_earth(message):
            self.gps = None
            return
        count = message.satellites_visible
        self.gps = GpsFix(
            message.lat / 1e7,
            message.lon / 1e7,
            (message.alt_ellipsoid or message.alt) / 1e3,
            message.h_acc / 1e3,
            message.v_acc / 1e3,
            0 if count == _UNKNOWN_SATELLITES else count,
        )

    def _status(self, message: Any, _: float) -> None:  # noqa: ANN401
        left = message.battery_remaining
        voltage = message.voltage_battery
        self.battery = Battery(
            left / 100 if 0 <= left <= _FULL else math.nan,
            voltage / 1e3 if voltage != _UNKNOWN_VOLTAGE else 0.0,
            max(0, message.current_battery) / 100,
        )
        self.sensors = Sensors(
            message.onboard_control_sensors_present,
            message.onboard_control_sensors_enabled,
            message.onboard_control_sensors_health,
        )

    def _landed(self, message: Any, _: float) -> None:  # noqa: ANN401
        unknown = message.landed_state == mavlink.MAV_LANDED_STATE_UNDEFINED
        grounded = message.landed_state == mavlink.MAV_LANDED_STATE_ON_GROUND
        self.on_ground = None if unknown else grounded

    def _home(self, message: Any, _: float) -> None:  # noqa: ANN401
        home = np.array([message.x, message.y, message.z], dtype=np.float64)
        self.home = home if np.isfinite(home).all() else None
        if self.armed and self._armed_at is None:
            self._armed_at = self.home

    def _fence(self, message: Any, _: float) -> None:  # noqa: ANN401
        how = _BREACHES.get(message.breach_type, "left")
        self.breach = f"its own geofence: {how}" if message.breach_status else ""

    def _time(self, message: Any, _: float) -> None:  # noqa: ANN401
        self.clock = message.time_unix_usec / 1e6

    def _fresh(self, kind: str, message: Any, now: float) -> bool:  # noqa: ANN401
        """Update the autopilot's clock; False for a message not newer than the previous one."""
        stamp = getattr(message, "time_boot_ms", None)
        if stamp is None:
            return True
        boot_time = stamp / 1e3
        if boot_time < self.boot_time - _FAR:
            self._restarted()
        if not boot_time <= self.boot_time:
            self.boot_time, self.ticked_at = boot_time, now
        # Several sensors of one kind stamp each their own.
        source = f"{kind} {message.id}"
        before = self._stamps.get(source)
        if before is not None and stamp <= before:
            return False
        self._stamps[source] = stamp
        return True

    def _restarted(self) -> None:
        """Forget messages from before a restart of the autopilot."""
        self.reboots += 1
        # Its first HEARTBEAT comes a second after its first other messages, and no motor turns.
        self.armed = False
        self.boot_time = math.nan
        self._stamps.clear()
        self.position_at = self.attitude_at = -math.inf
        self.home = self._armed_at = self.place = self.altitude = self.gps = None
        self.mission_item = self.mission_reached = math.nan
        self.sensors, self.on_ground, self.breach = None, None, ""
        self.health, self.events, self.boot_clock = Health(), EventReader(), _boot_clock()

    def _distance(self, message: Any, now: float) -> None:  # noqa: ANN401
        if self.rangefinder is not None:
            self.rangefinder.on_message(message, now)

    def _version(self, message: Any, _: float) -> None:  # noqa: ANN401
        version = message.flight_sw_version
        self.software = ".".join(str(version >> shift & 0xFF) for shift in (24, 16, 8))
        number = bytes(message.uid2)
        self.hardware = number.rstrip(b"\0").hex() or (f"{message.uid:x}" if message.uid else "")

    def _mission(self, message: Any, _: float) -> None:  # noqa: ANN401
        self.mission_item = float(message.seq)

    def _reached(self, message: Any, _: float) -> None:  # noqa: ANN401
        self.mission_reached = float(message.seq)

    def _text(self, message: Any, now: float) -> None:  # noqa: ANN401
        self.texts.add_statustext(
            message.text, message.severity, now, message.id, message.chunk_seq
        )

    def _event(self, message: Any, now: float) -> None:  # noqa: ANN401
        said = self.events.decode(
            message.event, message.log_levels, message.sequence, message.arguments, now
        )
        if said is not None:
            self.texts.add(said.text, said.severity, now)


def _on_earth(message: Any) -> bool:  # noqa: ANN401
    """Whether latitude and longitude (degrees times 10^7) are such."""
    return bool(abs(message.lat) <= 90 * 10**7 and abs(message.lon) <= 180 * 10**7)


def _boot_clock() -> BootClock:
    return BootClock(time.monotonic)
