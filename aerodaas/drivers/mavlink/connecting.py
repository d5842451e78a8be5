"""Connecting: from the first HEARTBEAT to a vehicle with a position and its failsafes set."""

from __future__ import annotations

import logging
import math
import re
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from aerodaas.config.model import RobotConfig
from aerodaas.config.secrets import MAVLINK_KEY
from aerodaas.drivers.mavlink.autopilots.autopilot import Autopilot
from aerodaas.drivers.mavlink.control.departure import Departure
from aerodaas.drivers.mavlink.microservices.commander import Commander
from aerodaas.drivers.mavlink.microservices.fallback import Fallback, ParameterBackup
from aerodaas.drivers.mavlink.microservices.fence import upload_fence
from aerodaas.drivers.mavlink.microservices.parameters import Parameters, unsafe_parameters
from aerodaas.drivers.mavlink.settings import MavlinkSettings
from aerodaas.drivers.mavlink.state.alignment import Alignment
from aerodaas.drivers.mavlink.state.frames import LocalFrame
from aerodaas.drivers.mavlink.state.telemetry import Telemetry
from aerodaas.drivers.mavlink.wire.link import MavlinkLink
from aerodaas.errors import VehicleError
from aerodaas.geometry.frames import GeodeticOrigin, Vector, ned_to_enu

__all__ = ["CHECKS", "Connection", "establish", "require_answer"]

_log = logging.getLogger(__name__)

CHECKS = 4.0
"""Seconds between requests to run and report the arming checks."""
_WORDS = 40.0
"""Greatest age in seconds of an autopilot's text that explains why it is not ready."""
_VERSION = 3.0
"""Seconds to wait for the autopilot's version."""
_ANSWER = 5.0
"""Seconds in which a vehicle answers the first commands, which are repeated each second."""
_FAR = 20.0
"""Allowed metres between its position and the environment's home."""


@dataclass(frozen=True)
class Connection:
    """Constants of one connection to a vehicle."""

    link: MavlinkLink
    autopilot: Autopilot
    commander: Commander
    departure: Departure
    alignment: Alignment
    fallback: Fallback
    target: tuple[int, int]
    """System and component."""

    def put_back(self, name: str, *, stands: bool) -> None:
        """Give the vehicle its own parameters back, if it stands: they may bring it home else.

        Args:
            name: Id of the robot, for warnings.
            stands: Whether the vehicle stands on the ground.
        """
        if not stands:
            _log.warning(
                "%s: still in flight, so that its fallback stays set; the next flight, or "
                "`python -m aerodaas.drivers.mavlink URL --restore`, puts its own parameters back",
                name,
            )
            return
        try:
            self.fallback.restore()
        except VehicleError as error:
            _log.warning("%s: its own parameters are not back: %s", name, error)


def require_answer(commander: Commander, name: str, pause: Callable[[], None]) -> None:
    """Wait for the first answer of a vehicle that signs, while we have no key.

    Its packets can be read without one, so that all would look well until it is to be flown; but
    most that sign drop what is unsigned.

    Args:
        commander: Knows whether a command was answered.
        name: Id of the robot, for the error.
        pause: Waits for the next messages.

    Raises:
        VehicleError: If the vehicle answers nothing.
    """
    deadline = time.monotonic() + _ANSWER
    while not commander.answered:
        if time.monotonic() >= deadline:
            raise VehicleError(
                f"{name}: the vehicle is heard, and signs; no key is here, so that it obeys "
                f"nothing: set {MAVLINK_KEY}, or signing_key in its settings"
            )
        pause()


def establish(
    link: MavlinkLink,
    autopilot: Autopilot,
    commander: Commander,
    departure: Departure,
    telemetry: Telemetry,
    *,
    robot: RobotConfig,
    settings: MavlinkSettings,
    home: GeodeticOrigin | None,
    pause: Callable[[], None],
) -> Connection:
    """Wait until it is ready, see to its protections and its fence.

    Args:
        link: The link, whose vehicle is adopted.
        autopilot: The autopilot's dialect of commands and parameters.
        commander: Sends the vehicle's commands.
        departure: Take-off of the vehicle.
        telemetry: What the vehicle has told so far.
        robot: The robot, with its limits and start.
        settings: Settings of its driver.
        home: Geodetic origin of the environment; None without one.
        pause: Waits for the next messages.

    Raises:
        VehicleError: If the vehicle is not ready in time, or a protection cannot be seen to.
    """
    commander.give(autopilot.version(), now=time.monotonic())
    _await_ready(autopilot, commander, telemetry, robot.id, settings, pause)
    # Now: its place may be lost again, which changes nothing any more, while the rest is seen to.
    alignment = Alignment(_frame(telemetry, robot, settings, home, pause), telemetry)
    backup = ParameterBackup(_own_name(autopilot, telemetry, settings, link.target[0], pause))
    fallback = Fallback(link, autopilot, settings, name=robot.id, backup=backup)
    if not telemetry.armed:
        _see_to_failsafes(link, autopilot, settings, robot.id)
        if settings.fence != "off" and not settings.observe:
            upload_fence(link, autopilot, robot.limits.geofence, alignment.origin, settings.fence)
        if settings.fallback != "ignore":
            fallback.establish(robot.limits.geofence.ceiling, telemetry.software)
    _log.info("%s: %s %s, system %d", robot.id, autopilot.name, telemetry.software, link.target[0])
    return Connection(link, autopilot, commander, departure, alignment, fallback, link.target)


