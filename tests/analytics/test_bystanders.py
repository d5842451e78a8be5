"""Everybody who is detected counts, whichever label the follower goes by."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from follow_world import TELLO, Snapshot

from aerodaas.analytics import CarFollowAnalytics, PersonFollowAnalytics, VipFollowAnalytics
from aerodaas.analytics.boxes import shipped_detector
from aerodaas.analytics.detection.detector import OnnxDetector
from aerodaas.analytics.follow.analytics import FollowAnalytics, _is_near
from aerodaas.clock import NANOSECONDS
from aerodaas.following.target import RelativeTarget
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.frames import Header
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.readings import Alert
from aerodaas.messages.waypoints import VelocityCommand

RATE = 10.0
POSE = Odometry(np.array([0.0, 0.0, 1.5]), np.zeros(3), 0.0)


def box(
    label: str, ahead: float, left: float, *, height: float, width: float, base: float = 0.0
) -> Detection:
    """The box of an upright plate `ahead` and `left` metres from the drone."""
    turn = math.atan2(left, ahead)
    across = width / 2 * np.array([-math.sin(turn), math.cos(turn), 0.0])
    corners = [
        np.array([ahead, left, up - POSE.height]) + side * across
        for side in (-1.0, 1.0)
        for up in (base, base + height)
    ]
    pixels = np.array([TELLO.project(corner)[:2] for corner in corners])
    frame = (TELLO.width, TELLO.height)
    low, high = np.clip(pixels.min(axis=0), 0, frame), np.clip(pixels.max(axis=0), 0, frame)
    return Detection((*low.tolist(), *high.tolist()), label, 0.9)


def person(ahead: float, left: float) -> Detection:
    """The box of somebody."""
    return box("person", ahead, left, height=1.7, width=0.55)


def vest(ahead: float, left: float) -> Detection:
    """The box of a vest, worn."""
    return box("vest", ahead, left, height=0.6, width=0.43, base=0.85)


class Watched:
    """A follower on a drone that stays where it is."""

    def __init__(self, follow: FollowAnalytics) -> None:
        self.follow = follow
        self.alerts: list[Alert] = []
        self.step = 0

    def show(self, *items: Detection) -> VelocityCommand | None:
        """Show it one frame."""
        stamp = round(self.step / RATE * NANOSECONDS)
        self.step += 1
        header = Header(self.step, stamp, "drone/cam")
        seen = Detections(header, items, TELLO.width, TELLO.height, TELLO, POSE)
        result = self.follow.process(seen, Snapshot(stamp, POSE, self.alerts))
        if result is None:
            return None
        command = result.commands[0]
        assert isinstance(command, VelocityCommand)
        return command

    @property
    def told(self) -> list[str]:
        """Kinds of the alerts."""
        return [alert.kind for alert in self.alerts]


@pytest.mark.parametrize("left", [0.0, 0.8, -0.8])
def test_a_stranger_who_comes_is_given_way_to_and_told_once(left: float) -> None:
    """Without a vest, beside the one who is followed and stands."""
    watched = Watched(VipFollowAnalytics())
    aside = 1.2 if left <= 0 else -1.2
    evasive, command = [], None
    for number in range(40):
        far = 7.0 - 1.6 * max(0, number - 10) / RATE
        items = [vest(2.0, aside), person(far, left * far / 7.0)]
        command = watched.show(*items)
        evasive.append(command is not None and command.evasive)
    assert not any(evasive[:20])
    assert evasive[-1]
    assert watched.told == ["person_close"]
    assert command is not None
    assert command.forward < -0.5


def test_a_stranger_on_the_way_is_not_flown_into() -> None:
    """Somebody who stands between stops the approach, as another with a vest would."""
    for items, moves in (([], True), ([person(1.25, 0.2)], False)):
        watched, command = Watched(VipFollowAnalytics()), None
        for _ in range(30):
            command = watched.show(vest(6.0, 0.0), *items)
        assert command is not None
        assert (command.forward > 0.5) is moves
        assert command.forward > -0.1


def test_the_targets_own_body_is_no_stranger() -> None:
    """Its box by size tells other distances than the vest; it comes and goes in detection."""
    watched = Watched(VipFollowAnalytics())
    for number in range(60):
        body = box("person", 1.5 if number % 2 else 2.3, 0.0, height=1.7, width=0.55)
        items = [vest(2.0, 0.0)] * (number % 7 != 6) + [body] * (number % 3 != 0)
        command = watched.show(*items)
        assert command is None or not command.evasive
    assert watched.told == []


@pytest.mark.parametrize("width", [1.1, 1.8])
def test_a_loose_box_around_the_target_is_no_stranger(width: float) -> None:
    """By its width it would be nearer than the body; it reaches out to one side."""
    watched = Watched(VipFollowAnalytics())
    left = width / 2 - 0.275
    for _ in range(10):
        loose = box("person", 3.0, left, height=1.7, width=width)
        watched.show(vest(3.0, 0.0), person(3.0, 0.0), loose)
    known = watched.follow.controller.guard._people.relative_to(POSE, round(0.9 * NANOSECONDS))
    assert len(known) == 1


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_loose_box_before_half_of_the_target_is_neither_it_nor_a_stranger(side: float) -> None:
    """Of half a body, a detector shows boxes that by size are near; they cover most of the vest."""
    watched = Watched(VipFollowAnalytics())
    target = vest(2.0, 0.0)
    left, top, right, bottom = target.box
    width, height = right - left, bottom - top
    for number in range(20):
        cut = left + 0.3 * width if side > 0 else right - 0.3 * width
        across = (cut, cut + 2.6 * width) if side > 0 else (cut - 2.6 * width, cut)
        loose = Detection((across[0], top - height, across[1], bottom + height), "person", 0.4)
        command = watched.show(target, *([loose] * (number % 4 != 3)))
        assert command is None or not command.evasive
    known = watched.follow.controller.guard._people.relative_to(POSE, round(1.9 * NANOSECONDS))
    assert [one.place.distance for one in known] == pytest.approx([2.0], abs=0.2)


def test_somebody_who_walks_across_is_no_nearer_for_a_stride() -> None:
    """Legs apart, a person seen from the side is wider than one seen from behind."""
    watched = Watched(VipFollowAnalytics())
    for _ in range(10):
        watched.show(vest(2.0, -1.2), box("person", 9.0, 2.0, height=1.7, width=0.85))
    known = watched.follow.controller.guard._people.relative_to(POSE, round(0.9 * NANOSECONDS))
    assert known[-1].place.distance > 8.5


@pytest.mark.parametrize(("frames", "believed"), [(2, False), (3, True)])
def test_a_stranger_is_believed_after_three_frames(frames: int, *, believed: bool) -> None:
    """False boxes of people last a frame or two."""
    watched = Watched(VipFollowAnalytics())
    for number in range(10):
        watched.show(vest(2.0, -1.2), *([person(4.0, 1.0)] * (number >= 10 - frames)))
    known = watched.follow.controller.guard._people.relative_to(POSE, round(0.9 * NANOSECONDS))
    assert (len(known) == 2) is believed


def test_a_stranger_in_every_other_frame_is_not_believed() -> None:
    """The frames must follow one another."""
    watched = Watched(VipFollowAnalytics())
    for number in range(11):
        watched.show(vest(2.0, -1.2), *([person(4.0, 1.0)] * (number % 2 == 0)))
    known = watched.follow.controller.guard._people.relative_to(POSE, NANOSECONDS)
    assert len(known) == 1


@pytest.mark.parametrize("fallen", [False, True])
def test_who_has_fallen_lies_within_a_bodys_length(*, fallen: bool) -> None:
    """So a person's box there may show the target; around one who stands, less room is theirs."""
    expected = RelativeTarget(0.0, 3.5, bound=fallen)
    assert _is_near(RelativeTarget(0.0, 2.0), expected) is fallen
    assert not _is_near(RelativeTarget(0.0, 1.0), expected)


