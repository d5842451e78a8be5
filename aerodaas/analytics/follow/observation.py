"""Input of a follower's controller for one frame."""

from __future__ import annotations

from aerodaas.analytics.base import Context
from aerodaas.following.steering import surfaces
from aerodaas.following.target import Observation, RelativeTarget
from aerodaas.messages.detections import Detections

__all__ = ["observation"]


def observation(
    boxes: Detections,
    sighting: RelativeTarget | None,
    context: Context,
    *,
    others: tuple[RelativeTarget, ...] = (),
    people: tuple[RelativeTarget, ...] = (),
) -> Observation:
    """Combine the `sighting` in `boxes` with the drone's odometry at capture and at present.

    `others` and `people` are those of `Observation`.
    """
    state = context.vehicle()
    return Observation(
        stamp=boxes.header.stamp,
        sighting=sighting,
        at_capture=boxes.odometry,
        now=None if state is None else state.odometry,
        now_stamp=None if state is None else state.stamp,
        others=others,
        people=people,
        surfaces=surfaces(boxes),
    )
