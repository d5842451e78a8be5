"""What a command that follows something goes by, in the frame that it was made from."""

from __future__ import annotations

import enum
from dataclasses import dataclass

from aerodaas.types.records import fast_pickle

__all__ = ["FollowedTarget", "TargetState"]


class TargetState(str, enum.Enum):
    """How sure a follower is of its target in one frame."""

    SURE = "sure"
    LIKELY = "likely"
    """Another one came close, and they were not told apart since: this is the likelier one."""
    UNCERTAIN = "uncertain"
    """It is not known which of those seen it is; the drone holds."""
    UNSEEN = "unseen"
    """It was not found in this frame: the drone slows, holds or searches."""


@fast_pickle
@dataclass(frozen=True, slots=True)
class FollowedTarget:
    """The target of a velocity command. Its frame is the one that the command was made from."""

    state: TargetState
    box: tuple[float, float, float, float] | None = None
    """Left, top, right, bottom in the frame's pixels; None where it is not known."""
    track_id: int | None = None
    """Of the follower's own tracker."""
