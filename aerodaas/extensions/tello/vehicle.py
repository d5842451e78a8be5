"""Driver of the DJI Ryze Tello."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from aerodaas.clock import NANOSECONDS, Clock, ScaledClock
from aerodaas.config.model import EnvironmentConfig, RobotConfig
from aerodaas.drivers.setpoints import require_finite, slowed
from aerodaas.errors import InvalidWaypointError, VehicleError
from aerodaas.extensions.tello.commands import (
    ENTER,
    LAND,
    STILL,
    TAKE_OFF,
    BodyMotion,
    Command,
    StickScale,
)
from aerodaas.extensions.tello.link import TelloLink, explain_no_states, greet, meaning
from aerodaas.extensions.tello.phase import LIFTED, FlightPhase
from aerodaas.extensions.tello.reckoning import DeadReckoning
from aerodaas.extensions.tello.settings import TelloSettings, tello_settings, video_port
from aerodaas.extensions.tello.state import BatteryGauge, TelloState
from aerodaas.geometry.braking import limit_length, velocity_towards
from aerodaas.geometry.frames import Vector, enu_to_body, wrap_angle
from aerodaas.messages.health import HealthReadings
from aerodaas.messages.vehicle import (
    Capabilities,
    PositionSetpoint,
    Setpoint,
    VehicleMode,
    VehicleState,
    VelocitySetpoint,
)

__all__ = ["TelloVehicle"]

_LOST_AFTER = 1.0
"""Seconds without a state packet, sent ten times a second, after which the Tello counts as lost."""
_BLIND_AFTER = 0.5
"""Seconds without a state packet after which it hovers instead of obeying setpoints."""
_GREET_AGAIN = 2.0
"""Seconds between handshakes with a silent Tello on the ground."""
_LAND_AGAIN = 3.0
"""Seconds after which a landing is commanded again if no packet shows a descent: replies have no
id, so another command's may have been taken for this one's."""
_DESCENDING = 0.1
"""m/s."""
_DOWN = 0.2
"""Metres above the ground at which it stands, or is about to."""
_HOT = 85.0
"""Degrees Celsius inside that raise an alert; it switches itself off a little above."""
_BRAKING = 1.0
"""Deceleration in m/s^2 assumed when flying to a position."""
_REACTION = 0.3
"""Seconds from a setpoint to its effect, Wi-Fi and its own controller included (assumed)."""
_AT_REST = 0.08
"""Metres from its target within which its own position hold is better than ours."""
_FACING = math.radians(2.0)
_CLIMBED = 0.15
"""Tolerance of the take-off height, metres."""
_CLIMB_MARGIN = 3.0
"""Seconds that a take-off's climb may exceed its longest expected time."""


