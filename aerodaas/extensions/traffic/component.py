"""The traffic that a MAVLink vehicle hears of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from aerodaas.config.checked import added_settings
from aerodaas.drivers.mavlink.component import ComponentContext, MavlinkComponent, MessageHandler
from aerodaas.drivers.mavlink.microservices.commander import Commander, PendingCommand
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.drivers.mavlink.wire.link import Message
from aerodaas.extensions.traffic.settings import TrafficLimits
from aerodaas.extensions.traffic.table import TrafficTable
from aerodaas.geometry.frames import Vector, is_finite
from aerodaas.messages.vehicle import VehicleState

__all__ = ["TrafficComponent"]

_RATE = 20.0
"""ADSB_VEHICLE a second that are asked for: an autopilot tells one aircraft with each."""


class TrafficComponent(MavlinkComponent):
    """Traffic around one vehicle."""

    senders = frozenset({mavlink.MAV_COMP_ID_ADSB})

    def __init__(self, context: ComponentContext) -> None:
        """Know of no traffic yet."""
        super().__init__(context)
        self._traffic = TrafficTable(added_settings(context.robot.limits, TrafficLimits).traffic)
        self._asked_after = -1
        """Restarts of the autopilot after which it was last asked for traffic."""
        self._here: Vector = np.full(3, np.nan)

    @property
    def handlers(self) -> Mapping[str, MessageHandler]:
        """See `MavlinkComponent`."""
        return {"ADSB_VEHICLE": self._on_aircraft}

    def _on_aircraft(self, message: Message, now: float) -> None:
        if self.connection is not None:
            alignment = self.connection.alignment
            self._traffic.update(message, now, alignment.origin, alignment.sea_level, self._here)

    def step(self, now: float) -> None:
        """Request traffic once: where nothing flies none comes, which is no reason to repeat it."""
        if self.connection is not None:
            self._request(self.connection.commander, now)

    def _request(self, commander: Commander, now: float) -> None:
        number = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
        reboots = self.context.telemetry.reboots
        # An autopilot takes one such command at a time, and the flight's own come first.
        if self._asked_after == reboots or commander.under_way(number) is not None:
            return
        self._asked_after = reboots
        message = float(mavlink.MAVLINK_MSG_ID_ADSB_VEHICLE)
        commander.give(
            PendingCommand(number, (message, 1e6 / _RATE, *[0.0] * 5), "tell of traffic"), now=now
        )

    def complete(self, state: VehicleState, now: float, placed_at: float) -> VehicleState:
        """Add the traffic around the vehicle, and how much was not believed."""
        del now
        here = state.odometry.position
        self._here = here if is_finite(here) else self._here
        if not self._traffic.heard:
            return state
        extra = {**state.extra, "traffic_ignored": self._traffic.ignored}
        traffic = self._traffic.around(self._here, placed_at)
        return replace(state, traffic=traffic, extra=extra)
