"""One robot's recorded flight, thinned out to what a page can draw."""

from __future__ import annotations

from typing import Any

from aerodaas.clock import seconds
from aerodaas.protocol.playback import GpsOut, HeardOut, PlaceOut, TrackOut
from aerodaas.protocol.schemas import OutlookOut, StatusOut, TrafficOut

__all__ = ["ROW_SECONDS", "Room", "TrackBuilder"]

ROW_SECONDS = 0.1
"""Mission seconds between two rows of a flight that is not thinned out."""
_MOST_ROWS = 12_000
"""Rows of a robot; beyond, every second one is left out: an hour has one each 0.4 s."""
_MOST_NAMES = 1_000_000
"""Names in all statuses and places of a recording."""
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
    """What a recording's page has room for; what does not fit is counted."""

    def __init__(self) -> None:
        self._left = _MOST_NAMES
        self.untold = 0
        """Changes, places and alerts left out."""

    def take(self, names: int) -> bool:
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
        self._outlook: OutlookOut | None = None
        self._plan: list[str] = []
        self._pending = 0
        self._known: dict[str, tuple[float, float, float]] = {}
        self._now = _NOTHING

    @property
    def track(self) -> TrackOut:
        """The flight so far."""
        return self._track

    def state(self, value: dict[str, Any]) -> None:
        """Take a vehicle's state."""
        now, track = seconds(value["stamp"]), self._track
        self._change(now, {"mode": value["mode"]})
        if track.time and now < track.time[-1] + self._interval:
            return
        self._hear(now, value.get("traffic"))
        odometry = value["odometry"]
        track.time.append(now)
        track.position.append(_vector(odometry["position"]))
        track.velocity.append(_vector(odometry["velocity"]))
        track.yaw.append(odometry["yaw"])
        track.roll.append(odometry.get("roll"))
        track.pitch.append(odometry.get("pitch"))
        track.battery.append(value["battery"]["fraction"])
        track.distance.append(self._flown)
        track.outlook.append(self._outlook)
        track.gps.append(_gps(value.get("gps")))
        if len(track.time) > _MOST_ROWS:
            self._interval *= 2
            for rows in (track.time, track.position, track.velocity, track.yaw, track.roll,
                         track.pitch, track.battery, track.distance, track.outlook,
                         track.gps):  # fmt: skip
                del rows[1::2]

    def _hear(self, now: float, told: object) -> None:
        """Take the other aircraft of a state, once a second and when the last one is gone."""
        heard = self._track.traffic
        aircraft = _traffic(told)
        due = not heard or now >= heard[-1].since + _HEARD_SECONDS or not aircraft
        changed = bool(aircraft or (heard and heard[-1].aircraft))
        if changed and due and self._room.take(1 + len(aircraft)):
            heard.append(HeardOut(since=now, aircraft=aircraft))

    def mission(self, value: dict[str, Any]) -> None:
        """Take a mission's status."""
        self._flown = float(value["distance"])
        self._outlook = _outlook(value.get("outlook"))
        target, pending = value.get("target"), value.get("pending")
        name = target.get("id") if isinstance(target, dict) else None
        self._pending = pending if isinstance(pending, int) and pending > 0 else 0
        faults = value.get("faults")
        progress = value.get("visits")
        visited = progress if isinstance(progress, int) else len(value["visited"])
        self._change(
            seconds(value["stamp"]),
            {
                "state": value["state"],
                "reason": value["reason"],
                "pilot": value.get("pilot", ""),
                "target": name if isinstance(name, str) else None,
                "visited": value["visited"][-_MOST_BEHIND:],
                "given_up": value["given_up"][-_MOST_BEHIND:],
                "waypoints_visited": visited,
                **self._ahead(),
                "faults": [str(one) for one in faults] if isinstance(faults, list) else [],
            },
        )

    def plan(self, value: dict[str, Any]) -> None:
        """Take a new plan: the waypoints ahead."""
        now = seconds(value["stamp"])
        self._plan = [one["id"] for one in value["waypoints"]]
        for one in value["waypoints"]:
            place = (float(one["x"]), float(one["y"]), float(one["z"]))
            if self._known.get(one["id"]) == place:
                continue
            if self._room.take(1):
                self._known[one["id"]] = place
                self._track.places.append(PlaceOut(since=now, id=one["id"], place=place))
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
        if self._room.take(1 + sum(map(len, names))):
            self._now = new
            self._track.statuses.append(new)


def _outlook(value: dict[str, Any] | None) -> OutlookOut | None:
    """A recorded outlook, if all of it is known."""
    return None if value is None or None in value.values() else OutlookOut(**value)


def _traffic(told: object) -> list[TrafficOut]:
    """The recorded aircraft whose place is known; none of what is malformed."""
    found = map(_aircraft, told[:_MOST_AIRCRAFT] if isinstance(told, list) else [])
    return [one for one in found if one is not None]


def _aircraft(told: Any) -> TrafficOut | None:  # noqa: ANN401 - of a stranger's recording
    try:
        place, velocity = (_vector(told[name]) for name in ("position", "velocity"))
        return TrafficOut(**{**told, "position": place, "velocity": velocity})
    except (KeyError, TypeError, ValueError):
        return None


def _gps(value: dict[str, Any] | None) -> GpsOut | None:
    """A recorded fix; zeros stand for what the receiver does not tell."""
    if value is None:
        return None
    satellites = value.get("satellites")
    return GpsOut(
        satellites=int(satellites) if satellites else None,
        position_sigma=value.get("horizontal_sigma") or None,
    )


def _vector(value: dict[str, Any]) -> tuple[float | None, float | None, float | None]:
    return value["x"], value["y"], value["z"]
