"""One robot's recorded flight, thinned out to what a page can draw."""

from __future__ import annotations

from dataclasses import replace

from aerodaas.clock import NANOSECONDS
from aerodaas.geometry.frames import is_finite
from aerodaas.messages.mission import RECENT, MissionPlan, MissionStatus
from aerodaas.messages.vehicle import Traffic, VehicleState
from aerodaas.protocol.playback import TrackOut

__all__ = ["STATE_SECONDS", "Room", "TrackBuilder"]

STATE_SECONDS = 0.1
"""Mission seconds between two states of a flight that is not thinned out."""
_MOST_STATES = 12_000
"""States of a robot; beyond, every second one is left out: an hour has one each 0.4 s."""
_MOST_NAMES = 1_000_000
"""Names in all statuses and plans of a recording."""
_STATUS_PERIOD = NANOSECONDS
"""Mission nanoseconds between two statuses that differ in figures alone."""
_TRAFFIC_PERIOD = NANOSECONDS
"""Mission nanoseconds between two words on other aircraft; between them they fly on."""
_MOST_AIRCRAFT = 32
"""As many as a vehicle's state has."""


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
    """Collects a robot's messages in the order of recording."""

    def __init__(self, room: Room) -> None:
        """Collect as much as there is `room` for, which all robots share."""
        self.track = TrackOut(states=[], statuses=[], ahead=[], plans=[])
        """The flight so far."""
        self._room = room
        self._interval = round(STATE_SECONDS * NANOSECONDS)
        self._traffic_due = 0

    def add_state(self, state: VehicleState) -> None:
        """Add a vehicle's state."""
        states = self.track.states
        if states and state.stamp < states[-1].stamp + self._interval:
            return
        traffic = tuple(one for one in state.traffic[:_MOST_AIRCRAFT] if _is_placed(one))
        if state.stamp < self._traffic_due or not (traffic and self._room.reserve(len(traffic))):
            traffic = ()
        else:
            self._traffic_due = state.stamp + _TRAFFIC_PERIOD
        drawn = VehicleState(
            state.stamp,
            state.odometry,
            state.battery,
            state.mode,
            state.armed,
            state.gps,
            traffic=traffic,
        )
        states.append(drawn)
        if len(states) > _MOST_STATES:
            self._interval *= 2
            del states[1::2]

    def add_status(self, status: MissionStatus, ahead: int) -> None:
        """Add a mission's status.

        Args:
            status: The status.
            ahead: Number of waypoints that follow its target.
        """
        visited, given_up = status.visited[-RECENT:], status.given_up[-RECENT:]
        new = replace(status, pending=(), visited=visited, given_up=given_up)
        track, ahead = self.track, max(0, ahead)
        if track.statuses:
            last = track.statuses[-1]
            figures = {"stamp": last.stamp, "distance": last.distance, "outlook": last.outlook}
            same = ahead == track.ahead[-1] and replace(new, **figures) == last
            if same and new.stamp < last.stamp + _STATUS_PERIOD:
                return
            # A stranger's may be in any order.
            new = replace(new, stamp=max(new.stamp, last.stamp))
        if self._room.reserve(1 + len(visited) + len(given_up) + len(new.faults)):
            track.statuses.append(new)
            track.ahead.append(ahead)

    def add_plan(self, plan: MissionPlan) -> None:
        """Add a new plan: the waypoints ahead."""
        plans = self.track.plans
        if self._room.reserve(1 + len(plan.waypoints)):
            stamp = max(plan.stamp, plans[-1].stamp if plans else 0)
            plans.append(MissionPlan(stamp, plan.waypoints))


def _is_placed(aircraft: Traffic) -> bool:
    """Whether its place along the ground and its velocity are known."""
    return is_finite(aircraft.position[:2]) and is_finite(aircraft.velocity)
