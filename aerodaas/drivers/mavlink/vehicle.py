"""MavlinkVehicle: PX4 and ArduCopter behind the protocol of every drone."""

from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Sequence

import numpy as np

from aerodaas.clock import NANOSECONDS, Clock, ScaledClock
from aerodaas.config import EnvironmentConfig, RobotConfig
from aerodaas.data import Odometry
from aerodaas.drivers.mavlink.climb import Climb
from aerodaas.drivers.mavlink.commander import Commander, Outcome
from aerodaas.drivers.mavlink.connecting import Connection, establish
from aerodaas.drivers.mavlink.dialect import mavlink
from aerodaas.drivers.mavlink.finder import Finder, Found
from aerodaas.drivers.mavlink.frames import LocalFrame
from aerodaas.drivers.mavlink.guidance import MovingTarget
from aerodaas.drivers.mavlink.link import MavlinkLink, Message
from aerodaas.drivers.mavlink.parameters import Parameters
from aerodaas.drivers.mavlink.phase import FlightMode, FlightPhase
from aerodaas.drivers.mavlink.plans import Item, Progress, download, upload
from aerodaas.drivers.mavlink.rates import RateKeeper
from aerodaas.drivers.mavlink.setpoint import position_message, velocity_message
from aerodaas.drivers.mavlink.settings import mavlink_settings
from aerodaas.drivers.mavlink.telemetry import Telemetry
from aerodaas.drivers.mavlink.watchdog import Watchdog
from aerodaas.drivers.setpoints import require_finite
from aerodaas.errors import ConfigError, InvalidWaypointError, VehicleError
from aerodaas.geometry import GeodeticOrigin, Vector
from aerodaas.navigation.control import limit_length
from aerodaas.vehicle import (
    Capabilities,
    PositionSetpoint,
    Setpoint,
    VehicleMode,
    VehicleState,
    VelocitySetpoint,
)

__all__ = ["MavlinkVehicle"]

_log = logging.getLogger(__name__)

_LOST_AFTER = 1.5
"""Seconds without any word, of a vehicle that speaks 40 times a second."""
_STREAM_GAP = 0.5
"""Seconds between setpoints after which the stream counts as begun anew."""
_ASK_AGAIN = 2.0
"""Seconds after which guided flight is asked for again."""
_REASONS = 12.0
"""Seconds that the autopilot's words may be old to count as the reason of a refusal."""
_GRAVE = 3
"""Severity of an error; smaller is graver."""
_PARTING = 2.0
"""Seconds that `close` waits for a vehicle in the air to begin its landing."""
_STEERED = {VehicleMode.HOLDING, VehicleMode.GUIDED, VehicleMode.RETURNING}


