"""The actions of a waypoint by the keywords of its constructor, for short assertions."""

from __future__ import annotations

from types import SimpleNamespace

from aerodaas.messages.actions import (
    AimGimbal,
    LookAt,
    MoveActuator,
    RecordVideo,
    SetLens,
    TakePhoto,
    TriggerPhotos,
)
from aerodaas.messages.waypoints import Waypoint

__all__ = ["keywords"]


def keywords(waypoint: Waypoint) -> SimpleNamespace:
    """What `Waypoint` was given, or could have been given, to do this."""
    trigger, aim = waypoint.action(TriggerPhotos), waypoint.action(AimGimbal)
    look, lens = waypoint.action(LookAt), waypoint.action(SetLens)
    video = waypoint.action(RecordVideo)
    moves = [one for one in waypoint.actions if isinstance(one, MoveActuator)]
    return SimpleNamespace(
        photo=waypoint.action(TakePhoto) is not None,
        trigger_distance=trigger and trigger.distance,
        trigger_interval=trigger and trigger.interval,
        gimbal_pitch=aim and aim.pitch,
        gimbal_yaw=aim and aim.yaw,
        look_at=look and look.place,
        zoom=lens and lens.zoom,
        focus=lens and lens.focus,
        video=video and video.on,
        actuate={one.actuator: one.position for one in moves},
    )
