"""Driver of PX4 and ArduCopter over MAVLink."""

from __future__ import annotations

import logging
import math
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import ClassVar

import numpy as np

from aerodaas.clock import Clock, ScaledClock
from aerodaas.config.model import EnvironmentConfig, RobotConfig
from aerodaas.config.sections.actuators import ACTUATOR_TYPES
from aerodaas.drivers.mavlink.component import (
    ComponentContext,
    MessageHandler,
    mavlink_components,
)
from aerodaas.drivers.mavlink.connecting import CHECKS, Connection, establish, require_answer
from aerodaas.drivers.mavlink.control.climb import ClimbCompletion
from aerodaas.drivers.mavlink.control.departure import Departure
from aerodaas.drivers.mavlink.control.mode_change import ModeChange, flight_objection
from aerodaas.drivers.mavlink.control.steering import Steering
from aerodaas.drivers.mavlink.control.watchdog import Watchdog
from aerodaas.drivers.mavlink.microservices.commander import Commander
from aerodaas.drivers.mavlink.microservices.parameters import Parameters
from aerodaas.drivers.mavlink.one_link import check_links, link_of
from aerodaas.drivers.mavlink.settings import MavlinkSettings, mavlink_settings
from aerodaas.drivers.mavlink.state.phase import PROTECTIVE, FlightMode, FlightPhase
from aerodaas.drivers.mavlink.state.reporting import REASONS, VehicleReport
from aerodaas.drivers.mavlink.state.telemetry import Telemetry
from aerodaas.drivers.mavlink.state.touchdown import Touchdown
from aerodaas.drivers.mavlink.wire.finder import Finder, FoundVehicle
from aerodaas.drivers.mavlink.wire.link import MavlinkLink, Message
from aerodaas.drivers.mavlink.wire.rates import RateKeeper
from aerodaas.drivers.pin import Peer
from aerodaas.drivers.setpoints import require_finite
from aerodaas.errors import ConfigError, InvalidWaypointError, VehicleError
from aerodaas.messages.health import HealthReadings
from aerodaas.messages.vehicle import Capabilities, Setpoint, VehicleMode, VehicleState

__all__ = ["MavlinkVehicle"]

_log = logging.getLogger(__name__)

_PARTING = 4.0
"""Seconds that `close` waits for a landing in the air to begin, and for starting motors to stop."""


