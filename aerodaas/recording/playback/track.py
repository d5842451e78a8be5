"""One robot's recorded flight, thinned out to what a page can draw."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from aerodaas.clock import seconds
from aerodaas.geometry.frames import Vector, is_finite
from aerodaas.messages.mission import BatteryOutlook, MissionStatus
from aerodaas.messages.odometry import GpsFix
from aerodaas.messages.vehicle import Traffic, VehicleState
from aerodaas.protocol.playback import GpsOut, HeardOut, PlaceOut, TrackOut
from aerodaas.protocol.schemas import StatusOut, TrafficOut
from aerodaas.recording.messages import MissionPlan

__all__ = ["ROW_SECONDS", "Room", "TrackBuilder"]

ROW_SECONDS = 0.1
"""Mission seconds between two rows of a flight that is not thinned out."""
_MOST_ROWS = 12_000
"""Rows of a robot; beyond, every second one is left out: an hour has one each 0.4 s."""
_MOST_NAMES = 1_000_000
"""Names in all statuses and places of a recording."""
_SHOWN = ("state", "reason", "pilot", "target", "faults")
"""Fields of a status that a page shows as they are."""
_MOST_BEHIND = 64
"""Visited and refused waypoints that a status names, as `StatusOut` has it."""
_HEARD_SECONDS = 1.0
"""Mission seconds between two words on other aircraft; between them they fly on."""
_MOST_AIRCRAFT = 32
"""As many as a vehicle's state has."""
_NOTHING = StatusOut(
    time=0.0,
    state="idle",
    reason="",
    target=None,
    pending=[],
    visited=[],
    given_up=[],
    waypoints_visited=0,
    waypoints_known=0,
    distance=0.0,
    faults=[],
)


class Room:
    """Room for names on a recording's page; the rest is counted."""

    def __init__(self) -> None:
        self._left = _MOST_NAMES
        self.untold = 0
        """Changes, places and alerts left out."""

    def reserve(self, names: int) -> bool:
        """Whether so many more names fit."""
        if names > self._left:
            self.untold += 1
            return False
        self._left -= names
        return True


class TrackBuilder:
    """Takes a robot's messages in the order of recording."""

    def __init__(self, room: Room) -> None:
        """Take as much as there is `room` for, which all robots share."""
        self._room = room
        self._track = TrackOut(
            time=[], position=[], velocity=[], yaw=[], roll=[], pitch=[], battery=[],
            distance=[], outlook=[], gps=[], statuses=[], places=[],
        )  # fmt: skip
        self._interval = ROW_SECONDS
        self._flown = 0.0
        self._outlook: BatteryOutlook | None = None
        self._plan: list[str] = []
        self._pending = 0
        self._known: dict[str, tuple[float, float, float]] = {}
        self._now = _NOTHING

    @property
    def track(self) -> TrackOut:
        """The flight so far."""
        return self._track

    def state(self, state: VehicleState) -> None:
        """Take a vehicle's state."""
        now, track = seconds(state.stamp), self._track
        self._change(now, {"mode": state.mode.value})
        if track.time and now < track.time[-1] + self._interval:
            return
        self._add_traffic(now, state.traffic)
        odometry = state.odometry
        track.time.append(now)
        track.position.append(_axes(odometry.position))
        track.velocity.append(_axes(odometry.velocity))
        track.yaw.append(_known(odometry.yaw))
        track.roll.append(_known(odometry.roll))
        track.pitch.append(_known(odometry.pitch))
        track.battery.append(_known(state.battery.fraction))
        track.distance.append(self._flown)
        track.outlook.append(self._outlook)
        track.gps.append(_gps(state.gps))
        if len(track.time) > _MOST_ROWS:
            self._interval *= 2
            for rows in (track.time, track.position, track.velocity, track.yaw, track.roll,
                         track.pitch, track.battery, track.distance, track.outlook,
                         track.gps):  # fmt: skip
                del rows[1::2]

    def _add_traffic(self, now: float, told: Sequence[Traffic]) -> None:
        """Add the other aircraft of a state, once a second and when the last one is gone."""
        heard = self._track.traffic
        aircraft = [TrafficOut.of(one) for one in told[:_MOST_AIRCRAFT] if _is_placed(one)]
        due = not heard or now >= heard[-1].since + _HEARD_SECONDS or not aircraft
        changed = bool(aircraft or (heard and heard[-1].aircraft))
        if changed and due and self._room.reserve(1 + len(aircraft)):
            heard.append(HeardOut(since=now, aircraft=aircraft))

    def mission(self, status: MissionStatus, ahead: int) -> None:
        """Add a mission's status.

        Args:
            status: The status.
            ahead: Number of waypoints that follow its target.
        """
        told = StatusOut.of(status, None)
        self._flown, self._outlook = told.distance, told.outlook
        self._pending = max(0, ahead)
        behind = {
            "visited": told.visited[-_MOST_BEHIND:],
            "given_up": told.given_up[-_MOST_BEHIND:],
            "waypoints_visited": status.visits,
        }
        same = {name: getattr(told, name) for name in _SHOWN}
        self._change(told.time, {**same, **behind, **self._ahead()})

    def plan(self, plan: MissionPlan) -> None:
        """Take a new plan: the waypoints ahead."""
        now = seconds(plan.stamp)
        self._plan = [one.id for one in plan.waypoints]
        for one in plan.waypoints:
            place = (one.x, one.y, one.z)
            if self._known.get(one.id) == place:
                continue
            if self._room.reserve(1):
                self._known[one.id] = place
                self._track.places.append(PlaceOut(since=now, id=one.id, place=place))
        self._change(now, self._ahead())

    def _ahead(self) -> dict[str, Any]:
        """The plan is recorded when it changes other than by reaching its first waypoints."""
        first = max(0, len(self._plan) - self._pending)
        return {"pending": self._plan[first:], "waypoints_known": len(self._known)}

    def _change(self, now: float, fields: dict[str, Any]) -> None:
        """Add a status, if any of these fields has changed."""
        if self._track.statuses and all(
            getattr(self._now, name) == value for name, value in fields.items()
        ):
            return
        last = self._track.statuses[-1].time if self._track.statuses else now
        # Vehicle and mission tell of slightly different times.
        new = self._now.model_copy(update={"time": max(now, last), **fields})
        names = (new.visited, new.given_up, new.pending, new.faults)
        if self._room.reserve(1 + sum(map(len, names))):
            self._now = new
            self._track.statuses.append(new)


def _is_placed(aircraft: Traffic) -> bool:
    """Whether its place along the ground and its velocity are known."""
    return is_finite(aircraft.position[:2]) and is_finite(aircraft.velocity)


def _gps(fix: GpsFix | None) -> GpsOut | None:
    """A recorded fix; zeros stand for what the receiver does not tell."""
    if fix is None:
        return None
    sigma = _known(fix.horizontal_sigma)
    return GpsOut(satellites=fix.satellites or None, position_sigma=sigma or None)


def _axes(vector: Vector) -> tuple[float | None, float | None, float | None]:
    x, y, z = map(float, vector)
    return _known(x), _known(y), _known(z)


def _known(number: float) -> float | None:
    return number if math.isfinite(number) else None
