"""The actions of a waypoint by the keywords of its constructor, for short assertions."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from aerodaas.messages.waypoints import Waypoint

__all__ = ["keywords"]


def keywords(waypoint: Waypoint) -> SimpleNamespace:
    """What `Waypoint` was given, or could have been given, to do this."""
    done: dict[str, Any] = {action.type: action for action in waypoint.actions}
    trigger, aim, look = (done.get(kind) for kind in ("trigger_photos", "aim_gimbal", "look_at"))
    lens, video = done.get("set_lens"), done.get("record_video")
    moves: list[Any] = [one for one in waypoint.actions if one.type == "move_actuator"]
    return SimpleNamespace(
        photo="take_photo" in done,
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