class MavlinkVehicle:
    """One multicopter with PX4 or ArduPilot; a `ClockedVehicle`.

    One thread at a time may use it, except the link's own. Raises ConfigError for unknown settings.
    """

    settings_model = MavlinkSettings
    actuator_types: ClassVar[frozenset[str]] = ACTUATOR_TYPES
    """What it can carry."""
    observing: ClassVar[Mapping[str, bool]] = {"observe": True}
    """Settings with which a connection changes nothing at the vehicle, for who only watches it."""
    link_of = staticmethod(link_of)
    check_links = staticmethod(check_links)

    def __init__(self, robot: RobotConfig, environment: EnvironmentConfig) -> None:
        """Prepare for `robot`; nothing is sent or opened."""
        self._robot = robot
        self._name = robot.id
        self._settings = settings = mavlink_settings(robot)
        home = environment.home
        self._home = home.origin if home else None
        if settings.frame == "home" and self._home is None:
            raise ConfigError(f'{robot.id}: "frame": "home" needs a home in the environment file')
        self._clock: Clock = ScaledClock()
        self._lock = threading.RLock()
        self._link: MavlinkLink | None = None
        self._forget()

    def _forget(self) -> None:
        limits = self._robot.limits
        self._telemetry = Telemetry(measures_ground=limits.rangefinder_clearance > 0.0)
        self._phase = FlightPhase()
        self._watchdog = Watchdog()
        self._touchdown = Touchdown()
        context = ComponentContext(
            self._robot,
            self._settings,
            self._telemetry,
            self._phase,
            self._change,
            self._lock,
            self._mission_time,
        )
        self.equipment = mavlink_components(context)
        """What extensions bring."""
        self._report = VehicleReport(self._telemetry, self._phase, self._touchdown, self.equipment)
        self._steering = Steering(self._robot, self._settings)
        self._words: deque[str] = deque()
        self._finder = Finder(self._settings)
        self._connection: Connection | None = None
        self._commander: Commander | None = None
        self._rates: RateKeeper | None = None
        self._departure: Departure | None = None
        self._modes: ModeChange | None = None
        self._completion = ClimbCompletion(self._telemetry, self._phase)
        self._checked_at = -math.inf
        self._told: VehicleMode | None = None
        self._component_handlers: dict[str, MessageHandler] = {}
        """Handlers of messages that are no word of the autopilot, by their name."""
        self._handlers: dict[str, MessageHandler] = {
            "COMMAND_ACK": self._on_command_ack,
            "HEARTBEAT": self._on_heartbeat,
            "LOCAL_POSITION_NED": self._on_local_position,
            "GLOBAL_POSITION_INT": self._on_global_position,
            "EXTENDED_SYS_STATE": self._on_landed_state,
        }
        """Handlers of the autopilot's messages by their name, after the telemetry."""
        for component in self.equipment:
            handlers = self._component_handlers if component.senders else self._handlers
            handlers |= component.handlers

    def _mission_time(self) -> int:
        return self._clock.now()

    @property
    def capabilities(self) -> Capabilities:
        """Capabilities of this driver."""
        settings = self._settings
        known = Capabilities("mavlink", max_speed=settings.max_speed, max_climb=settings.max_climb)
        if self._connection is None:
            return known
        connection = self._connection
        autopilot, stranded = connection.autopilot, connection.fallback.obstacles
        return replace(known, alone=autopilot.alone if stranded else autopilot.comes_home)

    def use_clock(self, clock: Clock) -> None:
        """Stamp states by `clock` from now on; the calling thread is the control loop."""
        self._clock = clock
        self._watchdog.belong()

    def connect(self, timeout: float = 10.0) -> None:
        """Find the vehicle within `timeout` seconds, and wait for its position.

        The latter may take `ready_timeout` seconds more: an autopilot needs up to a minute after
        its start. Raises VehicleError with what is missing.
        """
        self.close()
        self._forget()
        link = MavlinkLink(
            self._name,
            self._settings,
            on_message=self._on_message,
            on_turn=self._turned,
            on_component=self._on_component_message,
            component_ids=frozenset().union(*(one.component_ids for one in self.equipment)),
            healthy=self._watchdog.healthy,
            stands=self._stands,
            messages=self._telemetry.messages | self._handlers.keys(),
            equipment={name: one.senders for one in self.equipment for name in one.handlers},
        )
        link.open()
        self._link = link
        try:
            found = self._find(link, time.monotonic() + timeout)
            target = (found.system, found.component)
            link.adopt(target, found.peer, time.monotonic())
            with self._lock:
                telemetry = self._telemetry
                commander = Commander(link.send, target, self._settings.sender, telemetry.in_touch)
                self._rates = RateKeeper(found.autopilot, commander, self._report.rates)
                self._departure = Departure(
                    commander,
                    self._telemetry,
                    self._phase,
                    disarm=found.autopilot.disarm(),
                    hold=found.autopilot.ask_mode(FlightMode.HOLD),
                    flies=lambda: self._touchdown.flew,
                    words=self._reasons,
                    land=lambda: self._change(FlightMode.LAND),
                    short=found.autopilot.stops_short,
                )
                self._report.autopilot, self._report.departure = found.autopilot, self._departure
                self._modes = ModeChange(
                    found.autopilot,
                    commander,
                    self._departure,
                    self._phase,
                    words=lambda: self._telemetry.texts.recent(time.monotonic(), REASONS),
                    tell=self._words.append,
                )
                self._commander = commander
            if found.signs and link.key is None:
                require_answer(commander, self._name, self._pause)
            self._connection = establish(
                link,
                found.autopilot,
                commander,
                self._departure,
                self._telemetry,
                robot=self._robot,
                settings=self._settings,
                home=self._home,
                pause=self._pause,
            )
            self._report.alignment = self._connection.alignment
            self._connection.alignment.require_same_boot()
            for component in self.equipment:
                component.connect(self._connection)
        except BaseException:
            self.close()
            raise

    def _find(self, link: MavlinkLink, deadline: float) -> FoundVehicle:
        while (found := self._finder.found) is None:
            if time.monotonic() >= deadline:
                raise VehicleError(f"{self._name}: {self._finder.explain(link.counts)}")
            self._pause()
        return found

    def _pause(self) -> None:
        self._watchdog.feed()
        time.sleep(0.02)

    def close(self) -> None:
        """Disconnect; a vehicle in the air that this driver flies is commanded to land."""
        link, self._link = self._link, None
        if link is None:
            return
        if self._connection is not None:
            self._part(self._connection)
            for component in self.equipment:
                component.close(self._pause)
            if self._settings.fallback == "set" and not self._settings.observe:
                self._connection.put_back(self._name, stands=self._stands())
        link.close()
        self._connection = None
        self._log()

    def _part(self, connection: Connection) -> None:
        departure, phase = connection.departure, self._phase
        with self._lock:
            if departure.climbs:
                departure.call_off(time.monotonic())
            elif not (phase.ours or departure.withdrawing):
                return
        deadline = time.monotonic() + _PARTING
        while time.monotonic() < deadline:
            with self._lock:
                if phase.ours and not departure.withdrawing:
                    self._change(FlightMode.LAND)
            if (
                phase.taken is not None
                or phase.shown is FlightMode.LAND
                or not (departure.withdrawing or phase.armed)
            ):
                return
            self._pause()

    def _stands(self) -> bool:
        """Whether it stands with still motors, and no take-off is under way; by its last word."""
        with self._lock:
            departure = self._departure
            leaves = departure is not None and (departure.climbs or departure.withdrawing)
            return not (self._phase.armed or self._touchdown.falling or leaves)

    def read(self) -> VehicleState:
        """Return the newest state; raise VehicleError if not connected."""
        self._watchdog.feed()
        with self._lock:
            link, now = self._connected().link, time.monotonic()
            return self._report.state(self._clock.now(), now, link.counts, link.reports(now))

    @property
    def sea_level(self) -> float | None:
        """Metres above mean sea level of our frame's zero, by its altitude; None: not known."""
        with self._lock:
            return None if self._connection is None else self._connection.alignment.sea_level

    def health(self) -> HealthReadings:
        """Health as the vehicle tells it; raises VehicleError if not connected."""
        with self._lock:
            obstacles = self._connected().fallback.obstacles
            stranded = None if self._settings.fallback == "ignore" else obstacles
            return self._report.health(time.monotonic(), stranded)

    def preflight(self) -> list[str]:
        """Reasons against a take-off now; empty when ready."""
        with self._lock:
            if self._link is None or self._connection is None:
                return ["not connected"]
            now = time.monotonic()
            if self._report.lost(now):
                silent = self._telemetry.silence(now)
                if silent < 1.0:
                    return ["no HEARTBEAT from the vehicle since its link is back"]
                return [f"no word from the vehicle for {silent:.0f} s"]
            reasons = []
            if self._phase.armed:
                reasons.append(f"already {self._report.mode.value.replace('_', ' ')}")
            elif self._connection.departure.withdrawing:
                reasons.append("a take-off that was called off is not over yet")
            if not self._knows_place(now):
                reasons.append("the autopilot does not know its position")
                reasons += filter(None, [self._telemetry.health.gps_objection])
            reasons += self._connection.fallback.objections + self._report.objections(now)
            said = self._connection.autopilot.objections(self._telemetry, now)
            if said and now - self._checked_at > CHECKS:
                self._checked_at = now
                self._connection.commander.give(self._connection.autopilot.check(), now=now)
            return reasons + said

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
        self._require_control("take off")
        with self._lock:
            connection = self._connected()
            departure = connection.departure
            if departure.climbs:
                return
            refusal, departure.refusal = departure.refusal, ""
            reasons = [refusal] if refusal else self.preflight()
            if reasons:
                raise VehicleError(f"{self._name} refuses to take off: {'; '.join(reasons)}")
            self._completion.begin()
            orders = connection.autopilot.take_off(height, self._telemetry)
            departure.begin(orders, height, time.monotonic())

    def _reasons(self) -> list[str]:
        """The autopilot's texts about its latest refusal; in the link's thread."""
        now = time.monotonic()
        texts = self._telemetry.texts.recent(now, REASONS)
        if self._connection is None:
            return texts
        # Its objections to a take-off come first: a text of late may be about something else.
        objections = self._connection.autopilot.objections(self._telemetry, now)
        return list(dict.fromkeys([*objections, *texts]))

    def send(self, setpoint: Setpoint) -> Setpoint:
        """Send one setpoint and return it after clipping to the limits of the vehicle.

        Setpoints are sent from the first call on; the autopilot is commanded to follow them when
        it has received enough of them, and holds until then. Without a position it is commanded
        to stand still. Raises InvalidWaypointError for numbers that are not finite, and
        VehicleError on the ground, during take-off and landing, and when another pilot flies.
        """
        require_finite(self._name, setpoint)
        self._watchdog.feed()
        with self._lock:
            connection = self._require_flight("follow a setpoint")
            return self._steer(setpoint, connection, time.monotonic())

    def _steer(self, setpoint: Setpoint, connection: Connection, now: float) -> Setpoint:
        knows = self._telemetry.knows_place(now)
        frame = connection.alignment.frame if knows else None
        message, sent = self._steering.message(
            setpoint,
            self._report.odometry(frame, known=True),
            frame,
            connection.target,
            now,
            waits=self._phase.shown is not FlightMode.GUIDED,
        )
        connection.link.send(message)
        if not any(component.changes_mode for component in self.equipment):
            before = connection.autopilot.stream_before
            self._steering.see_to_guidance(self._phase, before, self._change, now)
        return sent

    def _knows_place(self, now: float) -> bool:
        aligned = self._connection is not None and self._connection.alignment.frame is not None
        return aligned and self._telemetry.knows_place(now)

    def hold(self) -> None:
        """Brake and hover by the autopilot's own mode; raise VehicleError on the ground."""
        with self._lock:
            self._require_flight("hold")
            self._change(FlightMode.HOLD)

    def return_home(self) -> None:
        """Return to the place of take-off and land there, by the autopilot's own mode."""
        with self._lock:
            connection = self._require_flight("return home", climbing=True)
            if connection.departure.climbs and not self._touchdown.flew:
                connection.departure.call_off(time.monotonic())
            else:
                self._change(FlightMode.RETURN)

    def land(self) -> None:
        """Land here; does nothing on the ground. Raises VehicleError while another pilot flies.

        A take-off in progress is withdrawn: the mode is LANDING until its motors certainly stand.
        """
        with self._lock:
            connection = self._connected()
            if connection.departure.climbs:
                connection.departure.call_off(time.monotonic())
            elif self._phase.armed and not connection.departure.withdrawing:
                self._require_flight("land", climbing=True, landing=True)
                if self._touchdown.flew:
                    self._change(FlightMode.LAND)
                else:
                    # A landing mode does not stop motors before the first lift-off.
                    connection.departure.withdraw(time.monotonic())

    def _change(self, wish: FlightMode, *refused: Callable[[str], None]) -> None:
        self._connected()
        assert self._modes is not None  # noqa: S101 - made before the connection
        self._modes.ask(wish, *refused)

    def grounded_link(self, deed: str) -> MavlinkLink:
        """The link of a vehicle that stands, for services that need much of it.

        Args:
            deed: What the link is needed for, as an error says it: "fetch logs".

        Raises:
            VehicleError: If the vehicle is not connected, or does not stand.
        """
        connection = self._connected()
        if not self._stands():
            raise VehicleError(f"{self._name} cannot {deed} in flight: its link is needed")
        return connection.link

    @property
    def connection(self) -> Connection:
        """Link, autopilot and frame of the connected vehicle; raises VehicleError before."""
        return self._connected()

    @property
    def connected(self) -> bool:
        """Whether a vehicle is connected."""
        return self._connection is not None

    @property
    def telemetry(self) -> Telemetry:
        """The newest messages of the vehicle, in its own frames."""
        return self._telemetry

    @property
    def parameters(self) -> Parameters:
        """The parameters of the connected vehicle."""
        connection = self._connected()
        return Parameters(connection.link, connection.autopilot)

    def _on_message(self, message: Message, now: float, peer: Peer) -> None:
        """Process a message of the vehicle; in the link's thread."""
        kind = message.get_type()
        with self._lock:
            if self._commander is None:
                if kind == "HEARTBEAT":
                    self._finder.on_heartbeat(message, peer)
                return
            if kind in self._component_handlers:
                self._component_handlers[kind](message, now)
                return
            reboots = self._telemetry.reboots
            self._telemetry.on_message(message, now)
            if self._telemetry.reboots != reboots:
                self._restarted()
            if kind in self._handlers:
                self._handlers[kind](message, now)

    def _on_component_message(self, message: Message, now: float) -> None:
        """Process a message of a component with an id of its own; in the link's thread."""
        with self._lock:
            for component in self.equipment:
                if message.get_srcComponent() in component.component_ids:
                    component.on_component_message(message, now)

    def _restarted(self) -> None:
        """Handle a restart of the autopilot; its first messages may have been processed."""
        self._touchdown.restart(self._telemetry.heard_at)
        flew = self._touchdown.falling or bool(self._touchdown.fault)
        self._report.restarted = f"autopilot: it started anew{' in flight' if flew else ''}"
        if self._connection is not None:
            self._connection.alignment.restart(stands=not flew)
            self._connection.departure.restart()

    def _on_command_ack(self, message: Message, now: float) -> None:
        assert self._commander is not None  # noqa: S101 - it is found
        self._commander.on_ack(message, now)

    def _on_local_position(self, _: Message, now: float) -> None:
        telemetry = self._telemetry
        if telemetry.position_at != now:
            return
        assert telemetry.position is not None  # noqa: S101 - it has just come
        up, rise = -float(telemetry.position[2]), -float(telemetry.velocity[2])
        self._touchdown.move(up, rise, float(np.linalg.norm(telemetry.velocity)), now)
        if self._connection is not None:
            self._connection.alignment.move()

    def _on_global_position(self, _: Message, now: float) -> None:
        if self._connection is not None:
            sure = self._telemetry.health.sure_of_position
            self._connection.alignment.place(now, sure=sure)

    def _on_landed_state(self, _: Message, now: float) -> None:
        self._touchdown.report(now, on_ground=self._telemetry.on_ground)

    def _on_heartbeat(self, _: Message, now: float) -> None:
        found, telemetry, phase = self._finder.found, self._telemetry, self._phase
        assert found is not None  # noqa: S101 - it speaks
        shown = found.autopilot.mode(telemetry.custom_mode)
        was_armed = phase.armed
        # Only ArduPilot's fence acts without a critical state.
        critical = telemetry.critical or (bool(telemetry.breach) and shown in PROTECTIVE)
        phase.observe(
            shown,
            now,
            armed=telemetry.armed,
            critical=critical,
            climbed=self._departure is not None and self._departure.climbed,
        )
        self._touchdown.observe(shown, now, armed=telemetry.armed)
        if telemetry.armed and not was_armed:
            self._report.restarted = ""
        if self._departure is not None:
            self._departure.observe(now, was_armed=was_armed)
        if phase.taken is not None and self._told is None:
            name = found.autopilot.mode_name(telemetry.custom_mode)
            said = "; ".join(telemetry.texts.recent(now, REASONS))
            self._words.append(f"the mode is {name!r} now, not by us; {said}")
        self._told = phase.taken

    def _turned(self, now: float) -> None:
        """Called 20 times a second, in the link's thread."""
        with self._lock:
            if self._commander is None or self._rates is None:
                return
            self._commander.step(now)
            self._rates.step(self._telemetry, now)
            self._touchdown.update(now)
            for component in self.equipment:
                component.step(now)
            if self._connection is not None:
                self._connection.departure.update(now)
                self._climb_on(self._connection, now)
                if request := self._telemetry.boot_clock.request(self._connection.target[0]):
                    self._connection.link.send(request)
            self._mind_the_loop(now)
        self._log()

    def _log(self) -> None:
        """Log outside the lock and never in the loop's thread in flight: logging may block."""
        while self._words:
            _log.warning("%s: %s", self._name, self._words.popleft())

    def _climb_on(self, connection: Connection, now: float) -> None:
        """Complete a take-off by setpoints, where the autopilot stops short."""
        goal, frame = connection.departure.goal, connection.alignment.frame
        able = connection.autopilot.stops_short > 0.0 and self._watchdog.healthy(now)
        if goal is None or frame is None or not able:
            return
        odometry = partial(self._report.odometry, frame, known=True)
        climb, near = (
            self._steering.climb_rate,
            self._touchdown.flew and connection.departure.climbed,
        )
        if setpoint := self._completion.setpoint(goal, frame, odometry, climb, near=near):
            self._steer(setpoint, connection, now)

    def _mind_the_loop(self, now: float) -> None:
        """Hold if the control loop hangs; return home if it does not recover.

        An autopilot may follow its last target for ever, and heartbeats alone do not stop it.
        """
        able = self._connection is not None and self._telemetry.in_touch(now)
        step = self._watchdog.step(now, self._phase) if able else None
        if step is not None:
            self._words.append(f"the control loop is silent: {step.value}")
            self._change(step)

    def _connected(self) -> Connection:
        if self._connection is None:
            raise VehicleError(f"{self._name} is not connected; call connect first")
        return self._connection

    def _require_control(self, deed: str) -> None:
        if self._settings.observe:
            raise VehicleError(f'{self._name} cannot {deed}: with "observe" it is only looked at')

    def _require_flight(
        self, deed: str, *, climbing: bool = False, landing: bool = False
    ) -> Connection:
        connection, mode = self._connected(), self._report.mode
        self._require_control(deed)
        if objection := flight_objection(mode, climbing=climbing, landing=landing):
            raise VehicleError(f"{self._name} cannot {deed}{objection}")
        return connection
