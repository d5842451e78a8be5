"""Who is who near the drone: the followed person keeps their identity, everybody else gets one."""

from __future__ import annotations

import math

import numpy as np
import pytest

from aerodaas.clock import NANOSECONDS
from aerodaas.following.contact_guard import PeopleTracker, Prediction
from aerodaas.following.target import RelativeTarget
from aerodaas.messages.odometry import Odometry

POSE = Odometry(np.array([0.0, 0.0, 1.5]), np.zeros(3), 0.0)
INTERVAL = 0.1
TARGET = RelativeTarget(0.0, 2.3)
LOOSE = RelativeTarget(0.2, 1.3)
"""A loose box around the target, which looks nearer than the body."""


class Watch:
    """Frames from a drone that hovers at home."""

    def __init__(self) -> None:
        self.people = PeopleTracker()
        self.frames = 0

    def show(self, *people: RelativeTarget, target: RelativeTarget | None = None) -> None:
        """Show one frame."""
        self.frames += 1
        self.people.see(people, POSE, self.stamp, INTERVAL, target=target)

    @property
    def stamp(self) -> int:
        """Time of the last frame, nanoseconds."""
        return round(self.frames * INTERVAL * NANOSECONDS)

    @property
    def known(self) -> list[Prediction]:
        """Everybody surely there."""
        return self.people.relative_to(POSE, self.stamp)

    @property
    def followed(self) -> Prediction:
        """Who is followed."""
        (found,) = (one for one in self.known if one.followed)
        return found


@pytest.mark.parametrize("both", [True, False], ids=["beside the target", "instead of it"])
def test_a_loose_box_does_not_take_the_followed_person(*, both: bool) -> None:
    """Nearer than the target and within a step of it, it would look like somebody who comes."""
    watch = Watch()
    for _ in range(10):
        watch.show(TARGET, target=TARGET)
    for _ in range(4):
        watch.show(*([TARGET] if both else []), LOOSE, target=TARGET if both else None)
        assert watch.followed.place.distance == pytest.approx(TARGET.distance, abs=0.05)
        assert watch.followed.away == pytest.approx(0.0, abs=0.1)
        assert watch.followed.in_sight is both


def test_another_target_is_another_person() -> None:
    """Who was followed before is still there, and who is followed now does not leap."""
    watch = Watch()
    other = RelativeTarget(-0.3, 6.0)
    for _ in range(10):
        watch.show(TARGET, other, target=TARGET)
    watch.show(TARGET, RelativeTarget(-0.3, 5.2), other, target=other)
    assert watch.followed.place.distance == pytest.approx(6.0, abs=0.1)
    assert abs(watch.followed.away) < 0.2
    assert [one.place.distance for one in watch.known] == pytest.approx([2.3, 6.0], abs=0.1)


def test_a_turn_is_believed_sooner_of_who_is_followed() -> None:
    """Three frames after turning at 1 m/s; of others, who are farther, boxes are trusted less."""
    for followed in (True, False):
        watch = Watch()
        for number in range(24):
            one = RelativeTarget(0.0, 2.5 - 0.1 * abs(20 - number))
            watch.show(one, target=one if followed else None)
        assert (watch.known[0].away < -0.75) is followed


def test_noise_of_far_distances_is_no_sprint() -> None:
    """6 % from frame to frame, of somebody who stands 9 m away."""
    watch, draw = Watch(), np.random.default_rng(1)
    fastest = 0.0
    for number in range(200):
        watch.show(RelativeTarget(0.0, 9.0 * (1.0 + draw.normal(0.0, 0.06))))
        if number > 20:
            fastest = max(fastest, abs(watch.known[0].away))
    assert fastest < 2.0


def test_nobody_is_faster_than_a_run() -> None:
    """Whatever the boxes say; the direction is kept."""
    watch = Watch()
    for number in range(10):
        watch.show(RelativeTarget(0.3, 9.0 - 0.5 * number))
    found = watch.known[0]
    assert math.hypot(found.away, found.left) == pytest.approx(2.5)
    assert found.away < -2.4


def test_a_cut_box_is_no_evidence_against_somebody_predicted_nearer() -> None:
    """Who comes until their box is cut by the picture's edges goes on coming."""
    watch = Watch()
    for number in range(20):
        watch.show(RelativeTarget(0.0, 3.0 - 0.1 * number))
    for _ in range(3):
        watch.show(RelativeTarget(0.0, 2.0, bound=True))
    assert watch.known[0].place.distance == pytest.approx(0.8, abs=0.1)
    assert watch.known[0].away == pytest.approx(-1.0, abs=0.1)
