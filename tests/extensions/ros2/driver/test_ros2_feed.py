"""What a drone's topics told, checked."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import pytest
from ros_drone import odometry_message

from aerodaas.extensions.ros2.driver.feed import RosFeed
from aerodaas.extensions.ros2.driver.frames import Alignment
from aerodaas.extensions.ros2.topics import types
from aerodaas.simulation.dynamics import KinematicState

SECOND = 1_000_000_000
EPOCH = 1_800_000_000 * SECOND


class Host:
    """This machine's clock."""

    def __init__(self) -> None:
        self.now = EPOCH

    def __call__(self) -> int:
        """Nanoseconds since the Unix epoch."""
        return self.now


def told(x: float = 1.0, stamp: int = SECOND) -> Any:  # noqa: ANN401
    """Odometry at `x`."""
    motion = KinematicState((x, 2.0, 3.0), (0.0, 0.0, 0.0), 0.1, 0.2, 0.3, 0.0)
    return odometry_message(motion, stamp)


@pytest.fixture
def host() -> Host:
    """A clock that tests move."""
    return Host()


@pytest.fixture
def feed(host: Host) -> RosFeed:
    """Nothing heard yet."""
    return RosFeed("auto", lambda _: Alignment(), host)


def test_odometry_ages(feed: RosFeed, host: Host) -> None:
    """From its arrival, as its stamp is a simulation's."""
    assert feed.age == math.inf
    feed.take_odometry(told())
    host.now += SECOND // 2
    assert feed.age == pytest.approx(0.5)
    feed.take_odometry(told(2.0))
    assert feed.outdated == 1, "the same stamp again"
    assert feed.age == pytest.approx(0.5)
    feed.take_odometry(told(2.0, 2 * SECOND))
    assert feed.age == 0.0
    assert feed.odometry is not None
    np.testing.assert_allclose(feed.odometry.position, [2.0, 2.0, 3.0])


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (lambda one: setattr(one.pose.pose.position, "x", math.nan), "a vector of"),
        (lambda one: setattr(one.pose.pose.position, "z", 1e30), "a vector of"),
        (lambda one: setattr(one.twist.twist.linear, "y", math.inf), "a vector of"),
        (lambda one: setattr(one.pose.pose.orientation, "w", 0.0), "a quaternion of length"),
        (lambda one: setattr(one.header, "frame_id", "odom_ned"), "odom_ned.*ENU and FLU"),
    ],
)
def test_what_nobody_could_fly_by_is_refused(
    feed: RosFeed, host: Host, spoil: object, reason: str
) -> None:
    """With the reason, and what was known stays and ages."""
    feed.take_odometry(told())
    host.now += SECOND
    wrong = told(9.0, 2 * SECOND)
    spoil(wrong)  # type: ignore[operator]
    feed.take_odometry(wrong)
    assert feed.refused == 1
    assert re.search(f"odometry refused: .*{reason}", feed.refusal)
    assert feed.age == pytest.approx(1.0)
    assert feed.odometry is not None
    assert feed.odometry.position[0] == 1.0
    host.now += 3 * SECOND
    assert not feed.refusal


def test_a_battery_and_a_fix_are_forgotten(feed: RosFeed, host: Host) -> None:
    """After a while without news; a charge that is none is unknown."""
    assert math.isnan(feed.battery.fraction)
    battery = types.ros_message(types.BATTERY, percentage=0.5, voltage=11.0, current=-3.0)
    feed.take_battery(battery)
    assert (feed.battery.fraction, feed.battery.voltage, feed.battery.current) == (0.5, 11.0, 3.0)
    feed.take_fix(
        types.ros_message(types.NAV_SAT_FIX, latitude=48.1, longitude=11.6, altitude=520.0)
    )
    fix = feed.fix
    assert fix is not None
    assert (fix.latitude, fix.longitude, fix.altitude) == (48.1, 11.6, 520.0)
    host.now += 60 * SECOND
    assert math.isnan(feed.battery.fraction)
    assert feed.fix is None
    feed.take_battery(types.ros_message(types.BATTERY, percentage=math.nan))
    assert math.isnan(feed.battery.fraction)
    feed.take_fix(types.ros_message(types.NAV_SAT_FIX, latitude=91.0))
    assert feed.fix is None
    assert "fix refused" in feed.refusal


def test_the_first_odometry_aligns(host: Host) -> None:
    """Once."""
    asked = []

    def align(first: object) -> Alignment:
        asked.append(first)
        return Alignment(0.0, np.array([10.0, 0.0, 0.0]))

    feed = RosFeed("auto", align, host)
    feed.take_odometry(told())
    feed.take_odometry(told(2.0, 2 * SECOND))
    assert len(asked) == 1
    assert feed.odometry is not None
    assert feed.odometry.position[0] == 12.0
