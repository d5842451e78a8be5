"""Driver of any drone that publishes odometry and takes velocities on ROS 2 topics."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar

import numpy as np

from aerodaas.clock import NANOSECONDS, Clock, ScaledClock
from aerodaas.config.model import EnvironmentConfig, RobotConfig
from aerodaas.drivers.setpoints import require_finite
from aerodaas.errors import InvalidWaypointError, SourceError, VehicleError
from aerodaas.extensions.ros2.driver.feed import RosFeed
from aerodaas.extensions.ros2.driver.frames import Alignment
from aerodaas.extensions.ros2.driver.loop import STANDS_STILL, Limits, VelocityLoop
from aerodaas.extensions.ros2.driver.settings import Ros2Settings, ros2_settings
from aerodaas.extensions.ros2.driver.steering import Steering
from aerodaas.extensions.ros2.topics import types
from aerodaas.extensions.ros2.topics.link import RosLink, domain_of, require_dds
from aerodaas.messages.health import HealthReadings
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.vehicle import (
    Capabilities,
    Setpoint,
    VehicleMode,
    VehicleState,
    VelocitySetpoint,
)

__all__ = ["Ros2Vehicle"]

_PERIOD = 0.05
"""Seconds between turns of the loop."""
_LAST_WORDS = 5
"""Times that a drone in the air is told to stand still when it is let go of."""


class Ros2Vehicle:
    """A drone on ROS 2 topics; implements `aerodaas.messages.vehicle.Vehicle`.

    All motion is by velocities: those of setpoints, and a loop of our own at 20 Hz for take-off,
    hold and landing. Without setpoints for half a second it stops; without odometry it is told to
    stand still. ROS' services are not used. All methods but `connect` and `close` return at once,
    and any thread may call them.

    Raises ConfigError if the robot's settings are not those of a `Ros2Settings`.
    """

    settings_model = Ros2Settings
    observing: ClassVar[Mapping[str, bool]] = {"observe": True}
    """Settings with which it is only looked at."""

    def __init__(self, robot: RobotConfig, environment: EnvironmentConfig) -> None:
        """Prepare for `robot`; nothing is sent or opened."""
        del environment
        require_dds(f"robot {robot.id}: the driver ros2")
        self._name = robot.id
        self._settings = settings = ros2_settings(robot)
        self._domain = domain_of(settings.domain)
        limits = robot.limits
        speed = min(limits.max_speed, settings.max_speed)
        climb = min(limits.max_climb, settings.max_climb)
        self._limits = Limits(
            cruise=min(limits.cruise_speed, speed),
            speed=speed,
            climb=climb,
            landing=min(settings.landing_speed, climb),
            turn=math.radians(limits.max_yaw_rate),
        )
        self._start = np.array(robot.start, dtype=np.float64)
        self._start_yaw = math.radians(robot.start_yaw)
        self._clock: Clock = ScaledClock()
        self._lock = threading.RLock()
        self._link: RosLink | None = None
        self._closing = threading.Event()
        self._forget()

    def _forget(self) -> None:
        self._feed = RosFeed(self._settings.stamps, self._align)
        self._loop = VelocityLoop(self._limits, float(self._start[2]))
        self._steering: Steering | None = None
        self._seen: Odometry | None = None

    @property
    def capabilities(self) -> Capabilities:
        """Capabilities of this driver; it has no return mode."""
        return Capabilities(
            "ros2",
            global_position=self._settings.fix is not None,
            returns_home=False,
            max_speed=self._settings.max_speed,
            max_climb=self._settings.max_climb,
            alone="it flies on by its last velocity, unless its own autopilot stops it",
        )

    def use_clock(self, clock: Clock) -> None:
        """Stamp states by `clock` from now on."""
        self._clock = clock

    def connect(self, timeout: float = 10.0) -> None:
        """Join the domain and wait for the first odometry, up to `timeout` seconds.

        Raises VehicleError that says which topics there are, and what was wrong with the odometry.
        """
        self.close()
        self._forget()
        self._closing = threading.Event()
        try:
            link = RosLink(self._domain)
        except SourceError as error:
            raise VehicleError(f"{self._name}: {error}") from error
        self._link = link
        try:
            self._subscribe(link)
            if not self._settings.observe:
                self._steering = Steering(link, self._settings)
            deadline = time.monotonic() + timeout
            while self._feed.odometry is None:
                self._await_odometry(link, deadline)
        except BaseException:
            self.close()
            raise
        with self._lock:
            self._loop.begin(self._feed.odometry)
        threading.Thread(target=self._run, name="ros2-loop", daemon=True).start()

    def _subscribe(self, link: RosLink) -> None:
        settings, feed = self._settings, self._feed
        link.subscribe(settings.odometry, types.ODOMETRY, feed.take_odometry)
        if settings.battery is not None:
            link.subscribe(settings.battery, types.BATTERY, feed.take_battery)
        if settings.fix is not None:
            link.subscribe(settings.fix, types.NAV_SAT_FIX, feed.take_fix)

    def _await_odometry(self, link: RosLink, deadline: float) -> None:
        if time.monotonic() < deadline:
            time.sleep(0.02)
            return
        topic = self._settings.odometry
        if self._feed.refusal:
            raise VehicleError(f"{self._name}: {topic}: {self._feed.refusal}")
        found = link.published()
        other = f", where {topic} is {found[topic]}" if topic in found else ""
        fitting = [name for name, kind in found.items() if kind == types.ODOMETRY]
        there = f"odometry is on {', '.join(fitting)}" if fitting else "there is no odometry at all"
        raise VehicleError(
            f"{self._name}: no odometry on {topic} in the ROS 2 domain {self._domain}{other}; "
            f"{there}, of {len(found)} topics that are published. Check the setting, "
            "ROS_DOMAIN_ID, and that the network carries multicast (docs/ros2.md)"
        )

    def close(self) -> None:
        """Let go, which takes a moment; a drone in the air is told to stand still."""
        link, self._link = self._link, None
        self._closing.set()
        if link is None:
            return
        with self._lock:
            if self._loop.airborne and self._steering is not None:
                for _ in range(_LAST_WORDS):
                    self._publish(STANDS_STILL)
                    time.sleep(_PERIOD)
            self._steering = None
        link.close()

    def read(self) -> VehicleState:
        """Return the newest state; raise VehicleError if not connected."""
        link, feed = self._connected(), self._feed
        with self._lock:
            odometry, age = feed.odometry, feed.age
            assert odometry is not None  # noqa: S101 - connect waited for the first
            lost = age > self._settings.odometry_timeout
            return VehicleState(
                max(0, self._clock.now() - int(age * NANOSECONDS)),
                odometry,
                feed.battery,
                VehicleMode.LOST if lost else self._loop.mode,
                self._loop.airborne,
                feed.fix,
                faults=tuple(self._faults(age)),
                extra={
                    "refused_messages": feed.refused,
                    "outdated_messages": feed.outdated,
                    "garbled_messages": link.garbled,
                },
                ended=self._loop.ended,
            )

    def _faults(self, age: float) -> list[str]:
        faults = []
        if age > self._settings.odometry_timeout:
            faults.append(f"no odometry on {self._settings.odometry} for {age:.0f} s")
        if self._feed.refusal:
            faults.append(self._feed.refusal)
        if self._loop.airborne and self._steering is not None and not self._steering.listeners:
            faults.append(f"nobody subscribes to {self._settings.velocity}")
        charge = self._feed.battery.fraction
        if charge < self._settings.battery_minimum:
            faults.append(f"the battery is low: {charge:.0%}")
        return faults

    def health(self) -> HealthReadings:
        """The little that topics tell; raises VehicleError if not connected."""
        self._connected()
        return HealthReadings(
            silence=self._feed.age,
            stranded=("it flies on by the last velocity that it was told",),
        )

    def preflight(self) -> list[str]:
        """Reasons against a take-off now; empty when ready."""
        if self._link is None:
            return ["not connected"]
        with self._lock:
            reasons = []
            if self._stale:
                reasons.append(f"no odometry on {self._settings.odometry}")
            if self._loop.airborne:
                high = self._odometry.height - float(self._start[2])
                reasons.append(
                    f"already {self._loop.mode.value.replace('_', ' ')}, {high:.1f} m above the "
                    "`start` of the environment file; if it stands there, set that"
                )
            if self._steering is not None and not self._steering.listeners:
                reasons.append(f"nobody subscribes to {self._settings.velocity}")
            charge, needed = self._feed.battery.fraction, self._settings.battery_minimum
            if charge < needed:
                reasons.append(f"the battery holds {charge:.0%}, take-off needs {needed:.0%}")
            if self._settings.battery is not None and math.isnan(charge):
                reasons.append(f"no charge on {self._settings.battery}")
            return reasons

    def take_off(self, height: float) -> None:
        """Switch the motors on, where a topic does, and climb by velocities.

        Raises VehicleError if preflight has objections.
        """
        if not (math.isfinite(height) and height > 0.0):
            raise InvalidWaypointError(
                f"{self._name}: the take-off height must be a positive number of metres, "
                f"not {height!r}"
            )
        self._require_control("take off")
        with self._lock:
            if reasons := self.preflight():
                raise VehicleError(f"{self._name} refuses to take off: {'; '.join(reasons)}")
            self._loop.take_off(height, self._odometry)

    def send(self, setpoint: Setpoint) -> Setpoint:
        """Publish one setpoint's velocity and return the setpoint as it was clipped.

        Raises InvalidWaypointError for numbers that are not finite, and VehicleError on the
        ground, during take-off and while landing. Without odometry it is told to stand still.
        """
        require_finite(self._name, setpoint)
        with self._lock:
            self._require_flight("follow a setpoint")
            if self._stale:
                self._publish(STANDS_STILL)
                return STANDS_STILL
            clipped, velocity = self._loop.guide(setpoint, self._odometry, time.monotonic())
            self._publish(velocity)
            return clipped

    def hold(self) -> None:
        """Brake and stay; raise VehicleError on the ground."""
        with self._lock:
            self._require_flight("hold")
            self._loop.hold(self._odometry)

    def return_home(self) -> None:
        """Land here: it has no return mode, and is asked only when its position is unknown."""
        with self._lock:
            if not self._loop.airborne:
                raise VehicleError(f"{self._name} cannot return home on the ground; take off first")
            self.land()

    def land(self) -> None:
        """Come down here; does nothing on the ground."""
        self._connected()
        self._require_control("land")
        with self._lock:
            if self._loop.airborne and self._loop.mode is not VehicleMode.LANDING:
                self._loop.land(None if self._stale else self._odometry)

    def _run(self) -> None:
        """Step the loop 20 times a second until the link is closed."""
        closing = self._closing
        while not closing.wait(_PERIOD):
            with self._lock:
                if not closing.is_set():
                    self._step(time.monotonic())

    def _step(self, now: float) -> None:
        odometry = None if self._stale else self._odometry
        if odometry is not None and odometry is not self._seen:
            self._seen = odometry
            self._loop.observe(odometry, now)
        before = self._loop.airborne
        asked = self._loop.step(odometry, now)
        if self._steering is None:
            return
        if asked is not None:
            self._publish(asked)
        if self._loop.mode is VehicleMode.TAKING_OFF:
            self._steering.motors_on(now)
        elif before and not self._loop.airborne:
            self._steering.motors_off()

    def _publish(self, velocity: VelocitySetpoint) -> None:
        if self._steering is None:
            return
        odometry = self._odometry
        if self._stale:
            # How it is tilted by now nobody knows.
            odometry = replace(odometry, roll=0.0, pitch=0.0)
        self._steering.steer(velocity, odometry, self._feed.alignment, self._feed.frames)

    def _align(self, first: Odometry) -> Alignment:
        if not self._settings.align_to_start:
            return Alignment()
        return Alignment.to(self._start, self._start_yaw, first)

    @property
    def _stale(self) -> bool:
        return self._feed.age > self._settings.odometry_timeout / 2

    @property
    def _odometry(self) -> Odometry:
        odometry = self._feed.odometry
        if odometry is None:
            raise VehicleError(f"{self._name} is not connected; call connect first")
        return odometry

    def _connected(self) -> RosLink:
        if self._link is None or self._feed.odometry is None:
            raise VehicleError(f"{self._name} is not connected; call connect first")
        return self._link

    def _require_control(self, deed: str) -> None:
        if self._settings.observe:
            raise VehicleError(f'{self._name} cannot {deed}: with "observe" it is only looked at')

    def _require_flight(self, deed: str) -> None:
        self._connected()
        self._require_control(deed)
        mode = self._loop.mode
        if mode is VehicleMode.GROUNDED:
            raise VehicleError(f"{self._name} cannot {deed} on the ground; take off first")
        if mode not in {VehicleMode.HOLDING, VehicleMode.GUIDED}:
            doing = mode.value.replace("_", " ")
            raise VehicleError(f"{self._name} cannot {deed} while it is {doing}")
