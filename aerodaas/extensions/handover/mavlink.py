"""The autopilot's own mission mode: a plan that is uploaded in flight, started and followed.

What it says of its progress (MISSION_CURRENT, MISSION_ITEM_REACHED) is passed on as places of the
plan; whether the vehicle was there is for the mission to judge.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence

from aerodaas.drivers.mavlink.autopilots.autopilot import NOT_GIVEN, Autopilot
from aerodaas.drivers.mavlink.component import ComponentContext, MavlinkComponent, MessageHandler
from aerodaas.drivers.mavlink.connecting import Connection
from aerodaas.drivers.mavlink.microservices.plans import MissionItem, Upload, item_place
from aerodaas.drivers.mavlink.state.frames import LocalFrame
from aerodaas.drivers.mavlink.state.phase import FlightMode
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.drivers.mavlink.wire.link import Message
from aerodaas.errors import VehicleError
from aerodaas.extensions.handover.mission_mode import MissionModePhase, PlannedPlace, PlanProgress
from aerodaas.geometry.frames import GeodeticOrigin
from aerodaas.messages.vehicle import VehicleMode

__all__ = ["MavlinkMissionMode", "mission_items"]

_STAY = 10.0
"""Seconds at the last place after which a vehicle that was not taken back comes home by itself."""
_SELECTION = 0.5
"""Seconds in which a vehicle answers MISSION_SET_CURRENT."""
_TRIES = 6
"""How often it is sent."""
_START = 6.0
"""Seconds in which HEARTBEATs must show the mission mode."""
_GROUND_SPEED = 1.0
"""Parameter 1 of MAV_CMD_DO_CHANGE_SPEED."""
_UNCHANGED = -1.0
"""Its throttle, as it is."""

_P = MissionModePhase


def mission_items(
    places: Sequence[PlannedPlace],
    autopilot: Autopilot,
    *,
    origin: GeodeticOrigin,
    sea_level: float,
    radius: float,
) -> tuple[list[MissionItem], list[int]]:
    """The mission through `places`, and the number of the item that stands for each of them.

    After the last place it stays for a moment, and then comes home. Heights are above the sea: its
    home, which others may move in flight, is no reference for them.

    Args:
        places: Where to fly, in order.
        autopilot: The family of the vehicle.
        origin: Geodetic origin of the local frame.
        sea_level: Metres above mean sea level of the local frame's zero.
        radius: Metres from a place that count as there.
    """
    still = (0.0, 0.0, 0.0, 0.0)
    items: list[MissionItem] = []
    if autopilot.home_comes_first:
        here = item_place(origin, *places[0].position[:2])
        items.append(
            MissionItem(mavlink.MAV_CMD_NAV_WAYPOINT, still, *here, 0.0, mavlink.MAV_FRAME_GLOBAL)
        )
    numbers: list[int] = []
    speed = math.nan
    # ArduPilot, which has no yaw there, refuses what is not a number.
    onwards = NOT_GIVEN if autopilot.turns_at_waypoints else 0.0
    for place in places:
        if place.speed != speed:
            speed = place.speed
            values = (_GROUND_SPEED, speed, _UNCHANGED, 0.0)
            items.append(
                MissionItem(
                    mavlink.MAV_CMD_DO_CHANGE_SPEED, values, 0, 0, 0.0, mavlink.MAV_FRAME_MISSION
                )
            )
        yaw = onwards if place.yaw is None else math.degrees(LocalFrame.heading(place.yaw))
        values = (float(math.ceil(place.hover)), radius, 0.0, yaw)
        numbers.append(len(items))
        items.append(_item(mavlink.MAV_CMD_NAV_WAYPOINT, values, place, origin, sea_level))
    values = (_STAY, 0.0, 0.0, onwards)
    items.append(_item(mavlink.MAV_CMD_NAV_LOITER_TIME, values, places[-1], origin, sea_level))
    items.append(
        MissionItem(
            mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH, still, 0, 0, 0.0, mavlink.MAV_FRAME_MISSION
        )
    )
    return items, numbers


def _item(
    command: int,
    values: tuple[float, float, float, float],
    place: PlannedPlace,
    origin: GeodeticOrigin,
    sea_level: float,
) -> MissionItem:
    east, north, up = (float(axis) for axis in place.position)
    there, altitude = item_place(origin, east, north), round(sea_level + up, 2)
    return MissionItem(command, values, *there, altitude, mavlink.MAV_FRAME_GLOBAL)


class MavlinkMissionMode(MavlinkComponent):
    """`MissionMode` of one vehicle."""

    def __init__(self, context: ComponentContext) -> None:
        """Have no plan yet."""
        super().__init__(context)
        self._telemetry = context.telemetry
        self._flight = context.phase
        self._lock = context.lock
        self._forget()

    @property
    def handlers(self) -> Mapping[str, MessageHandler]:
        """Handlers of the messages about the upload, and about progress in the plan."""
        names = (*Upload.messages, "MISSION_CURRENT", "MISSION_ITEM_REACHED")
        return dict.fromkeys(names, self._on_message)

    def _vehicle(self) -> Connection:
        if self.connection is None:
            raise VehicleError("it is not connected")
        return self.connection

    def clear(self) -> None:
        """Forget the plan."""
        with self._lock:
            self._forget()

    def _forget(self) -> None:
        self._phase = _P.NONE
        self._fault = ""
        self._done = 0
        self._upload: Upload | None = None
        self._numbers: list[int] = []
        self._count = 0
        self._asked = 0
        self._deadline = math.inf

    @property
    def changes_mode(self) -> bool:
        """Whether the mode was asked for, and is not shown yet."""
        return self._phase is _P.STARTING

    @property
    def progress(self) -> PlanProgress:
        """How far the plan has come, as the vehicle says."""
        with self._lock:
            return PlanProgress(self._phase, self._fault, self._done)

    def objection(self, places: Sequence[PlannedPlace]) -> str:
        """Why it cannot fly these places, or not now; empty if it can."""
        if self.connection is None:
            return "it is not connected"
        autopilot, alignment = self.connection.autopilot, self.connection.alignment
        if self.context.settings.observe:
            return 'with "observe" it is only looked at'
        if any(place.yaw is not None for place in places) and not autopilot.turns_at_waypoints:
            return f"{autopilot.name} turns to no yaw at a waypoint"
        known = alignment.frame is not None and alignment.sea_level is not None
        if self._telemetry.home is None or not known:
            return f"{autopilot.name} does not tell where it is, or where its home lies"
        return self._home_fault()

    def _home_fault(self) -> str:
        """Why its way home after the plan would lead astray; empty if it would not."""
        off = self._telemetry.home_off
        return f"its home has moved, {off:.0f} m from where it took off" if off else ""

    def upload(self, places: Sequence[PlannedPlace]) -> None:
        """Begin to replace the plan on the vehicle; raises VehicleError."""
        with self._lock:
            connection = self._vehicle()
            sea_level = connection.alignment.sea_level
            if (text := self.objection(places)) or sea_level is None:
                raise VehicleError(text)
            self._forget()
            items, self._numbers = mission_items(
                places,
                connection.autopilot,
                origin=connection.alignment.origin,
                sea_level=sea_level,
                radius=self.context.robot.limits.arrival_radius,
            )
            self._count = len(items)
            self._phase = _P.UPLOADING
            self._upload = Upload(
                connection.link.send, connection.target, items, now=time.monotonic()
            )

    def start(self) -> None:
        """Ask for the mission mode; raises VehicleError if no plan is ready."""
        with self._lock:
            if self._phase is not _P.READY or self._flight.mode is not VehicleMode.GUIDED:
                mode = self._flight.mode.value
                raise VehicleError(f"no plan is ready to be flown by a vehicle that is {mode}")
            self._phase, self._deadline = _P.STARTING, time.monotonic() + _START
            self.context.change_mode(FlightMode.MISSION, self._refused)

    def _refused(self, text: str) -> None:
        if self._phase is _P.STARTING:
            self._fail(text)

    def _on_message(self, message: Message, now: float) -> None:
        kind = message.get_type()
        if kind in Upload.messages:
            if self._upload is not None:
                self._upload.on_message(message, now)
                self._mind_upload(now)
        elif self._phase is _P.UPLOADING:
            self._selected(message)
        elif self._phase is _P.FLYING:
            self._follow(message.seq, reached=kind == "MISSION_ITEM_REACHED")

    def step(self, now: float) -> None:
        """Do what is due."""
        if self._phase is _P.UPLOADING:
            if self._upload is not None:
                self._upload.step(now)
                self._mind_upload(now)
            elif now >= self._deadline:
                self._select(now)
        elif self._phase is _P.STARTING:
            if self._flight.flies_plan and self._flight.seen:
                self._phase = _P.FLYING
            elif now >= self._deadline:
                self._fail(f"{self._vehicle().autopilot.name} does not show its mission mode")
        elif self._phase is _P.FLYING:
            wish = self._flight.wish
            if wish is not None and wish is not FlightMode.MISSION:
                self._fail(f"the control loop hung, and it was commanded to {wish.value}")
            self._fault = self._home_fault() or self._fault

    def _mind_upload(self, now: float) -> None:
        assert self._upload is not None  # noqa: S101 - asked before
        if self._upload.failure:
            self._fail(self._upload.failure)
        elif self._upload.done:
            # A second plan would be begun where the first one was left.
            self._upload = None
            self._select(now)

    def _select(self, now: float) -> None:
        if self._asked == _TRIES:
            self._fail(
                f"{self._vehicle().autopilot.name} does not say that it would begin with the first"
            )
            return
        self._asked, self._deadline = self._asked + 1, now + _SELECTION
        vehicle, first = self._vehicle(), self._first()
        vehicle.link.send(mavlink.MAVLink_mission_set_current_message(*vehicle.target, first))

    def _first(self) -> int:
        """Number of the item with which the plan begins."""
        return int(self._vehicle().autopilot.home_comes_first)

    def _selected(self, message: Message) -> None:
        if self._asked and self._first() <= message.seq <= self._numbers[0]:
            self._phase, self._deadline = _P.READY, math.inf

    def _follow(self, number: int, *, reached: bool) -> None:
        """Take the number of the item that it flies, or has `reached`, by its own word."""
        if number >= self._count:
            self._fault = f"it speaks of item {number} of a plan of {self._count} items"
            return
        before = sum(one < number for one in self._numbers)
        done = before + (reached and number in self._numbers)
        if not reached and done < self._done:
            self._fault = "it flies to a place again that it has been at"
        self._done = max(self._done, done)

    def _fail(self, text: str) -> None:
        self._forget()
        self._phase, self._fault = _P.FAILED, text
