"""Tuning parameters of following, with the reason for each default."""

from __future__ import annotations

import math
from dataclasses import dataclass

__all__ = ["FollowGains", "FollowLimits", "LostPolicy", "TargetChoice"]


@dataclass(frozen=True, slots=True)
class FollowGains:
    """Proportional, integral and derivative gains of the follower.

    With a frame every 0.2 s and a latency of 0.2 s from capture to command, gains above about 2
    per second start to oscillate.
    """

    distance: tuple[float, float, float] = (0.9, 0.15, 0.0)
    """m/s per metre, metre second and m/s."""
    yaw: tuple[float, float, float] = (1.5, 0.1, 0.0)
    """rad/s per radian, radian second and rad/s."""
    height: float = 1.0
    """m/s per metre."""


@dataclass(frozen=True, slots=True)
class FollowLimits:
    """Limits of a follower's commands, near people."""

    forward: float = 1.5
    """Speed towards the target, m/s."""
    backward: float = 2.0
    """Speed away from the target, m/s. No camera covers that direction, but a person approaching at
    a walking speed of 1.4 m/s must not reach the drone."""
    climb: float = 0.5
    """Vertical speed, m/s."""
    yaw_rate: float = 1.2
    """Yaw rate, rad/s."""
    acceleration: float = 1.5
    """Acceleration of the commanded velocity, m/s²."""
    braking: float = 2.5
    """Deceleration that the drone reliably achieves, m/s²; it determines the speed of approach."""
    stopping: float = 4.0
    """Acceleration of the commanded velocity to avoid coming too near, m/s², which the airframe
    follows as well as it can."""
    reaction_time: float = 0.4
    """Seconds from the command to brake until the drone brakes, after tilting. The time between two
    frames, during which no such command is computed, is measured and added."""
    response: float = 0.4
    """Lag of the airframe's velocity behind the commanded one, seconds."""
    reply: float = 0.22
    """Lag of the airframe's acceleration behind a sudden command to give way, seconds."""
    evasion: float = 3.0
    """Acceleration by which the drone gives way to a person who comes at it, m/s²; commanded at
    once, without a ramp. The default is an environment's `max_acceleration`."""
    contact: float = 0.5
    """Distance from a person's axis that the drone does not fall below, metres."""
    yaw_acceleration: float = 4.0
    """Acceleration of the commanded yaw rate, rad/s²."""
    nearest: float = 0.6
    """Fraction of the wanted distance within which the drone never moves towards the target; its
    approach is slow enough to stop there."""


@dataclass(frozen=True, slots=True)
class LostPolicy:
    """Reaction to a lost target; each time in seconds since its last sighting."""

    coast: float = 0.4
    """End of following the predicted target, as a detector misses occasionally."""
    slow: float = 1.4
    """End of slowing down to a stop."""
    hold: float = 3.0
    """End of waiting for the same target; afterwards, another one may replace it."""
    search: float = 18.0
    """End of turning in search, at 0.5 rad/s more than one revolution; then the target is given
    up."""
    search_rate: float = 0.5
    """Yaw rate of the search, rad/s."""


@dataclass(frozen=True, slots=True)
class TargetChoice:
    """Conditions for choosing a target; a target is held under weaker ones."""

    score: float = 0.0
    """Least mean confidence of the chosen track, below which it gives way to a much surer one; the
    detector's own threshold applies as well."""
    sure: float = 0.0
    """Least confidence of a box that starts a track; others only continue one."""
    patience: float = math.inf
    """Seconds in sight, with the drone high enough, after which a mean confidence of `sure` makes
    the first target, too: from the side an arm hides most of a vest. Not once a target was given
    up, for which another must not be taken."""
    looks: int = 2
    """Number of frames with a detection before the choice; for the first target, with the drone
    high enough."""
    grounded: bool = False
    """Whether the target stands on the ground: a box of its size in the air is another object, and
    one that fills the image from side to side down to its lower edge may be the ground. Not for a
    part of an object, such as a vest, nor on ground that is far from level."""
    whole: bool = False
    """Whether the first detection must show all of the target, as the size of an object that fills
    the image is unknown."""
    shared: float = 1.0
    """Shared fraction of the smaller of two boxes above which only the better one counts; 1 keeps
    both."""