def test_a_body_where_the_vest_was_is_nobody_else() -> None:
    """The detector misses the vest and puts the box of the body a little aside."""
    watched = Watched(VipFollowAnalytics())
    for number in range(15):
        watched.show(vest(2.0, 0.0) if number < 10 else person(2.2, 0.6))
    known = watched.follow.controller.guard._people.relative_to(POSE, round(1.4 * NANOSECONDS))
    assert len(known) == 1


def test_another_with_the_followed_label_counts_once() -> None:
    """By the vest; the box of the body around it adds nobody."""
    watched = Watched(VipFollowAnalytics())
    for _ in range(10):
        watched.show(vest(2.0, 0.0), person(2.0, 0.0), vest(4.0, 1.5), person(4.0, 1.5))
    pose, stamp = POSE, round(9 / RATE * NANOSECONDS)
    known = watched.follow.controller.guard._people.relative_to(pose, stamp)
    assert len(known) == 2


def test_a_car_is_no_person_but_people_beside_it_are() -> None:
    """Who comes from beside a followed car is given way to; a car that comes up is not."""
    car = box("car", 6.0, 0.0, height=1.5, width=1.8)
    watched = Watched(CarFollowAnalytics())
    for number in range(40):
        watched.show(car, person(6.5 - 1.5 * number / RATE, 0.5))
    assert watched.told == ["person_close"]
    watched = Watched(CarFollowAnalytics())
    for number in range(40):
        command = watched.show(box("car", 6.0 - 1.2 * number / RATE, 0.0, height=1.5, width=1.8))
        assert command is None or not command.evasive
    assert watched.told == []