class MavlinkVehicle:
    """One multicopter with PX4 or ArduPilot; implements `aerodaas.vehicle.ClockedVehicle`.

    One thread at a time may use it, the link's own apart. Raises ConfigError for settings that it
    does not know.
    """

    def __init__(self, robot: RobotConfig, environment: EnvironmentConfig) -> None:
        """Prepare for `robot`; nothing is sent or opened."""
        self._robot = robot
        self._name = robot.id
        self._settings = settings = mavlink_settings(robot)
        home = environment.home
        self._home = GeodeticOrigin(home.latitude, home.longitude, home.altitude) if home else None
        if settings.frame == "home" and self._home is None:
            raise ConfigError(f'{robot.id}: "frame": "home" needs a home in the environment file')
        limits = robot.limits
        self._speed = min(limits.max_speed, settings.max_speed)
        self._cruise = min(limits.cruise_speed, self._speed)
        self._climb_rate = min(limits.max_climb, settings.max_climb)
        self._turn_rate = math.radians(limits.max_yaw_rate)
        self._clock: Clock = ScaledClock()
        self._lock = threading.RLock()
        self._link: MavlinkLink | None = None
        self._forget()

    def _forget(self) -> None:
        self._telemetry = Telemetry()
        self._phase = FlightPhase()
        self._watchdog = Watchdog()
        self._target = MovingTarget(self._robot.limits.max_acceleration, self._turn_rate)
        self._finder = Finder(self._settings)
        self._connection: Connection | None = None
        self._commander: Commander | None = None
        self._rates: RateKeeper | None = None
        self._climb: Climb | None = None
        self._climb_place: Vector | None = None
        self._refusal = ""
        self._stream_since = self._streamed_at = -math.inf
        self._guided_asked_at = -math.inf
        self._left_alone: FlightMode | None = None
        self._checked_at = -math.inf
        self._told: VehicleMode | None = None

    @property
    def capabilities(self) -> Capabilities:
        """What this driver offers."""
        settings = self._settings
        return Capabilities("mavlink", max_speed=settings.max_speed, max_climb=settings.max_climb)

    def use_clock(self, clock: Clock) -> None:
        """Stamp states by `clock` from now on; the calling thread is the control loop."""
        self._clock = clock
        self._watchdog.belong()

    def connect(self, timeout: float = 10.0) -> None:
        """Find the vehicle within `timeout` seconds, and wait until it knows where it is.

        The latter may take `ready_timeout` seconds more: an autopilot needs up to a minute after
        its start. Raises VehicleError that says what is missing.
        """
        self.close()
        self._forget()
        link = MavlinkLink(
            self._name,
            self._settings,
            on_message=self._take,
            on_turn=self._turned,
            healthy=self._watchdog.healthy,
        )
        link.open()
        self._link = link
        try:
            found = self._find(link, time.monotonic() + timeout)
            target = (found.system, found.component)
            link.adopt(*target)
            with self._lock:
                commander = Commander(link.send, target, self._settings.own_system)
                self._rates = RateKeeper(found.autopilot, commander)
                self._commander = commander
            self._connection = establish(
                link,
                found.autopilot,
                commander,
                self._telemetry,
                robot=self._robot,
                settings=self._settings,
                home=self._home,
                pause=self._pause,
            )
        except BaseException:
            self.close()
            raise

    def _find(self, link: MavlinkLink, deadline: float) -> Found:
        while (found := self._finder.found) is None:
            if time.monotonic() >= deadline:
                raise VehicleError(f"{self._name}: {self._finder.explain(link.counts)}")
            self._pause()
        return found

    def _pause(self) -> None:
        self._watchdog.feed()
        time.sleep(0.02)

    def close(self) -> None:
        """Let go; a vehicle in the air that we fly is told to land."""
        link, self._link = self._link, None
        if link is None:
            return
        if self._connection is not None and self._ours_in_the_air():
            self._change(FlightMode.LAND)
            deadline = time.monotonic() + _PARTING
            while self._phase.shown is not FlightMode.LAND and time.monotonic() < deadline:
                self._pause()
        link.close()
        self._connection = None

    def _ours_in_the_air(self) -> bool:
        phase = self._phase
        landing = phase.wish in {FlightMode.RETURN, FlightMode.LAND}
        return phase.armed and phase.taken is None and phase.wish is not None and not landing

    def read(self) -> VehicleState:
        """Return the newest state; raise VehicleError if not connected."""
        self._watchdog.feed()
        with self._lock:
            connection = self._connected()
            now = time.monotonic()
            telemetry, lost = self._telemetry, self._lost(now)
            knows = telemetry.knows_place(now)
            age = now - telemetry.position_at if knows or lost else 0.0
            return VehicleState(
                max(0, self._clock.now() - int(age * NANOSECONDS)),
                self._odometry(connection.frame, known=knows or lost),
                telemetry.battery,
                VehicleMode.LOST if lost else self._mode(),
                telemetry.armed,
                telemetry.gps,
                faults=tuple(self._faults(now)),
                extra={
                    "autopilot_time": telemetry.boot_time,
                    "autopilot_clock": telemetry.clock,
                    "damaged_packets": connection.link.counts.damaged,
                    "foreign_packets": connection.link.counts.strangers,
                    "silence": now - telemetry.heard_at,
                },
            )

    def _odometry(self, frame: LocalFrame, *, known: bool) -> Odometry:
        telemetry, attitude = self._telemetry, self._telemetry.attitude
        position = telemetry.position if known else None
        nowhere: Vector = np.full(3, np.nan)
        return Odometry(
            nowhere if position is None else frame.position(position),
            frame.velocity(telemetry.velocity),
            attitude.yaw,
            attitude.roll,
            attitude.pitch,
            attitude.yaw_rate,
        )

    def _mode(self) -> VehicleMode:
        if self._climb is not None and self._phase.taken is None:
            return VehicleMode.TAKING_OFF
        return self._phase.mode

    def _lost(self, now: float) -> bool:
        return now - self._telemetry.heard_at > _LOST_AFTER

    def _faults(self, now: float) -> list[str]:
        faults = []
        if self._lost(now):
            faults.append(f"no word for {now - self._telemetry.heard_at:.0f} s")
        if self._telemetry.reboots:
            faults.append("the autopilot's own clock has gone back: it was started anew")
        return faults + self._telemetry.texts.recent(now, _REASONS, _GRAVE)

    def preflight(self) -> list[str]:
        """Reasons for which a take-off would be refused now; empty when ready."""
        with self._lock:
            if self._link is None or self._connection is None:
                return ["not connected"]
            now = time.monotonic()
            if self._lost(now):
                return [f"no word from the vehicle for {now - self._telemetry.heard_at:.0f} s"]
            reasons = []
            if self._phase.armed:
                reasons.append(f"already {self._phase.mode.value.replace('_', ' ')}")
            if not self._telemetry.knows_place(now):
                reasons.append("the autopilot does not know its position")
            return reasons + self._connection.autopilot.objections(self._telemetry, now)

    def take_off(self, height: float) -> None:
        """Arm and climb to `height` metres above here; returns at once.

        Raises VehicleError if preflight has objections, and the next time after the autopilot
        itself has refused, with its words.
        """
        if not (math.isfinite(height) and height > 0.0):
            raise InvalidWaypointError(
                f"{self._name}: the take-off height must be a positive number of metres, "
                f"not {height!r}"
            )
        with self._lock:
            connection = self._connected()
            if self._climb is not None:
                return
            refusal, self._refusal = self._refusal, ""
            reasons = [refusal] if refusal else self.preflight()
            if reasons:
                raise VehicleError(f"{self._name} refuses to take off: {'; '.join(reasons)}")
            telemetry, autopilot = self._telemetry, connection.autopilot
            assert telemetry.position is not None  # noqa: S101 - preflight has seen to it
            self._climb_place = None
            self._climb = Climb(
                connection.commander,
                autopilot.take_off(height, telemetry),
                height - float(telemetry.position[2]),
                height=height,
                armed=lambda: self._phase.armed,
                climbs=lambda now: self._phase.ask(FlightMode.TAKE_OFF, now),
                failed=self._refused,
                now=time.monotonic(),
            )

    def _refused(self, text: str) -> None:
        """A take-off has come to nothing; in the link's thread."""
        now = time.monotonic()
        telemetry, connection = self._telemetry, self._connection
        said = telemetry.texts.recent(now, _REASONS)
        if connection is not None and not said:
            said = connection.autopilot.objections(telemetry, now)
        self._refusal = "; ".join([text, *said])
        self._climb = None

    def send(self, setpoint: Setpoint) -> Setpoint:
        """Send one setpoint and return it after clipping to the limits of the vehicle.

        Setpoints go out from the first call on; the autopilot is asked to follow them when it has
        seen enough of them, and holds until then. Raises InvalidWaypointError for numbers that
        are not finite, and VehicleError on the ground, during take-off and landing, and when
        somebody else flies. Without a position it is told to stand still.
        """
        require_finite(self._name, setpoint)
        self._watchdog.feed()
        with self._lock:
            connection = self._require_flight("follow a setpoint")
            return self._steer(setpoint, connection, time.monotonic())

    def _steer(self, setpoint: Setpoint, connection: Connection, now: float) -> Setpoint:
        if now - self._streamed_at > _STREAM_GAP:
            self._stream_since = now
            self._target.forget()
        self._streamed_at = now
        if not self._telemetry.knows_place(now):
            setpoint = VelocitySetpoint(np.zeros(3))
        if isinstance(setpoint, PositionSetpoint):
            message, sent = self._position(setpoint, connection, now)
        else:
            message, sent = self._velocity(setpoint, connection, now)
        connection.link.send(message)
        self._guide(connection, now)
        return sent

    def _position(
        self, setpoint: PositionSetpoint, connection: Connection, now: float
    ) -> tuple[Message, Setpoint]:
        wanted = self._cruise if setpoint.speed is None else float(setpoint.speed)
        speed = min(wanted, self._speed)
        odometry = self._odometry(connection.frame, known=True)
        target = self._target.towards(
            setpoint.position,
            setpoint.yaw,
            speed,
            vehicle=odometry.position,
            velocity=odometry.velocity,
            facing=odometry.yaw,
            now=now,
            waits=self._phase.shown is not FlightMode.GUIDED,
        )
        message = position_message(target, connection.frame, connection.target, now)
        return message, PositionSetpoint(setpoint.position, setpoint.yaw, speed)

    def _velocity(
        self, setpoint: VelocitySetpoint, connection: Connection, now: float
    ) -> tuple[Message, Setpoint]:
        self._target.forget()
        across = limit_length(setpoint.velocity[:2], self._speed)
        up = float(np.clip(setpoint.velocity[2], -self._climb_rate, self._climb_rate))
        rate = float(np.clip(setpoint.yaw_rate, -self._turn_rate, self._turn_rate))
        sent = VelocitySetpoint(np.array([across[0], across[1], up]), rate)
        return velocity_message(sent, connection.target, now), sent

    def _guide(self, connection: Connection, now: float) -> None:
        """See that the autopilot follows what is being streamed."""
        phase = self._phase
        if phase.wish is FlightMode.GUIDED and phase.seen:
            return
        if now - self._stream_since < connection.autopilot.stream_before:
            return
        if phase.shown is FlightMode.GUIDED and phase.wish in {None, FlightMode.TAKE_OFF}:
            phase.ask(FlightMode.GUIDED, now)
        elif now - self._guided_asked_at > _ASK_AGAIN:
            self._guided_asked_at = now
            self._change(FlightMode.GUIDED)

    def hold(self) -> None:
        """Stop and stay by the autopilot's own mode; raise VehicleError on the ground."""
        with self._lock:
            self._require_flight("hold")
            self._change(FlightMode.HOLD)

    def return_home(self) -> None:
        """Return to the place of take-off and land there, by the autopilot's own mode."""
        with self._lock:
            self._require_flight("return home", climbing=True)
            self._change(FlightMode.RETURN)

    def land(self) -> None:
        """Land here; does nothing on the ground. Raises VehicleError when somebody else flies."""
        with self._lock:
            self._connected()
            if self._climb is not None or self._phase.armed:
                if self._phase.armed:
                    self._require_flight("land", climbing=True, landing=True)
                self._change(FlightMode.LAND)

    def _change(self, wish: FlightMode) -> None:
        connection = self._connected()
        if self._climb is not None and wish is not FlightMode.GUIDED:
            self._climb.cancel()
            self._climb = None
        now = time.monotonic()
        self._phase.ask(wish, now)
        order = connection.autopilot.ask_mode(wish)

        def done(outcome: Outcome) -> None:
            if not outcome.accepted and self._phase.wish is wish:
                said = "; ".join(self._telemetry.texts.recent(time.monotonic(), _REASONS))
                _log.warning("%s: %s: %s %s", self._name, order.what, outcome.text, said)

        connection.commander.give(
            order, done, still=lambda: self._phase.wish is wish and not self._phase.seen, now=now
        )

    def upload_mission(
        self, items: Sequence[Item], progress: Progress = lambda _, __: None
    ) -> None:
        """Put `items` in the place of the mission on the vehicle; waits, raises VehicleError."""
        upload(self._connected().link, items, mavlink.MAV_MISSION_TYPE_MISSION, progress)

    def download_mission(self, progress: Progress = lambda _, __: None) -> list[Item]:
        """The mission on the vehicle; waits, raises VehicleError."""
        return download(self._connected().link, mavlink.MAV_MISSION_TYPE_MISSION, progress)

    @property
    def connection(self) -> Connection:
        """Link, autopilot and frame of the connected vehicle; raises VehicleError before."""
        return self._connected()

    @property
    def connected(self) -> bool:
        """Whether there is a connected vehicle."""
        return self._connection is not None

    @property
    def telemetry(self) -> Telemetry:
        """The newest of everything that the vehicle has said, in its own frames."""
        return self._telemetry

    @property
    def parameters(self) -> Parameters:
        """The parameters of the connected vehicle."""
        connection = self._connected()
        return Parameters(connection.link, connection.autopilot)

    def _take(self, message: Message, now: float) -> None:
        """The vehicle has said something; in the link's thread."""
        kind = message.get_type()
        with self._lock:
            if self._commander is None:
                if kind == "HEARTBEAT":
                    self._finder.take(message)
                return
            self._telemetry.take(message, now)
            if kind == "COMMAND_ACK":
                self._commander.take(message, now)
            elif kind == "HEARTBEAT":
                self._observe(now)

    def _observe(self, now: float) -> None:
        found, telemetry, phase = self._finder.found, self._telemetry, self._phase
        assert found is not None  # noqa: S101 - it speaks
        shown = found.autopilot.mode(telemetry.custom_mode)
        was_armed = phase.armed
        phase.observe(shown, now, armed=telemetry.armed, critical=telemetry.critical)
        if was_armed and not phase.armed and self._climb is not None:
            self._climb.fail("it stopped its motors again")
        if phase.taken is not None and self._told is None:
            name = found.autopilot.mode_name(telemetry.custom_mode)
            said = "; ".join(telemetry.texts.recent(now, _REASONS))
            _log.warning("%s: the mode is %r now, not by us; %s", self._name, name, said)
        self._told = phase.taken
        if phase.taken is not None and self._climb is not None:
            self._climb.cancel()
            self._climb = None

    def _turned(self, now: float) -> None:
        """20 times a second, in the link's thread."""
        with self._lock:
            if self._commander is None or self._rates is None:
                return
            self._commander.turn(now)
            self._rates.turn(self._telemetry, now)
            if self._climb is not None and self._telemetry.position is not None:
                up, rise = -self._telemetry.position[2], -self._telemetry.velocity[2]
                if self._climb.turn(now, float(up), float(rise)):
                    self._climb = None
                elif self._climb.ordered:
                    self._climb_on(now)
            self._mind_the_loop(now)

    def _climb_on(self, now: float) -> None:
        """Fly the rest ourselves: PX4 calls its take-off done up to 0.8 m below its height."""
        connection, climb = self._connection, self._climb
        done = self._phase.seen and self._phase.shown in {FlightMode.HOLD, FlightMode.GUIDED}
        done &= self._finder.found is not None and self._finder.found.autopilot.stops_short
        if connection is None or climb is None or not done or not self._watchdog.healthy(now):
            return
        if self._climb_place is None:
            self._climb_place = self._odometry(connection.frame, known=True).position
        rest = connection.frame.position(np.array([0.0, 0.0, -climb.goal]))[2]
        place = np.array([*self._climb_place[:2], rest])
        self._steer(PositionSetpoint(place, None, self._climb_rate), connection, now)

    def _mind_the_loop(self, now: float) -> None:
        """If the loop above hangs, hold; if it does not come back, return.

        An autopilot may follow its last target for ever, and heartbeats alone do not stop it.
        """
        if self._connection is None or not self._ours_in_the_air() or self._watchdog.healthy(now):
            self._left_alone = None
            return
        step = FlightMode.RETURN if self._watchdog.gone(now) else FlightMode.HOLD
        steered = self._phase.wish is FlightMode.GUIDED
        if step is not self._left_alone and (steered or step is FlightMode.RETURN):
            self._left_alone = step
            _log.warning("%s: the control loop is silent: %s", self._name, step.value)
            self._change(step)

    def _connected(self) -> Connection:
        if self._connection is None:
            raise VehicleError(f"{self._name} is not connected; call connect first")
        return self._connection

    def _require_flight(
        self, deed: str, *, climbing: bool = False, landing: bool = False
    ) -> Connection:
        connection, mode = self._connected(), self._mode()
        if mode is VehicleMode.MANUAL:
            raise VehicleError(f"{self._name} cannot {deed}: a pilot flies it")
        if mode is VehicleMode.FAILSAFE:
            raise VehicleError(f"{self._name} cannot {deed}: its own protection flies it")
        if mode is VehicleMode.GROUNDED:
            raise VehicleError(f"{self._name} cannot {deed} on the ground; take off first")
        allowed = mode in _STEERED
        allowed |= climbing and mode is VehicleMode.TAKING_OFF
        allowed |= landing and mode is VehicleMode.LANDING
        if not allowed:
            doing = mode.value.replace("_", " ")
            raise VehicleError(f"{self._name} cannot {deed} while it is {doing}")
        return connection
