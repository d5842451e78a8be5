"""Pictures, video, gimbal and region of interest of a plan's items, as waypoints have them.

A plan says what goes on from an item; a waypoint says what is done on the way to it and there. So
what begins at an item is given to the waypoints behind it; a single picture is the waypoint's
before it, and so is a turn of the gimbal that comes before pictures there, and the beginning or end
of a video.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.errors import ConfigError, InvalidWaypointError
from aerodaas.extensions.actuators.actions import MoveActuator
from aerodaas.extensions.payload.actions import (
    LEAST_TRIGGER,
    AimGimbal,
    LookAt,
    RecordVideo,
    TakePhoto,
    TriggerPhotos,
)
from aerodaas.extensions.plans.commands import (
    MOUNT_MAVLINK_TARGETING,
    MOUNT_NEUTRAL,
    why_not,
)
from aerodaas.extensions.plans.formats.numbers import LatLon, place
from aerodaas.extensions.plans.plan import PlanItem
from aerodaas.geometry.frames import wrap_angle
from aerodaas.messages.waypoints import HeightReference, Waypoint

__all__ = ["Height", "PictureItems", "same_place"]

Height = Callable[[PlanItem, LatLon], tuple[float, HeightReference | None]]
"""Height of an item's place: metres above home, or above what follows; raises ConfigError."""

_ROI_NONE, _ROI_LOCATION = 0, 3
"""MAV_ROI."""
_SHOOT = 1
"""DO_DIGICAM_CONTROL: take a picture."""
_YAW_LOCK = 16
"""GIMBAL_MANAGER_FLAGS_YAW_LOCK: yaw counts from north."""
_NOBODY = "no waypoint comes after it"
_NOT_HERE = "no waypoint comes before it"


def same_place(waypoint: Waypoint, item: PlanItem) -> Waypoint:
    """Another waypoint there, for what `item` says, with nothing of what is done at the first.

    Args:
        waypoint: Waypoint at the place.
        item: Item of the plan, whose number is the new waypoint's id.
    """
    kept = tuple(one for one in waypoint.actions if isinstance(one, TriggerPhotos))
    return replace(waypoint, id=f"item{item.number}", hover_duration=0.0, actions=kept)


class _Aim:
    """Where camera or gimbal are to look: angles in radians, or a place."""

    def __init__(
        self,
        item: PlanItem,
        angles: tuple[float, float] = (0.0, 0.0),
        spot: tuple[float, float, float] | None = None,
        above: HeightReference | None = None,
    ) -> None:
        self.item = item
        self.angles = angles
        self.spot = spot
        self.above = above

    def at(self, waypoint: Waypoint) -> Waypoint:
        """`waypoint`, with this aim; raises InvalidWaypointError if it cannot have it."""
        if self.spot is None:
            return waypoint.with_actions(AimGimbal(*self.angles))
        if waypoint.above != self.above:
            raise InvalidWaypointError("its height is not counted from what the waypoint's is")
        return waypoint.with_actions(LookAt(*self.spot))