def test_its_own_detector_finds_people_too() -> None:
    """On a camera's stream, each follower looks for everybody."""
    for follow, labels in (
        (VipFollowAnalytics(), {"vest", "person"}),
        (CarFollowAnalytics(), {"car", "person"}),
        (PersonFollowAnalytics(), {"person"}),
    ):
        known = [label for label in follow.labels if label in {"vest", "car", "person"}]
        detector = shipped_detector("test", known, follow.also)
        assert isinstance(detector, OnnxDetector)
        assert set(detector.classes or ()) == labels


def test_who_was_seen_beside_the_lost_one_does_not_replace_them() -> None:
    """Another in a vest is followed only after the lost one was given up, and that is said."""
    watched = Watched(VipFollowAnalytics())
    other = vest(3.0, 1.5)
    for _ in range(20):
        assert watched.show(vest(2.0, 0.0), other) is not None or watched.step < 10
    lost = [watched.show(other) for _ in range(170)]
    assert watched.follow.controller.phase.value == "searching"
    assert all(command is None or command.velocity[0] <= 0.0 for command in lost[40:])
    for _ in range(30):
        watched.show(other)
    assert watched.follow.controller.phase.value == "following"
    assert watched.told == ["target_lost", "target_given_up", "target_chosen"]


def test_the_followed_one_is_found_on_the_other_side_by_their_looks() -> None:
    """Two in vests met and went back while nobody's clothes could be seen."""
    watched = Watched(VipFollowAnalytics())
    random = np.random.default_rng(3)
    mine, theirs = (random.integers(40, 200, 24).astype(np.uint8).tobytes() for _ in range(2))

    def both(left: float, *, seen: bool = True) -> tuple[Detection, Detection]:
        boxes = vest(2.5, left), vest(2.8, -left)
        looks = (mine, theirs) if seen else (None, None)
        first, second = (
            replace(box, appearance=look) for box, look in zip(boxes, looks, strict=True)
        )
        return first, second

    for _ in range(20):
        watched.show(*both(0.9))
    towards = np.linspace(0.9, 0.1, 7).tolist()
    for left in (*towards, *reversed(towards)):
        watched.show(*both(left, seen=False))
    for _ in range(20):
        watched.show(*both(0.9))
    held = watched.follow.tracker.find(watched.follow.target)
    assert held is not None
    assert held.detection.appearance == mine
    assert held.detection.centre[0] < TELLO.cx
    assert "target_uncertain" not in watched.told


def test_a_followed_person_who_looks_otherwise_where_they_were_stays_followed() -> None:
    """Who falls or turns shows other colours; with nobody else about, the place is enough."""
    watched = Watched(VipFollowAnalytics())
    random = np.random.default_rng(3)
    before, after = (random.integers(40, 200, 24).astype(np.uint8).tobytes() for _ in range(2))
    for _ in range(20):
        watched.show(replace(vest(2.0, 0.0), appearance=before))
    for _ in range(60):
        watched.show(replace(vest(2.0, 0.0), appearance=after))
    assert watched.follow.controller.phase.value == "following"
    assert not watched.told
