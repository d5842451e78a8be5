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

    Args:
        boxes: Boxes of one frame.
        sighting: The target in it; None if it is not seen.
        context: Services of the node, with the vehicle's newest state.
        others: Everybody and everything else that the drone must not fly into.
        people: Everybody who is seen, among them the target if that is a person.
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