class PictureItems:
    """Picture commands of a plan's items, up to an item."""

    def __init__(self, height: Height, *, ardupilot: bool) -> None:
        """Take no pictures; `height` is for places to look at."""
        self._height = height
        self._ardupilot = ardupilot
        self._distance: float | None = None
        self._interval: float | None = None
        self._begun: PlanItem | None = None
        """Item that began pictures which no waypoint has had yet."""
        self._aim: _Aim | None = None
        """What no waypoint has had yet."""
        self._angles = (0.0, 0.0)
        self._looks = False
        self.commands: dict[int, Callable[[PlanItem, list[Waypoint]], str]] = {
            mavlink.MAV_CMD_DO_SET_CAM_TRIGG_DIST: self._by_distance,
            mavlink.MAV_CMD_DO_SET_CAM_TRIGG_INTERVAL: self._by_time,
            mavlink.MAV_CMD_DO_DIGICAM_CONTROL: self._photograph,
            mavlink.MAV_CMD_IMAGE_START_CAPTURE: self._capture,
            mavlink.MAV_CMD_IMAGE_STOP_CAPTURE: self._begin,
            mavlink.MAV_CMD_DO_MOUNT_CONTROL: self._mount,
            mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW: self._manage,
            mavlink.MAV_CMD_DO_SET_ROI: self._region,
            mavlink.MAV_CMD_DO_SET_ROI_LOCATION: self._look_at,
            mavlink.MAV_CMD_DO_SET_ROI_NONE: self._look_away,
            mavlink.MAV_CMD_VIDEO_START_CAPTURE: partial(self._film, on=True),
            mavlink.MAV_CMD_VIDEO_STOP_CAPTURE: partial(self._film, on=False),
        }
        """What is done by each command that is known."""

    def add_item(self, item: PlanItem, waypoints: list[Waypoint]) -> str:
        """Add an item of `commands` to the waypoint before it.

        Args:
            item: Item of the plan.
            waypoints: Waypoints so far; the last ones are changed or added to.

        Returns:
            Why the item is not done, or an empty text.
        """
        try:
            return self.commands[item.command](item, waypoints)
        except (ConfigError, InvalidWaypointError) as error:
            return str(error)

    def given(self, waypoint: Waypoint) -> tuple[Waypoint, list[tuple[PlanItem, str]]]:
        """A new waypoint, with what items before it say, and what it cannot have."""
        self._begun = None
        dressed = waypoint
        if self._distance or self._interval:
            dressed = waypoint.with_actions(TriggerPhotos(self._distance, self._interval))
        aim, self._aim = self._aim, None
        if aim is None:
            return dressed, []
        try:
            return aim.at(dressed), []
        except InvalidWaypointError as error:
            return dressed, [(aim.item, str(error))]

    def left(self) -> Iterator[tuple[PlanItem, str]]:
        """Items whose word no waypoint has had."""
        waiting = (self._begun, None if self._aim is None else self._aim.item)
        yield from ((item, _NOBODY) for item in waiting if item is not None)

    def _by_distance(self, item: PlanItem, waypoints: list[Waypoint]) -> str:
        return self._begin(item, waypoints, distance=item.values[0] or 0.0)

    def _by_time(self, item: PlanItem, waypoints: list[Waypoint]) -> str:
        milliseconds = item.values[0] or 0.0
        if milliseconds <= 0.0:
            return "an interval of 0 changes nothing"
        return self._begin(item, waypoints, interval=milliseconds / 1000.0)

    def _capture(self, item: PlanItem, waypoints: list[Waypoint]) -> str:
        _, interval, count, _ = item.values
        if count == 1:
            return self._photograph(item, waypoints)
        if count or not interval:
            return "single pictures are taken, and those by time until they are stopped"
        return self._begin(item, waypoints, interval=interval)

    def _begin(
        self,
        item: PlanItem,
        waypoints: list[Waypoint],
        distance: float = 0.0,
        interval: float = 0.0,
    ) -> str:
        """Take pictures from here on, by distance or by time, or none."""
        distance, interval = max(distance, 0.0), max(interval, 0.0)
        if 0.0 < distance + interval < LEAST_TRIGGER:
            return f"pictures are taken at least {LEAST_TRIGGER} m or s apart"
        self._distance, self._interval = distance or None, interval or None
        begins = bool(distance or interval)
        self._begun = item if begins else None
        if begins:
            self._aim_here(waypoints)
        return ""

    def _photograph(self, item: PlanItem, waypoints: list[Waypoint]) -> str:
        if item.command == mavlink.MAV_CMD_DO_DIGICAM_CONTROL and item.x != _SHOOT:
            return why_not(item.command)
        if not waypoints:
            return _NOT_HERE
        if waypoints[-1].action(RecordVideo):
            # The picture of a waypoint is taken before.
            waypoints.append(same_place(waypoints[-1], item))
        if waypoints[-1].action(TakePhoto):
            return "one picture is taken at a waypoint"
        self._aim_here(waypoints)
        waypoints[-1] = waypoints[-1].with_actions(TakePhoto())
        return ""

    def _aim_here(self, waypoints: list[Waypoint]) -> None:
        """Give a pending aim to the waypoint before, where pictures are taken now."""
        aim = self._aim
        if aim is None or not waypoints:
            return
        last = waypoints[-1]
        if any(last.action(kind) for kind in (TakePhoto, AimGimbal, LookAt)):
            return
        waypoints[-1] = aim.at(last)
        self._aim = None

    def _film(self, item: PlanItem, waypoints: list[Waypoint], *, on: bool) -> str:
        """Begin or end a video at the waypoint before."""
        if stream := item.values[0]:
            return f"the camera's video is recorded whole, not its stream {stream:g}"
        if not waypoints:
            return _NOT_HERE
        last = waypoints[-1]
        if last.hover_duration or last.action(RecordVideo) or last.action(MoveActuator):
            # A waypoint has one order for its video, which comes before stay and actuators.
            waypoints.append(same_place(last, item))
        if on:
            self._aim_here(waypoints)
        waypoints[-1] = waypoints[-1].with_actions(RecordVideo(on))
        return ""

    def _mount(self, item: PlanItem, _: list[Waypoint]) -> str:
        mode = item.z or 0.0
        if mode == MOUNT_NEUTRAL:
            return self._aim_gimbal(item, 0.0, 0.0)
        if mode == MOUNT_MAVLINK_TARGETING or (self._ardupilot and not mode):
            return self._aim_gimbal(item, item.values[0], item.values[2])
        return f"of mount modes angles are done, and neutral, not mode {mode:g}"

    def _manage(self, item: PlanItem, _: list[Waypoint]) -> str:
        pitch, right, *_rates = item.values
        if pitch is None and right is None:
            return "angles are done, not rates"
        if int(item.x or 0.0) & _YAW_LOCK and right is not None:
            return "yaw counts from the nose here, not from north"
        return self._aim_gimbal(item, pitch, right)

    def _region(self, item: PlanItem, waypoints: list[Waypoint]) -> str:
        """Do what DO_SET_ROI says, which the other commands for regions of interest replace."""
        if item.values[0] == _ROI_NONE:
            return self._look_away(item, waypoints)
        if item.values[0] == _ROI_LOCATION:
            return self._look_at(item, waypoints)
        return why_not(item.command)

    def _look_away(self, item: PlanItem, _: list[Waypoint]) -> str:
        return self._aim_gimbal(item, 0.0, 0.0) if self._looks else why_not(item.command)

    def _look_at(self, item: PlanItem, _: list[Waypoint]) -> str:
        at = place(item.x, item.y, "it")
        height, above = self._height(item, at)
        self._aim = _Aim(item, spot=(*at, height), above=above)
        self._looks = True
        return ""

    def _aim_gimbal(self, item: PlanItem, pitch: float | None, right: float | None) -> str:
        """Turn the gimbal to angles in degrees, up and to the right; None leaves one as it was."""
        before = self._angles
        angles = (
            before[0] if pitch is None else wrap_angle(math.radians(pitch)),
            before[1] if right is None else wrap_angle(math.radians(-right)),
        )
        self._angles, self._looks = angles, False
        self._aim = _Aim(item, angles)
        return ""
