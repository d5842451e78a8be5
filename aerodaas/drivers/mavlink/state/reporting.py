"""State report of one vehicle for the mission, combined from all its messages."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from aerodaas.clock import NANOSECONDS
from aerodaas.drivers.mavlink.autopilots.autopilot import Autopilot
from aerodaas.drivers.mavlink.component import MavlinkComponent
from aerodaas.drivers.mavlink.control.departure import Departure
from aerodaas.drivers.mavlink.state.alignment import Alignment
from aerodaas.drivers.mavlink.state.frames import LocalFrame
from aerodaas.drivers.mavlink.state.phase import FlightPhase
from aerodaas.drivers.mavlink.state.rangefinder import RATE
from aerodaas.drivers.mavlink.state.telemetry import Telemetry
from aerodaas.drivers.mavlink.state.touchdown import Touchdown
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.drivers.mavlink.wire.link import LinkCounts
from aerodaas.geometry.frames import Vector
from aerodaas.messages.health import HealthReadings
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.vehicle import VehicleMode, VehicleState

__all__ = ["REASONS", "VehicleReport"]

REASONS = 12.0
"""Greatest age in seconds of an autopilot's text that explains its behaviour."""
_LOST_AFTER = 1.5
"""Seconds of silence of a vehicle that sends 40 messages a second, after which it is lost."""
_FINDING = 1.0
"""Seconds for a first position after the link is back."""
_DATED = 1e9
"""Seconds since the Unix epoch that its clock shows at least once it knows the date."""
_DEAF_AFTER = 5.0
"""Seconds without an answer from a vehicle that is heard, after which the uplink is in doubt."""
_GRAVE = 3
"""Severity of an error; smaller is more severe."""


