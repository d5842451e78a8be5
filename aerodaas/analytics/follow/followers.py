"""Followers of persons, hazard vests and cars, with sizes and distances suited to each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from aerodaas.analytics.boxes import BoxAnalytics
from aerodaas.analytics.follow.analytics import FollowAnalytics
from aerodaas.config.checked import Positive
from aerodaas.dataflow.interfaces import IEnvironment
from aerodaas.following.follow_settings import FollowGains, FollowLimits, LostPolicy, TargetChoice
from aerodaas.following.target import TargetMotion, TargetSize
from aerodaas.messages.waypoints import DEFAULT_PRIORITY

__all__ = ["CarFollowAnalytics", "PersonFollowAnalytics", "VipFollowAnalytics"]


class PersonFollowAnalytics(FollowAnalytics):
    """Follows a whole person, 1.7 m tall."""


class VipFollowAnalytics(FollowAnalytics):
    """Follows a person by the hazard vest, from 2 m at a height of 1.5 m as in the paper.

    A vest's outline is about 0.6 m tall and 0.43 m wide, and is entirely in the image at that
    distance.
    """

    def __init__(
        self,
        environment: IEnvironment | None = None,
        *,
        distance: Positive = 2.0,
        height: Positive = 1.5,
        labels: Sequence[str] = ("vest", "hazard vest"),
        target_height: Positive = 0.6,
        target_width: Positive = 0.43,
        gains: FollowGains | None = None,
        limits: FollowLimits | None = None,
        lost: LostPolicy | None = None,
        choice: TargetChoice | None = None,
        priority: int = DEFAULT_PRIORITY,
        detector: BoxAnalytics.Detector | None = None,
    ) -> None:
        """Follow a hazard vest.

        Args:
            environment: Ignored; accepted because the paper's listings pass it.
            distance: Distance to keep along the ground, metres.
            height: Flight height, metres.
            labels: Labels of the boxes to follow.
            target_height: Height of the vest, metres.
            target_width: Width of the vest, metres.
            gains: Controller gains; by default `FollowGains()`.
            limits: Limits of the commands; by default `FollowLimits()`.
            lost: Reaction to a lost target; by default `LostPolicy()`.
            choice: Conditions for choosing a target; by default strict ones, because a sunlit
                wall may resemble a vest.
            priority: Priority of the velocity commands.
            detector: Detector for camera streams; by default the shipped one.

        Raises:
            ConfigError: If a length is not positive and finite.
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
    """Follows a car, 1.5 m tall, from 6 m at a height of 2.5 m, so that all of it is in the image.

    Following ends, so that an interrupted survey resumes, when the car leaves the `area` or is
    out of sight for some seconds.
    """

    falls: ClassVar[bool] = False

    def __init__(
        self,
        environment: IEnvironment | None = None,
        *,
        distance: Positive = 6.0,
        height: Positive = 2.5,
        labels: Sequence[str] = ("car",),
        target_height: Positive = 1.5,
        target_width: Positive = 1.8,
        target_length: Positive = 4.2,
        area: Sequence[tuple[float, float]] | None = None,
        gains: FollowGains | None = None,
        limits: FollowLimits | None = None,
        lost: LostPolicy | None = None,
        choice: TargetChoice | None = None,
        priority: int = DEFAULT_PRIORITY,
        detector: BoxAnalytics.Detector | None = None,
    ) -> None:
        """Follow a car.

        Args:
            environment: Ignored; accepted because the paper's listings pass it.
            distance: Distance to keep along the ground, metres.
            height: Flight height, metres.
            labels: Labels of the boxes to follow.
            target_height: Height of the car, metres.
            target_width: Width of the car, metres.
            target_length: Length of the car, metres.
            area: Corners (metres east, north of home) of the polygon outside which no car is
                followed; by default unbounded.
            gains: Controller gains; by default gentler ones than `FollowGains()`.
            limits: Limits of the commands; by default gentler ones than `FollowLimits()`.
            lost: Reaction to a lost target; by default with a search of a few seconds.
            choice: Conditions for choosing a target; by default strict ones, because windows
                resemble cars.
            priority: Priority of the velocity commands.
            detector: Detector for camera streams; by default the shipped one.

        Raises:
            ConfigError: If a length is not positive and finite, or `area` is not a polygon.
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


_VEST_CHOICE = TargetChoice(score=0.5, sure=0.4, patience=2.0, looks=5, whole=True)
"""Strict, because a sunlit wall close to the camera may briefly resemble a vest, which must not end
a search."""
_CAR_LOST = LostPolicy(coast=1.0, slow=2.0, hold=3.0, search=7.0)
"""A short search: a car that has turned away is rarely found again."""
_CAR_CHOICE = TargetChoice(score=0.5, sure=0.3, looks=5, grounded=True, shared=0.6)
"""Windows resemble cars, but are above the ground and score lower; half a car resembles a whole
one."""
_CAR_GAINS = FollowGains(distance=(0.5, 0.05, 0.0))
_CAR_LIMITS = FollowLimits(
    backward=0.6, acceleration=0.8, braking=1.5, stopping=2.0, reaction_time=0.5
)
"""Gentle, because a hard pitch tilts a near car out of the image."""
_CAR_ACCELERATION = 0.3
"""Standard deviation of a car's acceleration among people, m/s^2."""
