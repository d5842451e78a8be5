"""Pictures, video, gimbal and places to look at of waypoints, as a plan's items."""

from __future__ import annotations

import math
from collections.abc import Iterator

from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.extensions.payload.actions import (
    AimGimbal,
    RecordVideo,
    TakePhoto,
    TriggerPhotos,
)
from aerodaas.extensions.plans.commands import (
    FRAME_MISSION,
    MOUNT_MAVLINK_TARGETING,
)
from aerodaas.extensions.plans.plan import PlanItem
from aerodaas.messages.waypoints import Waypoint

__all__ = ["PictureWriter"]

_AT_ONCE = 1.0
"""DO_SET_CAM_TRIGG_DIST: the first picture is taken at the beginning."""


class PictureWriter:
    """Items before and behind each waypoint, in order; their numbers are the caller's."""

    def __init__(self) -> None:
        """Take no pictures yet."""
        self._distance: float | None = None
        self._interval: float | None = None

    def before(
        self, waypoint: Waypoint, frame: int, spot: tuple[float, float, float] | None
    ) -> Iterator[PlanItem]:
        """Plan items on the way to `waypoint`.

        Args:
            waypoint: The waypoint.
            frame: MAVLink frame of `spot`.
            spot: Place to look at, by latitude and longitude in degrees and height in metres; None
                for none.
        """
        yield from self._triggers(waypoint.action(TriggerPhotos))
        gimbal = waypoint.action(AimGimbal)
        if gimbal is not None:
            values = (math.degrees(gimbal.pitch), 0.0, -math.degrees(gimbal.yaw), 0.0)
            yield PlanItem(
                *(0, mavlink.MAV_CMD_DO_MOUNT_CONTROL, FRAME_MISSION, values, 0.0, 0.0),
                float(MOUNT_MAVLINK_TARGETING),
            )
        if spot is not None:
            yield PlanItem(
                0, mavlink.MAV_CMD_DO_SET_ROI_LOCATION, frame, (0.0, 0.0, 0.0, 0.0), *spot
            )

    def behind(self, waypoint: Waypoint) -> Iterator[PlanItem]:
        """Plan items at `waypoint`."""
        if waypoint.action(TakePhoto):
            yield _item(mavlink.MAV_CMD_IMAGE_START_CAPTURE, 0.0, 0.0, 1.0)
        if video := waypoint.action(RecordVideo):
            yield _item(
                mavlink.MAV_CMD_VIDEO_START_CAPTURE
                if video.on
                else mavlink.MAV_CMD_VIDEO_STOP_CAPTURE
            )
            if waypoint.hover_duration:
                yield _item(mavlink.MAV_CMD_NAV_DELAY, waypoint.hover_duration, -1.0, -1.0, -1.0)

    def end(self) -> Iterator[PlanItem]:
        """Plan items that end with the last waypoint."""
        yield from self._triggers(None)

    def _triggers(self, trigger: TriggerPhotos | None) -> Iterator[PlanItem]:
        distance = None if trigger is None else trigger.distance
        interval = None if trigger is None else trigger.interval
        # A camera by distance is not stopped by what stops one by time, and the other way round.
        if self._interval is not None and interval is None:
            yield _item(mavlink.MAV_CMD_IMAGE_STOP_CAPTURE)
        if distance != self._distance and (distance or self._distance):
            yield _item(
                mavlink.MAV_CMD_DO_SET_CAM_TRIGG_DIST,
                distance or 0.0,
                0.0,
                _AT_ONCE if distance else 0.0,
            )
        if interval is not None and interval != self._interval:
            yield _item(mavlink.MAV_CMD_IMAGE_START_CAPTURE, 0.0, interval, 0.0)
        self._distance, self._interval = distance, interval


def _item(command: int, *values: float) -> PlanItem:
    first, second, third, fourth = (*values, 0.0, 0.0, 0.0, 0.0)[:4]
    return PlanItem(0, command, FRAME_MISSION, (first, second, third, fourth), 0.0, 0.0, 0.0)