class TelloVehicle:
    """A DJI Ryze Tello; implements `aerodaas.messages.vehicle.Vehicle`.

    All motion is by `rc`: velocities directly, positions by our own loop on dead reckoning, so that
    a target can change at any time and has no minimum distance. Each `send` is one `rc`: when the
    setpoint loop stops, the sticks are centred and the link becomes silent, so that the Tello
    lands by itself after 15 s. Its thread is the link's; all methods but
    `connect` and `close` return at once, and any thread may call them.

    Raises ConfigError if the robot's settings are not those of a `TelloSettings`.
    """

    settings_model = TelloSettings
    observing: ClassVar[Mapping[str, bool]] = {"observe": True}
    """Settings with which it is only looked at."""

    def __init__(self, robot: RobotConfig, environment: EnvironmentConfig) -> None:
        """Prepare for `robot`, standing at its start; nothing is sent or opened."""
        del environment
        self._name = robot.id
        self._settings = settings = tello_settings(robot)
        self._video_port = video_port(robot)
        self._scale = StickScale(
            settings.full_speed, settings.full_climb, math.radians(settings.full_turn)
        )
        limits = robot.limits
        self._speed = min(limits.max_speed, settings.full_speed)
        self._cruise = min(limits.cruise_speed, self._speed)
        self._climb = min(limits.max_climb, settings.full_climb)
        self._turn = math.radians(min(limits.max_yaw_rate, settings.full_turn))
        self._start = np.array(robot.start, dtype=np.float64)
        self._start_yaw = math.radians(robot.start_yaw)
        self._clock: Clock = ScaledClock()
        self._lock = threading.RLock()
        self._link: TelloLink | None = None
        self._forget()

    def _forget(self) -> None:
        self._phase = FlightPhase()
        self._gauge = BatteryGauge()
        self._reckoning = DeadReckoning(self._start, self._start_yaw)
        self._latest: TelloState | None = None
        self._heard_at = -math.inf
        self._greeted_at = 0.0
        self._landing_seen_at = 0.0
        self._climb_to = 0.0
        self._climb_until: float | None = None

    @property
    def capabilities(self) -> Capabilities:
        """Capabilities of this driver; a Tello has no return mode and no global position."""
        return Capabilities(
            "tello",
            global_position=False,
            returns_home=False,
            max_speed=self._settings.full_speed,
            max_climb=self._settings.full_climb,
            alone="its guard centres the sticks, and the Tello lands by itself 15 s later",
        )

    def use_clock(self, clock: Clock) -> None:
        """Stamp states by `clock` from now on."""
        self._clock = clock

    def connect(self, timeout: float = 10.0) -> None:
        """Enter SDK mode, switch the video on if a camera wants it, wait for the first state.

        Takes up to `timeout` seconds. Raises VehicleError that says which of these failed and what
        to do.
        """
        self.close()
        self._forget()
        link = TelloLink(self._name, self._settings, self._on_state, self._turned)
        link.open()
        self._link = link
        try:
            deadline = time.monotonic() + timeout
            greet(link, self._name, self._settings, self._video_port, deadline)
            while self._latest is None:
                self._await_state(link, deadline)
        except BaseException:
            self.close()
            raise

    def _await_state(self, link: TelloLink, deadline: float) -> None:
        if time.monotonic() >= deadline:
            raise VehicleError(explain_no_states(link, self._name, self._settings))
        time.sleep(0.02)

    def close(self) -> None:
        """Disconnect, which takes a moment; a Tello in the air is commanded to land.

        One that was only looked at is left to whoever flies it.
        """
        link, self._link = self._link, None
        if link is not None:
            ours = self._phase.airborne and not self._settings.observe
            link.close(LAND if ours else None)

    def read(self) -> VehicleState:
        """Return the newest state; raise VehicleError if not connected."""
        link = self._connected()
        with self._lock:
            latest = self._latest
            now = time.monotonic()
            silence = now - self._heard_at
            assert latest is not None  # noqa: S101 - connect waited for the first
            lost = silence > _LOST_AFTER
            self._predict(now)
            age = max(0.0, now - self._reckoning.time)
            counts = link.counts
            return VehicleState(
                max(0, self._clock.now() - int(age * NANOSECONDS)),
                self._reckoning.odometry,
                self._gauge.battery,
                VehicleMode.LOST if lost else self._phase.mode,
                self._phase.airborne,
                faults=tuple(self._faults(latest, silence)),
                extra={
                    "temperature": latest.temperature,
                    "ground_distance": latest.ground_distance,
                    "barometer": latest.barometer,
                    "motor_time": latest.motor_time,
                    "malformed_packets": counts.malformed,
                    "foreign_packets": counts.strangers,
                    "stray_replies": counts.stray_replies,
                    "unanswered_commands": counts.timeouts,
                },
                ended=self._phase.ended,
            )

    def health(self) -> HealthReadings:
        """The little that a Tello tells beyond its state; raises VehicleError if not connected."""
        self._connected()
        with self._lock:
            return HealthReadings(
                silence=time.monotonic() - self._heard_at,
                stranded=("it lands where it is, 15 s after our last word",),
            )

    def preflight(self) -> list[str]:
        """Reasons against a take-off now; empty when ready."""
        if self._link is None:
            return ["not connected"]
        with self._lock:
            reasons = []
            if time.monotonic() - self._heard_at > _LOST_AFTER:
                reasons.append("no word from the Tello")
            if self._phase.mode is VehicleMode.FAILSAFE:
                reasons.append(f"{self._phase.outcome}; connect again")
            elif self._phase.airborne:
                reasons.append(f"already {self._phase.mode.value.replace('_', ' ')}")
            charge, needed = self._gauge.battery.fraction, self._settings.battery_minimum
            if charge < needed:
                reasons.append(f"the battery holds {charge:.0%}, take-off needs {needed:.0%}")
            if self._latest is not None and self._latest.temperature >= _HOT:
                reasons.append(f"it is hot inside: {self._latest.temperature:.0f} °C; cool it")
            return reasons

    def take_off(self, height: float) -> None:
        """Take off to `height` metres: its own take-off to about one, then our climb.

        Raises VehicleError if preflight has objections, and the next time after the Tello itself
        has refused, with its words.
        """
        if not (math.isfinite(height) and height > 0.0):
            raise InvalidWaypointError(
                f"{self._name}: the take-off height must be a positive number of metres, "
                f"not {height!r}"
            )
        self._require_control("take off")
        with self._lock:
            refusal, self._phase.refusal = self._phase.refusal, ""
            reasons = [refusal] if refusal else self.preflight()
            if reasons:
                raise VehicleError(f"{self._name} refuses to take off: {'; '.join(reasons)}")
            self._climb_to = float(self._reckoning.odometry.position[2]) + height
            self._climb_until = None
            self._phase.to(VehicleMode.TAKING_OFF, time.monotonic())
            link = self._connected()
            link.release()
            link.request(TAKE_OFF, self._risen)

    def send(self, setpoint: Setpoint) -> Setpoint:
        """Send one setpoint as `rc` and return it after clipping to the limits of the Tello.

        Raises InvalidWaypointError for numbers that are not finite, and VehicleError on the
        ground, during take-off and while landing. Without state packets it hovers.
        """
        require_finite(self._name, setpoint)
        with self._lock:
            link = self._require_flight("follow a setpoint")
            now = time.monotonic()
            if now - self._heard_at > _BLIND_AFTER:
                # The relative position of a target is unknown now.
                link.steer(STILL)
                return VelocitySetpoint(np.zeros(3))
            self._predict(now)
            odometry = self._reckoning.odometry
            if isinstance(setpoint, PositionSetpoint):
                setpoint, _ = slowed(setpoint, self._cruise, self._speed)
                asked = self._towards(setpoint, odometry.position, odometry.yaw)
                velocity = self._clip(asked.velocity)
                yaw_rate = asked.yaw_rate
            else:
                velocity = self._clip(setpoint.velocity)
                yaw_rate = min(max(float(setpoint.yaw_rate), -self._turn), self._turn)
                setpoint = VelocitySetpoint(velocity, yaw_rate)
            body = enu_to_body(velocity, odometry.yaw)
            link.steer(self._scale.sticks(BodyMotion(body, yaw_rate)))
            self._phase.mode = VehicleMode.GUIDED
            return setpoint

    def hold(self) -> None:
        """Brake and hover by its own position hold; raise VehicleError on the ground."""
        with self._lock:
            self._require_flight("hold").steer(STILL)
            self._phase.mode = VehicleMode.HOLDING

    def return_home(self) -> None:
        """Land here: a Tello has no return mode, and is asked only when its position is unknown."""
        with self._lock:
            if not self._phase.airborne:
                raise VehicleError(f"{self._name} cannot return home on the ground; take off first")
            self.land()

    def land(self) -> None:
        """Land here; does nothing on the ground."""
        link = self._connected()
        self._require_control("land")
        with self._lock:
            if self._phase.airborne:
                self._phase.to(VehicleMode.LANDING, time.monotonic())
                link.release()
                self._ask_to_land(link)

    def _ask_to_land(self, link: TelloLink) -> None:
        """Command the landing; its packets, not the reply, show the descent and the touchdown."""
        self._landing_seen_at = time.monotonic()
        link.request(LAND, lambda _: None, urgent=True)

    def _on_state(self, state: TelloState, now: float) -> None:
        """Handle a state packet, in the link's thread."""
        with self._lock:
            self._latest, self._heard_at = state, now
            self._gauge.add(state.battery)
            self._phase.observe(state, now)
            self._predict(now)
            self._reckoning.correct(state, now, standing=not self._phase.airborne)

    def _turned(self, now: float) -> None:
        """Called 20 times a second, in the link's thread."""
        with self._lock:
            link = self._link
            if link is None:
                return
            self._predict(now)
            if self._phase.mode is VehicleMode.TAKING_OFF and self._phase.risen:
                self._climb_on(link, now)
            if self._phase.mode is VehicleMode.LANDING:
                self._see_landing_through(link, now)
            silent = self._latest is not None and now - self._heard_at > _GREET_AGAIN
            if silent and not self._phase.airborne and now - self._greeted_at > _GREET_AGAIN:
                # It may have been switched off and on, and wait for its handshake.
                self._greeted_at = now
                link.request(ENTER, lambda _: None)

    def _see_landing_through(self, link: TelloLink, now: float) -> None:
        """Repeat the command of a landing that no packet shows."""
        latest = self._latest if now - self._heard_at < _BLIND_AFTER else None
        if latest is not None and (
            latest.velocity[2] >= _DESCENDING or latest.ground_distance < _DOWN
        ):
            self._landing_seen_at = now
        elif now - self._landing_seen_at > _LAND_AGAIN:
            self._ask_to_land(link)

    def _climb_on(self, link: TelloLink, now: float) -> None:
        """Continue a take-off, without setpoints, for a limited time."""
        up = self._climb_to - float(self._reckoning.odometry.position[2])
        if self._climb_until is None:
            self._climb_until = now + _CLIMB_MARGIN + 2.0 * abs(up) / self._climb
        blind = now - self._heard_at > _BLIND_AFTER
        if abs(up) <= _CLIMBED or blind or now > self._climb_until:
            link.steer(STILL)
            self._phase.to(VehicleMode.HOLDING, now)
            return
        speed = math.copysign(min(self._climb, max(0.15, abs(up))), up)
        link.steer(self._scale.sticks(BodyMotion(np.array([0.0, 0.0, speed]))))

    def _risen(self, reply: str | None) -> None:
        """Handle the reply to `takeoff`, or its timeout, in the link's thread."""
        with self._lock:
            flying = self._latest is not None and self._latest.height >= LIFTED
            if (reply is not None and Command.succeeded(reply)) or flying:
                self._phase.rose()
            elif reply is None:
                self._phase.rose("it did not answer to `takeoff` and does not fly")
            else:
                self._phase.rose(f"it answered {reply!r} ({meaning(reply)})")

    def _towards(self, target: PositionSetpoint, position: Vector, yaw: float) -> VelocitySetpoint:
        asked = velocity_towards(
            target,
            position,
            yaw,
            speed=self._cruise,
            deceleration=_BRAKING,
            reaction_time=_REACTION,
            yaw_rate=self._turn,
        )
        near = (
            target.passing_speed == 0.0
            and float(np.linalg.norm(target.position - position)) < _AT_REST
        )
        faces = target.yaw is None or abs(wrap_angle(target.yaw - yaw)) < _FACING
        return VelocitySetpoint(
            np.zeros(3) if near else asked.velocity, 0.0 if faces else asked.yaw_rate
        )

    def _clip(self, velocity: Vector) -> Vector:
        across = limit_length(velocity[:2], self._speed)
        up = min(max(float(velocity[2]), -self._climb), self._climb)
        return np.array([across[0], across[1], up])

    def _predict(self, now: float) -> None:
        """Advance the estimate, as long as packets arrive."""
        if self._link is not None and now - self._heard_at <= _LOST_AFTER:
            self._reckoning.predict(now, self._scale.motion(self._link.flown))

    def _faults(self, latest: TelloState, silence: float) -> list[str]:
        faults = []
        if silence > _LOST_AFTER:
            faults.append(f"no state packet for {silence:.0f} s")
        if latest.temperature >= _HOT:
            faults.append(f"it is hot inside: {latest.temperature:.0f} °C")
        charge = self._gauge.battery.fraction
        if charge < self._settings.battery_minimum:
            faults.append(f"the battery is low: {charge:.0%}")
        return faults

    def _connected(self) -> TelloLink:
        if self._link is None or self._latest is None:
            raise VehicleError(f"{self._name} is not connected; call connect first")
        return self._link

    def _require_control(self, deed: str) -> None:
        if self._settings.observe:
            raise VehicleError(f'{self._name} cannot {deed}: with "observe" it is only looked at')

    def _require_flight(self, deed: str) -> TelloLink:
        link, mode = self._connected(), self._phase.mode
        self._require_control(deed)
        if mode is VehicleMode.FAILSAFE:
            raise VehicleError(f"{self._name} cannot {deed}: {self._phase.outcome}")
        if mode is VehicleMode.GROUNDED:
            raise VehicleError(f"{self._name} cannot {deed} on the ground; take off first")
        if not self._phase.steered:
            doing = mode.value.replace("_", " ")
            raise VehicleError(f"{self._name} cannot {deed} while it is {doing}")
        return link
