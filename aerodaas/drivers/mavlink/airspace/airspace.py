"""The vehicle among others: its Remote ID, and the traffic that it hears of, beside the flight.

Nothing of it counts as a word of the autopilot: a transmitter that goes on talking does not hide
that the vehicle is silent. The link's thread calls `take` and `turn`, the loop's thread the rest,
under one lock.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from aerodaas.config.sections.robot import RobotConfig
from aerodaas.drivers.mavlink.airspace.remote_id import OperatorPlace, RemoteId
from aerodaas.drivers.mavlink.airspace.traffic import TrafficTable
from aerodaas.drivers.mavlink.microservices.commander import Commander, PendingCommand
from aerodaas.drivers.mavlink.state.alignment import Alignment
from aerodaas.drivers.mavlink.state.telemetry import Telemetry
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.drivers.mavlink.wire.link import MavlinkLink, Message
from aerodaas.geometry.frames import Vector, is_finite
from aerodaas.messages.vehicle import Traffic

__all__ = ["Airspace"]

_RATE = 20.0
"""ADSB_VEHICLE a second that are asked for: an autopilot tells one aircraft with each."""


class Airspace:
    """Remote ID and traffic of one vehicle."""

    messages: ClassVar[frozenset[str]] = frozenset({"OPEN_DRONE_ID_ARM_STATUS", "ADSB_VEHICLE"})
    """What `take` processes."""

    def __init__(self, robot: RobotConfig, telemetry: Telemetry, *, observes: bool) -> None:
        """Know of nothing yet; `telemetry` is the vehicle's own."""
        self._remote_id = RemoteId(robot.remote_id, observes=observes)
        self._traffic = TrafficTable(robot.limits.traffic)
        self._telemetry = telemetry
        self._link: MavlinkLink | None = None
        self._commander: Commander | None = None
        self._alignment: Alignment | None = None
        self._asked_after = -1
        """Restarts of the autopilot after which it was last asked for traffic."""
        self._stood: OperatorPlace | None = None
        """Where it stood before its motors ran."""
        self._here: Vector = np.full(3, np.nan)

    def begin(self, link: MavlinkLink, commander: Commander, alignment: Alignment) -> None:
        """Begin to tell and to ask, once the vehicle is connected.

        Args:
            link: The link to the vehicle.
            commander: Sends the vehicle's commands.
            alignment: Pins our frame to the earth.
        """
        self._link, self._commander, self._alignment = link, commander, alignment

    def on_message(self, message: Message, now: float) -> None:
        """Process one of `messages`.

        Args:
            message: The message, of the vehicle or of its remote id.
            now: Monotonic clock, seconds.
        """
        if message.get_type() == "OPEN_DRONE_ID_ARM_STATUS":
            self._remote_id.on_arm_status(message, now)
        elif self._alignment is not None:
            origin, sea_level = self._alignment.origin, self._alignment.sea_level
            self._traffic.update(message, now, origin, sea_level, self._here)

    def step(self, now: float) -> None:
        """Send the transmitter the messages that are due, and request traffic."""
        if self._link is None or self._commander is None:
            return
        for message in self._remote_id.due_messages(now, self._place, self._link.target[0]):
            self._link.send(message)
        self._ask(self._commander, now)

    def _ask(self, commander: Commander, now: float) -> None:
        """Ask once: where nothing flies none comes, so that its absence means nothing."""
        number = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
        asked = self._asked_after == self._telemetry.reboots
        # An autopilot takes one such command at a time, and the flight's own come first.
        if asked or commander.under_way(number) is not None:
            return
        self._asked_after = self._telemetry.reboots
        message = float(mavlink.MAVLINK_MSG_ID_ADSB_VEHICLE)
        commander.give(
            PendingCommand(number, (message, 1e6 / _RATE, *[0.0] * 5), "tell of traffic"), now=now
        )

    def _place(self) -> OperatorPlace | None:
        """Where it took off, or stands now."""
        telemetry = self._telemetry
        if not telemetry.armed and telemetry.place is not None:
            altitude = None if telemetry.gps is None else telemetry.gps.altitude
            self._stood = (*telemetry.place, altitude)
        if self._stood is None and self._alignment is not None and telemetry.home is not None:
            # It was met in the air.
            frame = self._alignment.frame
            if frame is not None:
                home = frame.position(telemetry.home)
                latitude, longitude, _ = self._alignment.origin.to_geodetic(home)
                self._stood = latitude, longitude, None
        return self._stood

    def traffic(self, here: Vector, now: float) -> tuple[Traffic, ...]:
        """Traffic around `here`, the nearest first.

        Args:
            here: Where the vehicle is, ENU metres.
            now: Monotonic clock, seconds.
        """
        self._here = here if is_finite(here) else self._here
        return self._traffic.around(self._here, now)

    @property
    def figures(self) -> dict[str, float]:
        """How much traffic was not believed, once any was heard of."""
        return {"traffic_ignored": self._traffic.ignored} if self._traffic.heard else {}

    def objection(self, now: float) -> str | None:
        """Objection of its Remote ID; empty if there is none, None without Remote ID."""
        return self._remote_id.objection(now)

    def faults(self, now: float) -> list[str]:
        """Objection of its Remote ID as a fault of the vehicle."""
        said = self.objection(now)
        return [f"Remote ID: {said}"] if said else []