class VehicleReport:
    """Reporter of one vehicle's state; seconds are monotonic."""

    def __init__(
        self,
        telemetry: Telemetry,
        phase: FlightPhase,
        touchdown: Touchdown,
        components: Sequence[MavlinkComponent] = (),
    ) -> None:
        """Report by what these know; `components` add what they know at the end."""
        measures = telemetry.rangefinder is not None
        self.rates = {mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR: RATE} if measures else {}
        """What must be sent beside what every vehicle sends, Hz by message."""
        self.autopilot: Autopilot | None = None
        """Its family; None before it is found."""
        self.departure: Departure | None = None
        """Its take-offs; None before it is found."""
        self.alignment: Alignment | None = None
        """Alignment of its frame; None before it is connected."""
        self.restarted = ""
        """Text about a restart of the autopilot, until motors start again."""
        self._telemetry = telemetry
        self._phase = phase
        self._touchdown = touchdown
        self._components = components

    def state(
        self, stamp: int, now: float, counts: LinkCounts, reports: Sequence[str] = ()
    ) -> VehicleState:
        """The newest state at `now`.

        Args:
            stamp: The same time on the mission's clock, nanoseconds.
            now: Monotonic clock, seconds.
            counts: Counters of the link.
            reports: Faults of the link.
        """
        telemetry, lost = self._telemetry, self.lost(now)
        # A silent link is no loss of the position: the last known one stays, with its age. Only a
        # vehicle that still sends messages can have lost it.
        age = now - telemetry.position_at
        heard = telemetry.knows_place(now - self._silence(now))
        known = heard or (lost and math.isfinite(age))
        age = age if known else 0.0
        frame = self.alignment.frame if self.alignment is not None else None
        state = VehicleState(
            max(0, stamp - int(age * NANOSECONDS)),
            self.odometry(frame, known=known),
            telemetry.battery,
            VehicleMode.LOST if lost else self.mode,
            telemetry.armed,
            telemetry.gps,
            faults=(*self._faults(now), *reports),
            extra={
                **self._autopilot_time(now - age),
                "autopilot_clock": telemetry.clock,
                "damaged_packets": counts.damaged,
                "foreign_packets": counts.strangers,
                "impostor_packets": counts.impostors,
                "refused_packets": counts.refused,
                "silence": telemetry.silence(now),
                "gps_fix_type": float(telemetry.health.gps_fix_type),
                **self._mission(),
            },
            ended=self._touchdown.ended,
            below=self._below(now),
        )
        for component in self._components:
            state = component.complete(state, now, now - age)
        return state

    def objections(self, now: float) -> list[str]:
        """Why it must not take off, as far as its own state says so."""
        rangefinder = self._telemetry.rangefinder
        fault = "" if rangefinder is None else rangefinder.fault(now)
        return [fault] if fault else []

    def _below(self, now: float) -> float | None:
        telemetry = self._telemetry
        if telemetry.rangefinder is None:
            return None
        return telemetry.rangefinder.below(telemetry.attitude, now)

    def _autopilot_time(self, at: float) -> dict[str, float]:
        """Its clock since its start: by TIMESYNC at the second `at`, else by its newest stamp."""
        told = self._telemetry.boot_clock.reading(at)
        if told is None:
            return {"autopilot_time": self._telemetry.boot_time}
        return {"autopilot_time": told[0], "autopilot_time_error": told[1]}

    def _mission(self) -> dict[str, float]:
        """Items of the vehicle's own mission, where it has told any."""
        items = {
            "mission_item": self._telemetry.mission_item,
            "mission_reached": self._telemetry.mission_reached,
        }
        return {name: number for name, number in items.items() if math.isfinite(number)}

    def odometry(self, frame: LocalFrame | None, *, known: bool) -> Odometry:
        """Its position in our frame; NaN unless that is `known`.

        Args:
            frame: Our frame in the autopilot's; None while it is not known.
            known: Whether the position is known.
        """
        telemetry, attitude = self._telemetry, self._telemetry.attitude
        position: Vector = np.full(3, np.nan)
        if known and frame is not None and telemetry.position is not None:
            position = frame.position(telemetry.position)
        return Odometry(
            position,
            LocalFrame.velocity(telemetry.velocity),
            attitude.yaw,
            attitude.roll,
            attitude.pitch,
            attitude.yaw_rate,
        )

    def health(self, now: float, stranded: tuple[str, ...] | None) -> HealthReadings:
        """Its health at `now`.

        Args:
            now: Monotonic clock, seconds.
            stranded: Why it would not come home without us; None if not known.
        """
        telemetry, health = self._telemetry, self._telemetry.health
        logs = mavlink.MAV_SYS_STATUS_LOGGING
        sensors = telemetry.sensors
        has_log = sensors is not None and sensors.present & sensors.enabled & logs
        readings = HealthReadings(
            cells=health.cells,
            cycles=health.cycles,
            vibration=health.vibration,
            compass=health.compass,
            estimator=health.estimator,
            gps_fix=health.gps_fix,
            gps_rtk=health.gps_rtk,
            logs=bool(sensors.health & logs) if sensors is not None and has_log else None,
            silence=telemetry.silence(now),
            clock=telemetry.clock if telemetry.clock > _DATED else None,
            stranded=stranded,
        )
        for component in self._components:
            readings = component.complete_health(readings, now)
        return readings

    @property
    def mode(self) -> VehicleMode:
        """Its flight mode, by its HEARTBEATs and the outcome of our commands."""
        if self._touchdown.falling:
            return VehicleMode.FAILSAFE
        if self._phase.taken is None and self.departure is not None:
            if self.departure.withdrawing:
                return VehicleMode.LANDING
            if self.departure.climbs:
                return VehicleMode.TAKING_OFF
        return self._phase.mode

    def lost(self, now: float) -> bool:
        """Whether it has sent nothing new for too long, or since then no mode or no position."""
        telemetry = self._telemetry
        if self._silence(now) > _LOST_AFTER or not telemetry.shows_mode(now):
            return True
        back = telemetry.armed and now - telemetry.back_at < _FINDING
        return back and not telemetry.knows_place(now)

    def _silence(self, now: float) -> float:
        # Standing motors need no recent telemetry: HEARTBEATs report them.
        telemetry = self._telemetry
        return telemetry.silence(now) if telemetry.armed else now - telemetry.heard_at

    def _faults(self, now: float) -> list[str]:
        telemetry = self._telemetry
        faults = [self.restarted, self._touchdown.fault]
        if self._phase.taken is VehicleMode.FAILSAFE and self.autopilot is not None:
            faults += self.autopilot.protection_reasons(telemetry, now, REASONS)
        faults.append(telemetry.breach)
        speaks = now - telemetry.heard_at <= _LOST_AFTER < now - telemetry.back_at
        if speaks and self._silence(now) > _LOST_AFTER:
            faults.append("telemetry: packets come, and say nothing new")
        if speaks and telemetry.boot_clock.unanswered > _DEAF_AFTER:
            faults.append("link: the vehicle answers nothing, it may not hear us")
        if self.alignment is not None:
            faults.append(self.alignment.fault)
        if off := telemetry.home_off:
            faults.append(f"home: its own return leads {off:.0f} m from where it took off")
        faults += [*telemetry.health.faults(now), *self.objections(now)]
        faults += telemetry.texts.recent(now, REASONS, _GRAVE)
        return list(dict.fromkeys(fault for fault in faults if fault))