def _own_name(
    autopilot: Autopilot,
    telemetry: Telemetry,
    settings: MavlinkSettings,
    system: int,
    pause: Callable[[], None],
) -> str:
    """A name that no other vehicle has: its board's number, or else where it is met."""
    deadline = time.monotonic() + _VERSION
    while not telemetry.software and time.monotonic() < deadline:
        pause()
    where = telemetry.hardware or re.sub(r"[^A-Za-z0-9.]+", "-", settings.url)
    return f"{autopilot.name}-{system}-{where}".lower()


def _await_ready(
    autopilot: Autopilot,
    commander: Commander,
    telemetry: Telemetry,
    name: str,
    settings: MavlinkSettings,
    pause: Callable[[], None],
) -> None:
    """Wait for its position, and for passing arming checks; the latter are not required here."""
    began = time.monotonic()
    checked_at = began
    while True:
        now = time.monotonic()
        places = telemetry.knows_place(now) and telemetry.place is not None
        # Whether it is armed decides what follows.
        places = places and telemetry.beat_at > -math.inf
        if places and (telemetry.armed or not autopilot.objections(telemetry, now)):
            return
        if now - began > settings.ready_timeout:
            if places:
                return
            said = [telemetry.health.gps_objection, *telemetry.events.objections_to_hold]
            said = list(dict.fromkeys(filter(None, [*said, *telemetry.texts.recent(now, _WORDS)])))
            words = f"; it says: {'; '.join(said)}" if said else ""
            raise VehicleError(
                f"{name}: {autopilot.name} has not told its position within "
                f"{settings.ready_timeout:g} s{words}"
            )
        if now - checked_at > CHECKS:
            checked_at = now
            commander.give(autopilot.check(), now=now)
        pause()


def _frame(
    telemetry: Telemetry,
    robot: RobotConfig,
    settings: MavlinkSettings,
    home: GeodeticOrigin | None,
    pause: Callable[[], None],
) -> LocalFrame:
    start = np.array(robot.start, dtype=np.float64)
    took_off = _armed_at(telemetry, pause) if telemetry.armed else None
    place, position = telemetry.whereabouts()
    if settings.frame == "home" and home is not None:
        up = float(start[2])
        if took_off is not None:
            up += float(ned_to_enu(position)[2] - ned_to_enu(took_off)[2])
        return LocalFrame.over_home(home, *place, up, position)
    if home is not None:
        east, north, _ = home.to_local(*place, home.altitude)
        away = float(np.hypot(east - start[0], north - start[1]))
        if away > _FAR and took_off is None:
            _log.warning(
                "%s stands %.0f m from where the environment's home and its start say: global "
                'waypoints would lead astray; mend home, or set "frame": "home"',
                robot.id,
                away,
            )
    return LocalFrame.standing_at(start, position if took_off is None else took_off)


def _armed_at(telemetry: Telemetry, pause: Callable[[], None]) -> Vector:
    """Take-off position of a vehicle that is already in the air, NED metres."""
    patience = 3.0
    deadline = time.monotonic() + patience
    while telemetry.home is None and time.monotonic() < deadline:
        pause()
    if telemetry.home is None:
        raise VehicleError("it is flying already, and does not say where it took off; land it")
    return telemetry.home


def _see_to_failsafes(
    link: MavlinkLink, autopilot: Autopilot, settings: MavlinkSettings, name: str
) -> None:
    if settings.failsafes == "ignore":
        return
    parameters = Parameters(link, autopilot)
    for unsafe in unsafe_parameters(parameters, autopilot):
        if settings.failsafes == "set" and not settings.observe:
            parameters.set(unsafe.failsafe.name, unsafe.failsafe.safe)
            _log.warning("%s: %s: set", name, unsafe.text)
        else:
            _log.warning('%s: %s ("failsafes": "set" does it)', name, unsafe.text)
