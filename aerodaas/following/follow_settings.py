"""What can be tuned about following, with the reason for each default."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["FollowGains", "FollowLimits", "LostPolicy", "TargetChoice"]


@dataclass(frozen=True, slots=True)
class FollowGains:
    """Proportional, integral and derivative gains.

    With a frame every 0.2 s and 0.2 s from capture to command, gains above about 2 per second
    start to swing.
    """

    distance: tuple[float, float, float] = (0.9, 0.15, 0.0)
    """m/s for each metre, metre second and m/s."""
    yaw: tuple[float, float, float] = (1.5, 0.1, 0.0)
    """rad/s for each radian, radian second and rad/s."""
    height: float = 1.0
    """m/s for each metre."""


@dataclass(frozen=True, slots=True)
class FollowLimits:
    """What a command never exceeds, near people."""

    forward: float = 1.5
    """m/s towards the target."""
    backward: float = 2.0
    """m/s away from it. Nothing looks where the drone goes then, but whoever walks up to it, at the
    1.4 m/s that people walk, must not reach it."""
    climb: float = 0.5
    """m/s up or down."""
    yaw_rate: float = 1.2
    """rad/s."""
    acceleration: float = 1.5
    """m/s^2 of the commanded velocity."""
    braking: float = 2.5
    """m/s^2 with which the drone is sure to stop: how fast it may come near is reckoned with it."""
    stopping: float = 4.0
    """m/s^2 of the commanded velocity where the drone would else come too near: the airframe does
    what it can."""
    reaction_time: float = 0.4
    """Seconds from the command to brake until the drone does: the tilting of the airframe. The time
    between two frames, in which no such command can come, is measured and added."""
    response: float = 0.4
    """Seconds by which the airframe's velocity lags behind the commanded one."""
    yaw_acceleration: float = 4.0
    """rad/s^2 of the commanded yaw rate."""
    nearest: float = 0.6
    """Part of the wanted distance within which the drone never moves towards the target; it comes
    up no faster than it could stop there."""


@dataclass(frozen=True, slots=True)
class LostPolicy:
    """What happens after the target went out of sight; each time in seconds from then."""

    coast: float = 0.4
    """Until here it is followed where it should be: a detector misses now and then."""
    slow: float = 1.4
    """Until here the drone slows down to a stop."""
    hold: float = 3.0
    """Until here it waits for the same target; from here on, another may take its place."""
    search: float = 18.0
    """Until here it turns in search, at 0.5 rad/s more than once around; then it gives up."""
    search_rate: float = 0.5
    """rad/s."""


@dataclass(frozen=True, slots=True)
class TargetChoice:
    """What it takes to be chosen as a target; one that is held is held on less."""

    score: float = 0.0
    """Least mean confidence of the track that is chosen, and below which it gives way to a much
    surer one; the detector's own threshold holds as well."""
    sure: float = 0.0
    """Confidence from which a box begins a track; below, it only continues one."""
    looks: int = 2
    """Frames in which it must have been seen, the first target by a drone that is up."""
    grounded: bool = False
    """It stands on the ground: a box of its size that hangs in the air is something else, and one
    that fills the picture from side to side down to its lower edge may be the ground itself. Not
    for a part of a thing, such as a vest, nor where the ground is far from level."""
    whole: bool = False
    """The first look at it shows all of it: of what fills the picture, the size is not known."""
    shared: float = 1.0
    """Of two boxes that share more than this part of the smaller one, the better one counts; 1
    counts both."""
