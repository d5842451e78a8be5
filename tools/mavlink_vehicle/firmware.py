"""What both emulated families have in common: modes, arming, commands, failsafes, telemetry."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar, TypeAlias

import numpy as np
import shapely

from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.geometry.frames import enu_to_ned, ned_to_enu, yaw_enu_to_ned, yaw_ned_to_enu
from aerodaas.messages.vehicle import VehicleMode
from tools.mavlink_vehicle.actuators import EmulatedActuators
from tools.mavlink_vehicle.aircraft import EmulatedTraffic
from tools.mavlink_vehicle.extras import Extras
from tools.mavlink_vehicle.flight import GuidedTarget, MavFlight
from tools.mavlink_vehicle.options import AutopilotOptions
from tools.mavlink_vehicle.payload import EmulatedPayload
from tools.mavlink_vehicle.route import Route
from tools.mavlink_vehicle.store import LogStore, ParameterStore, PlanStore, TimeKeeper

__all__ = ["Firmware", "Result"]

Result: TypeAlias = Any
"""A MAV_RESULT, of which pymavlink tells no type."""

_OK = mavlink.MAV_RESULT_ACCEPTED
_IGNORE_PLACE, _IGNORE_VELOCITY, _IGNORE_YAW, _IGNORE_RATE = 0b111, 0b111000, 1 << 10, 1 << 11
_FORCED = 21196
"""By which a disarming stops the motors in the air, too."""
_SETTLING = 0.5
"""Seconds that it stays armed after the simulated flight is over, itself half a second after
touchdown: ArduPilot's land detector takes a second (LAND_DETECTOR_TRIGGER_SEC), PX4 longer
(COM_DISARM_LAND)."""
_DRIFT = np.array([0.3, 1.0, 0.0])
"""NED m/s by which a position without GPS goes astray."""


class Firmware(ABC):
    """One vehicle's autopilot; time in seconds since it was switched on."""

    number: ClassVar[int]
    """MAV_AUTOPILOT."""
    idle_disarm: ClassVar[float] = 10.0
    """Seconds armed on the ground after which it disarms."""
    default_rates: ClassVar[dict[int, float]]
    version: ClassVar[int]
    """As AUTOPILOT_VERSION has it: major, minor, patch, kind of release, from the highest byte."""
    capabilities: ClassVar[int]
    """MAV_PROTOCOL_CAPABILITY of AUTOPILOT_VERSION."""
    stands_still: ClassVar[bool] = False
    """Whether its estimator reports on the ground that it holds its place for fixed."""
    unheard_of: ClassVar[frozenset[int]]
    """Messages that it knows nothing of when it is asked to send them regularly."""
    wants_numbers: ClassVar[bool] = False
    """Whether it refuses a mission's item with a yaw that is not a number."""
    interval_refused: ClassVar[int] = mavlink.MAV_RESULT_FAILED
    starting: ClassVar[int] = mavlink.MAV_STATE_STANDBY
    """MAV_STATE of its HEARTBEAT until it is ready."""
    no_fix: ClassVar[int] = mavlink.GPS_FIX_TYPE_NO_FIX
    """The fix type of its GPS_RAW_INT when it has none."""
    dead_reckoning: ClassVar[float]
    """Seconds without GPS for which it trusts its own position."""

    def __init__(
        self,
        options: AutopilotOptions,
        flight: MavFlight,
        say: Callable[[Any], None],
        parameters: ParameterStore,
    ) -> None:
        """Be switched on; `say` sends a message."""
        self.options = options
        self.flight = flight
        self.parameters = parameters
        parameters.values.update(options.parameters)
        self.plans = PlanStore(wants_numbers=self.wants_numbers)
        self.logs = LogStore()
        self.time_keeper = TimeKeeper(lambda: self.now)
        self.route = Route(
            flight,
            lambda: self.plans.plans.get(mavlink.MAV_MISSION_TYPE_MISSION, []),
            lambda: self.home,
            say,
        )
        self.rates = dict(self.default_rates)
        self.armed = False
        self.failsafe = False
        self.now = 0.0
        self.home = enu_to_ned(np.array(options.start) - np.array(options.estimator_origin))
        self.motions: list[str] = []
        """Every deed that moved it, in order: the tests' witness."""
        self.frozen_at: int | None = None
        """Milliseconds at which the stamps of its telemetry stand still; None: they do not."""
        self.gps_lost_at: float | None = None
        """Second since which its GPS has no fix; None: it has one."""
        self.terminated = False
        """Its motors were stopped for good, and it goes on to call itself armed."""
        self._drifted = np.zeros(3)
        self._say = say
        self._extras = Extras(self)
        self.payload = EmulatedPayload(self, say, gimbal=options.gimbal, camera=options.camera)
        self.traffic = EmulatedTraffic(self)
        self.actuators = EmulatedActuators(self)
        self._armed_at = self._flew_at = 0.0
        self._setpoint_at = -math.inf
        self._lifted = False
        self._breached = False

    @property
    def ready(self) -> bool:
        """Whether it knows where it is and would arm."""
        return self.now >= self.options.ready_after

    @property
    def gps_fix(self) -> bool:
        """Whether its GPS has a position."""
        return self.gps_lost_at is None

    @property
    def knows_place(self) -> bool:
        """Whether its estimator trusts its own position over ground; for a while without GPS."""
        lost_at = self.gps_lost_at
        return self.ready and (lost_at is None or self.now - lost_at < self.dead_reckoning)

    @property
    def unsure(self) -> float:
        """Metres by which its estimator believes to err over ground."""
        return 0.3 if self.gps_lost_at is None else 1.8 + self.now - self.gps_lost_at

    def lose_gps(self, *, off: bool = False) -> None:
        """Let its GPS have no fix, or have one again: the place that it drifted to is put right."""
        if not off:
            self.gps_lost_at = self.now
            return
        self.gps_lost_at = None
        self.flight.shift_frame(-self._drifted)
        self._drifted = np.zeros(3)

    @property
    @abstractmethod
    def sensors(self) -> tuple[int, int, int]:
        """SYS_STATUS' bits: present, enabled, healthy."""

    @abstractmethod
    def go_blind(self) -> None:
        """Act on the loss of its position, by its own protection."""

    @property
    @abstractmethod
    def custom_mode(self) -> int:
        """As its HEARTBEAT has it."""

    @property
    def sinks_blind(self) -> bool:
        """Whether it sinks without a position, in a mode that is none of landing."""
        return False

    @property
    @abstractmethod
    def guided(self) -> bool:
        """Whether it follows setpoints."""

    @abstractmethod
    def command(self, number: int, values: tuple[float, ...], frame: int | None) -> Result:
        """Obey a command that only this family understands in its way."""

    @abstractmethod
    def refuse_arming(self) -> None:
        """Say why it does not arm."""

    @abstractmethod
    def protect(self) -> None:
        """Act on what is missing: setpoints, heartbeats."""

    @abstractmethod
    def enter_return(self) -> None:
        """Go home by itself."""

    @abstractmethod
    def breach(self) -> None:
        """The fence was crossed."""

    def obey(  # noqa: PLR0911 - one for each command
        self, number: int, values: tuple[float, ...], frame: int | None
    ) -> Result:
        """Obey a command; the result that is acknowledged."""
        if number == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
            message, interval = int(values[0]), values[1]
            if message in self.unheard_of:
                return self.interval_refused
            self.rates[message] = 1e6 / interval if interval > 0 else 0.0
            return _OK
        if number == mavlink.MAV_CMD_REQUEST_MESSAGE:
            return self._request(int(values[0]))
        if number == mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
            if values[0] > 0.5:  # noqa: PLR2004 - 0 or 1
                return self._arm()
            return self._disarm(forced=values[1] == _FORCED)
        if number == mavlink.MAV_CMD_DO_CHANGE_SPEED and values[1] > 0.0:
            self.flight.fastest = values[1]
            return _OK
        if number == mavlink.MAV_CMD_RUN_PREARM_CHECKS:
            self.refuse_arming()
            return _OK
        carried = self.payload.obey(number, values)
        carried = self.actuators.obey(number, values) if carried is None else carried
        return self.command(number, values, frame) if carried is None else carried

    def _request(self, message: int) -> Result:
        if message == mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION:
            self._say(
                mavlink.MAVLink_autopilot_version_message(
                    *(self.capabilities, self.version, self.version, 0, 0),
                    *([0] * 8,) * 3,
                    *(0, 0, self.options.system),
                )
            )
            return _OK
        made = self.message(message)
        if made is None:
            return mavlink.MAV_RESULT_UNSUPPORTED
        self._say(made)
        return _OK

    def _arm(self) -> Result:
        if self.armed:
            return _OK
        if not self.may_arm():
            self.refuse_arming()
            return self.arming_refused
        self.armed, self._lifted = True, False
        self._armed_at = self.now
        self.home = self.flight.ned
        self.motions.append("arm")
        return _OK

    arming_refused: ClassVar[int] = mavlink.MAV_RESULT_FAILED

    def may_arm(self) -> bool:
        """Whether it arms in its present mode."""
        return self.ready

    disarming_refused: ClassVar[int] = mavlink.MAV_RESULT_FAILED

    def _disarm(self, *, forced: bool) -> Result:
        if forced:
            self.stop_motors()
            return _OK
        if self.flight.flying:
            return self.disarming_refused
        self.armed = self.failsafe = False
        return _OK

    def stop_motors(self) -> None:
        """Stop its motors wherever it is: a kill switch, a forced disarm."""
        self.armed = self.failsafe = self._lifted = self.terminated = False
        self.flight.drop()

    def terminate(self) -> Result:
        """Stop its motors, as a parachute wants it."""
        if not self.armed:
            return mavlink.MAV_RESULT_DENIED
        self.stop_motors()
        self.armed = self.terminated = True
        return _OK

    def restart(self) -> None:
        """Start anew, as after a loss of power: motors, clock, rates and local frame."""
        self.stop_motors()
        self.now, self._setpoint_at, self.gps_lost_at = 0.0, -math.inf, None
        self.rates = dict(self.default_rates)
        self.flight.begin_frame_here()
        self.home = self.flight.ned
        self.forget_mode()

    @abstractmethod
    def forget_mode(self) -> None:
        """The mode after its start."""

    def lift(self, height: float) -> None:
        """Take off."""
        self._lifted = True
        self.motions.append("take off")
        self.flight.take_off(height)

    def go_to(self, yaw: float, latitude: float, longitude: float, altitude: float) -> Result:
        """Fly to a place on the earth: radians east of north or NaN, 1e-7 degrees, metres."""
        if not self.flight.flying:
            return mavlink.MAV_RESULT_DENIED
        flight = self.flight
        place = flight.origin.to_local(latitude / 1e7, longitude / 1e7, 0.0)
        place[2] = flight.believed.position[2] + flight.rise_to(altitude)
        facing = None if math.isnan(yaw) else yaw_ned_to_enu(yaw)
        self.motions.append("go to")
        flight.target = GuidedTarget(place, None, facing, None)
        return _OK

    def setpoint(self, message: Any) -> None:  # noqa: ANN401 - pymavlink has no types
        """Take a SET_POSITION_TARGET_LOCAL_NED."""
        if message.coordinate_frame != mavlink.MAV_FRAME_LOCAL_NED:
            return
        self._setpoint_at = self.now
        if not (self.guided and self.flight.flying):
            return
        if self.flight.mode is VehicleMode.TAKING_OFF:
            return
        mask = message.type_mask
        place = np.array([message.x, message.y, message.z])
        speed = np.array([message.vx, message.vy, message.vz])
        if self.flight.target is None:
            self.motions.append("follow")
        self.flight.target = GuidedTarget(
            None if mask & _IGNORE_PLACE else self.flight.enu(place),
            None if mask & _IGNORE_VELOCITY else ned_to_enu(speed),
            None if mask & _IGNORE_YAW else yaw_ned_to_enu(message.yaw),
            None if mask & _IGNORE_RATE else -message.yaw_rate,
        )

    def advance(self, duration: float) -> None:
        """Let time pass."""
        self.now += duration
        self.payload.advance()
        self.route.advance(self.now)
        self.flight.advance(duration)
        if self.flight.flying:
            self._flew_at = self.now
        if self._lifted and self.now - self._flew_at >= _SETTLING:
            self._lifted = self.armed = self.failsafe = False
        idles = self.armed and not self._lifted and not self.terminated
        if idles and self.now - self._armed_at > self.idle_disarm:
            self.armed = False
        if self.gps_lost_at is not None and not self.knows_place:
            self._drifted = self._drifted + _DRIFT * duration
            self.flight.shift_frame(_DRIFT * duration)
            if self.flight.flying and not self.failsafe:
                self.go_blind()
        if self.armed and not self.terminated:
            self.protect()
            self._watch_fence()

    def _watch_fence(self) -> None:
        corners = [
            (item.x / 1e7, item.y / 1e7)
            for item in self.plans.plans.get(mavlink.MAV_MISSION_TYPE_FENCE, [])
            if item.command == mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION
        ]
        if not corners or not self.flight.flying:
            return
        latitude, longitude, _ = self.flight.origin.to_geodetic(self.flight.believed.position)
        inside = shapely.Polygon(corners).contains(shapely.Point(latitude, longitude))
        if not inside and not self._breached:
            self.breach()
        self._breached = not inside

    def text(self, words: str, severity: int = mavlink.MAV_SEVERITY_CRITICAL) -> None:
        """Say something to people."""
        self._say(mavlink.MAVLink_statustext_message(severity, words.encode()))

    def heartbeat(self) -> Any:  # noqa: ANN401
        """Its HEARTBEAT."""
        flags = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        flags |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED if self.armed else 0
        idle = mavlink.MAV_STATE_STANDBY if self.ready else self.starting
        state = mavlink.MAV_STATE_ACTIVE if self.armed else idle
        if self.failsafe:
            state = mavlink.MAV_STATE_CRITICAL
        if self.terminated:
            state = mavlink.MAV_STATE_FLIGHT_TERMINATION
        return mavlink.MAVLink_heartbeat_message(
            self.options.vehicle_type, self.number, flags, self.custom_mode, state, 3
        )

    def message(self, number: int) -> Any | None:  # noqa: ANN401
        """A message of telemetry by its number; None if there is none to send."""
        makers: dict[int, Callable[[], Any]] = {
            mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: self._local_position,
            mavlink.MAVLINK_MSG_ID_ATTITUDE: self._attitude,
            mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: self._global_position,
            mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: self._gps,
            mavlink.MAVLINK_MSG_ID_SYS_STATUS: self._status,
            mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: self._landed,
            mavlink.MAVLINK_MSG_ID_HOME_POSITION: self._home,
            mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: self._time,
            mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: self.route.current,
            mavlink.MAVLINK_MSG_ID_ADSB_VEHICLE: self.traffic.message,
        }
        needs_place = {
            mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
            mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
            mavlink.MAVLINK_MSG_ID_HOME_POSITION,
        }
        if number in needs_place and not self.ready:
            return None
        if number in makers:
            return makers[number]()
        return (
            self._extras.message(number)
            or self.payload.message(number)
            or self.actuators.message(number)
        )

    @property
    def _boot(self) -> int:
        return int(self.now * 1e3) if self.frozen_at is None else self.frozen_at

    def _local_position(self) -> Any:  # noqa: ANN401
        velocity = enu_to_ned(self.flight.believed.velocity)
        return mavlink.MAVLink_local_position_ned_message(self._boot, *self.flight.ned, *velocity)

    def _attitude(self) -> Any:  # noqa: ANN401
        seen = self.flight.believed
        heading = yaw_enu_to_ned(seen.yaw)
        return mavlink.MAVLink_attitude_message(
            self._boot, seen.roll, -seen.pitch, heading, 0.0, 0.0, -seen.yaw_rate
        )

    def _global_position(self) -> Any:  # noqa: ANN401
        seen = self.flight.believed
        latitude, longitude, _ = self.flight.origin.to_geodetic(seen.position)
        north, east, down = (round(100 * axis) for axis in enu_to_ned(seen.velocity))
        heading = round(100 * math.degrees(yaw_enu_to_ned(seen.yaw) % math.tau)) % 36000
        return mavlink.MAVLink_global_position_int_message(
            self._boot,
            *(round(latitude * 1e7), round(longitude * 1e7), round(self.flight.altitude * 1e3)),
            round(1e3 * float(-(self.flight.ned - self.home)[2])),
            *(north, east, down, heading),
        )

    def _gps(self) -> Any:  # noqa: ANN401
        latitude, longitude, _ = self.flight.origin.to_geodetic(self.flight.believed.position)
        place = (round(latitude * 1e7), round(longitude * 1e7), round(self.flight.altitude * 1e3))
        known = self.ready and self.gps_fix
        fix = mavlink.GPS_FIX_TYPE_3D_FIX if known else self.no_fix
        sharpness = (80, 80) if known else (9999, 9999)
        return mavlink.MAVLink_gps_raw_int_message(
            *(int(self.now * 1e6), fix, *place, *sharpness, 0, 0, 12 if known else 0),
            *(place[2] + 47_000, *((800, 1200) if known else (100_000, 100_000))),
        )

    def _status(self) -> Any:  # noqa: ANN401
        left = round(100 * self.flight.charge)
        volts = round(1e3 * self.flight.voltage)
        return mavlink.MAVLink_sys_status_message(
            *self.sensors, 100, volts, -1, left, 0, 0, 0, 0, 0, 0
        )

    def _landed(self) -> Any:  # noqa: ANN401
        state = mavlink.MAV_LANDED_STATE_ON_GROUND
        if self.terminated:
            state = mavlink.MAV_LANDED_STATE_IN_AIR
        if self.flight.flying:
            state = {
                VehicleMode.TAKING_OFF: mavlink.MAV_LANDED_STATE_TAKEOFF,
                VehicleMode.LANDING: mavlink.MAV_LANDED_STATE_LANDING,
            }.get(self.flight.mode, mavlink.MAV_LANDED_STATE_IN_AIR)
            if self.sinks_blind:
                state = mavlink.MAV_LANDED_STATE_IN_AIR
        return mavlink.MAVLink_extended_sys_state_message(0, state)

    def _home(self) -> Any:  # noqa: ANN401
        place = self.flight.origin.to_geodetic(self.flight.enu(self.home))
        return mavlink.MAVLink_home_position_message(
            *(round(place[0] * 1e7), round(place[1] * 1e7), round(self.options.origin[2] * 1e3)),
            *self.home,
            *([1.0, 0.0, 0.0, 0.0],),
            *(0.0, 0.0, 0.0),
        )

    def _time(self) -> Any:  # noqa: ANN401
        return mavlink.MAVLink_system_time_message(int(1.8e15 + self.now * 1e6), self._boot)
