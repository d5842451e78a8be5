"""Followers of what the applications follow, with the sizes and distances that suit it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from aerodaas.analytics.boxes import BoxAnalytics
from aerodaas.analytics.follow.analytics import FollowAnalytics
from aerodaas.dataflow.interfaces import IEnvironment
from aerodaas.following.follow_settings import FollowGains, FollowLimits, LostPolicy, TargetChoice
from aerodaas.following.relative_target import TargetSize
from aerodaas.following.target_motion import TargetMotion
from aerodaas.types.waypoints import DEFAULT_PRIORITY

__all__ = ["CarFollowAnalytics", "PersonFollowAnalytics", "VipFollowAnalytics"]


class PersonFollowAnalytics(FollowAnalytics):
    """Follows a whole person, 1.7 m tall."""


class VipFollowAnalytics(FollowAnalytics):
    """Follows a person by the hazard vest, from 2 m at a height of 1.5 m as in the paper.

    A vest's outline is about 0.6 m tall and 0.43 m wide, and is all in the picture at that
    distance.
    """

    def __init__(
        self,
        environment: IEnvironment | None = None,
        *,
        distance: float = 2.0,
        height: float = 1.5,
        labels: Sequence[str] = ("vest", "hazard vest"),
        target_height: float = 0.6,
        target_width: float = 0.43,
        gains: FollowGains | None = None,
        limits: FollowLimits | None = None,
        lost: LostPolicy | None = None,
        choice: TargetChoice | None = None,
        priority: int = DEFAULT_PRIORITY,
        detector: BoxAnalytics.Detector | None = None,
    ) -> None:
        """Follow from `distance`, flying at `height`, in metres.

        The paper's listings pass the environment; the analysed stream knows its own.
        """
        del environment
        super().__init__(
            labels,
            distance,
            height,
            target_height=target_height,
            target_width=target_width,
            gains=gains,
            limits=limits,
            lost=lost,
            choice=choice or _VEST_CHOICE,
            priority=priority,
            detector=detector,
        )


class CarFollowAnalytics(FollowAnalytics):
    """Follows a car, 1.5 m tall, from 6 m at a height of 2.5 m, which has it all in the picture.

    It ends, so that an interrupted survey resumes, when the car leaves the `area`, or when it is
    out of sight for some seconds, having turned away or driven off.
    """

    falls: ClassVar[bool] = False

    def __init__(
        self,
        environment: IEnvironment | None = None,
        *,
        distance: float = 6.0,
        height: float = 2.5,
        labels: Sequence[str] = ("car",),
        target_height: float = 1.5,
        target_width: float = 1.8,
        target_length: float = 4.2,
        area: Sequence[tuple[float, float]] | None = None,
        gains: FollowGains | None = None,
        limits: FollowLimits | None = None,
        lost: LostPolicy | None = None,
        choice: TargetChoice | None = None,
        priority: int = DEFAULT_PRIORITY,
        detector: BoxAnalytics.Detector | None = None,
    ) -> None:
        """Follow from `distance`, flying at `height`, in metres.

        `area` is a polygon of corners (metres east, north of home) beyond which no car is
        followed. The paper's listings pass the environment; the analysed stream knows its own.
        """
        del environment
        super().__init__(
            labels,
            distance,
            height,
            target_height=target_height,
            target_width=target_width,
            area=area,
            gains=gains or _CAR_GAINS,
            limits=limits or _CAR_LIMITS,
            lost=lost or _CAR_LOST,
            motion=TargetMotion(acceleration=_CAR_ACCELERATION),
            choice=choice or _CAR_CHOICE,
            priority=priority,
            detector=detector,
        )
        self.size = TargetSize(target_height, target_width, widest=target_length)


_VEST_CHOICE = TargetChoice(score=0.5, sure=0.4, looks=5, whole=True)
"""A wall in the sun may look a little like a vest, right before the camera and for a moment; nobody
should end a search for that."""
_CAR_LOST = LostPolicy(coast=1.0, slow=2.0, hold=3.0, search=7.0)
"""A car that has turned away is gone sooner than it is found."""
_CAR_CHOICE = TargetChoice(score=0.5, sure=0.3, looks=5, grounded=True, shared=0.6)
"""Windows look like cars, but hang on walls, and are seldom taken for one as surely; half a car
looks like one, too."""
_CAR_GAINS = FollowGains(distance=(0.5, 0.05, 0.0))
_CAR_LIMITS = FollowLimits(
    backward=0.6, acceleration=0.8, braking=1.5, stopping=2.0, reaction_time=0.5
)
"""Gentle: a drone that pitches hard tilts a near car out of the picture."""
_CAR_ACCELERATION = 0.3
"""Standard deviation of a car's acceleration among people, m/s^2."""
