"""Remote ID of one vehicle: its transmitter's messages, and its item before take-off."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from aerodaas.config.checked import added_settings
from aerodaas.config.model import LimitsConfig, PreflightConfig
from aerodaas.drivers.mavlink.component import ComponentContext, MavlinkComponent, MessageHandler
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.extensions.remote_id.settings import RemoteIdLevel, RobotRemoteId
from aerodaas.extensions.remote_id.transmitter import OperatorPlace, RemoteId
from aerodaas.messages.health import HealthItem, HealthReadings, Verdict
from aerodaas.messages.vehicle import VehicleState
from aerodaas.mission.safety.checklist import PreflightCheck

__all__ = ["RemoteIdComponent", "preflight_check"]

_ITEM, _SUBJECT, _READY = "remote_id", "Remote ID", "ready"


class RemoteIdComponent(MavlinkComponent):
    """Remote ID transmitter of one vehicle."""

    senders = frozenset(range(mavlink.MAV_COMP_ID_ODID_TXRX_1, mavlink.MAV_COMP_ID_ODID_TXRX_3 + 1))

    def __init__(self, context: ComponentContext) -> None:
        """Know of no transmitter yet."""
        super().__init__(context)
        config = added_settings(context.robot, RobotRemoteId).remote_id
        self._remote_id = RemoteId(config, observes=context.settings.observe)
        self._stood: OperatorPlace | None = None
        """Where it stood before its motors ran."""

    @property
    def handlers(self) -> Mapping[str, MessageHandler]:
        """See `MavlinkComponent`."""
        return {"OPEN_DRONE_ID_ARM_STATUS": self._remote_id.on_arm_status}

    def step(self, now: float) -> None:
        """Send the transmitter the messages that are due."""
        if self.connection is None:
            return
        link = self.connection.link
        for message in self._remote_id.due_messages(now, self._place, link.target[0]):
            link.send(message)

    def complete(self, state: VehicleState, now: float, placed_at: float) -> VehicleState:
        """Add the transmitter's objection as a fault."""
        del placed_at
        said = self._remote_id.objection(now)
        return replace(state, faults=(*state.faults, f"{_SUBJECT}: {said}")) if said else state

    def complete_health(self, readings: HealthReadings, now: float) -> HealthReadings:
        """Add the transmitter's objection."""
        said = self._remote_id.objection(now)
        if said is None:
            return readings
        return replace(readings, objections={**readings.objections, _ITEM: said})

    def _place(self) -> OperatorPlace | None:
        """Where it took off, or stands now."""
        telemetry, connection = self.context.telemetry, self.connection
        if not telemetry.armed and telemetry.place is not None:
            altitude = None if telemetry.gps is None else telemetry.gps.altitude
            self._stood = (*telemetry.place, altitude)
        if self._stood is None and connection is not None and telemetry.home is not None:
            # It was met in the air.
            frame = connection.alignment.frame
            if frame is not None:
                home = frame.position(telemetry.home)
                latitude, longitude, _ = connection.alignment.origin.to_geodetic(home)
                self._stood = latitude, longitude, None
        return self._stood


def preflight_check(limits: LimitsConfig, policy: PreflightConfig) -> PreflightCheck:
    """The item of the list before take-off.

    Args:
        limits: The robot's limits; none of them counts.
        policy: What a transmitter that is not ready means.
    """
    del limits
    return PreflightCheck(
        _ITEM,
        "switch the transmitter on, wait for its GPS, and fill in the robot's remote_id",
        _examine,
        added_settings(policy, RemoteIdLevel).remote_id,
        _SUBJECT,
    )


def _examine(_: VehicleState, readings: HealthReadings) -> HealthItem:
    said = readings.objections.get(_ITEM)
    if said is None:
        return HealthItem(_ITEM, "not known", _READY, Verdict.UNKNOWN)
    verdict = Verdict.REFUSED if said else Verdict.GOOD
    return HealthItem(_ITEM, said or _READY, _READY, verdict)
