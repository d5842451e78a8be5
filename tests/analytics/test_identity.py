"""Who is the followed person, after another one's box touched theirs."""

from __future__ import annotations

import numpy as np

from aerodaas.analytics.detection.tracking import BoxFilter, Track
from aerodaas.analytics.follow.identity import Certainty, TargetIdentity
from aerodaas.clock import NANOSECONDS
from aerodaas.geometry.frames import Box
from aerodaas.messages.appearance import ZONE_BYTES, ZONES
from aerodaas.messages.detections import Detection

HERE, BESIDE, TOUCHING = 300.0, 450.0, 330.0
"""Left edges of boxes 60 pixels wide."""
STEP = NANOSECONDS // 10


def look(person: int, *, noise: int = 0) -> bytes:
    """How somebody looks, always about the same."""
    colours = np.random.default_rng(person).integers(40, 200, ZONES * ZONE_BYTES)
    return bytes((colours + noise).astype(np.uint8))


class Scene:
    """Tracks of two people over time, the first of them followed."""

    def __init__(self, *people: int, beside: int = 5) -> None:
        """Show them beside each other for so many frames."""
        self.identity = TargetIdentity()
        self.now = 0
        self.mine, self.other = self.track(1, HERE), self.track(2, BESIDE)
        for _ in range(beside):
            self.show(people)

    def track(self, number: int, left: float) -> Track:
        """A new track."""
        item = Detection(box_at(left), "vest", 0.9, number)
        return Track(number, item, BoxFilter(item.box), 0.9, self.now)

    def show(self, people: tuple[int, ...] = (), *, left: float = BESIDE) -> None:
        """One frame: who looks how, and where the other one is."""
        self.now += STEP
        self.other.filter = BoxFilter(box_at(left))
        for track, person in zip((self.mine, self.other), people, strict=False):
            if person >= 0:
                track.looks.add(self.now, look(person))
        self.identity.watch(self.mine, [self.other], self.now)

    def touch(self) -> None:
        """One frame in which their boxes touch."""
        self.show(left=TOUCHING)


def box_at(left: float) -> Box:
    """A vest's box."""
    return (left, 100.0, left + 60.0, 180.0)


def test_who_touches_is_another_once_two_frames_showed_both() -> None:
    """A second box of the same body never stands beside it."""
    for beside, certainty in ((1, Certainty.CERTAIN), (2, Certainty.CONTESTED)):
        scene = Scene(7, 8, beside=beside)
        scene.touch()
        assert scene.identity.certainty is certainty


def test_looks_tell_who_came_out_on_which_side() -> None:
    """Each track is told by what it shows since, whichever it showed before."""
    for after, mine in (((7, 8), True), ((8, 7), False)):
        scene = Scene(7, 8)
        scene.touch()
        for _ in range(3):
            assert not any(scene.identity.compare([scene.mine, scene.other]).values())
            scene.show(after)
        verdicts = scene.identity.compare([scene.mine, scene.other])
        assert verdicts == {scene.mine: mine, scene.other: not mine}


def test_who_looks_the_same_cannot_be_told() -> None:
    """Neither of two in the same clothes is taken for the followed one, nor one of them alone."""
    scene = Scene(7, 7)
    scene.touch()
    for _ in range(4):
        scene.show((7, 7))
    assert set(scene.identity.compare([scene.mine, scene.other]).values()) == {None}
    assert scene.identity.compare([scene.mine]) == {scene.mine: None}


def test_a_small_difference_between_two_does_not_tell_them_apart() -> None:
    """Light and side change somebody's looks by more, so the exact match is no proof."""
    scene = Scene(7, -1)
    for stamp in range(1, 6):
        scene.other.looks.add(stamp, look(7, noise=2))
    scene.touch()
    for _ in range(3):
        scene.show((7, -1))
    assert scene.identity.compare([scene.mine]) == {scene.mine: None}


def test_of_somebody_who_was_never_seen_well_another_in_sight_tells() -> None:
    """Whose looks are unknown is told by whoever in sight looks otherwise; nobody else tells."""
    scene = Scene(7, -1)
    scene.touch()
    for _ in range(3):
        scene.show((7, 8))
    assert scene.identity.compare([scene.mine]) == {scene.mine: None}
    verdicts = scene.identity.compare([scene.mine, scene.other])
    assert verdicts == {scene.mine: True, scene.other: False}


def test_of_somebody_alike_who_was_never_seen_well_nothing_tells() -> None:
    """Neither of two in sight who look the same is taken for the followed one."""
    scene = Scene(7, -1)
    scene.touch()
    for _ in range(3):
        scene.show((7, 7))
    verdicts = scene.identity.compare([scene.mine, scene.other])
    assert verdicts == {scene.mine: None, scene.other: None}


def test_the_followed_person_found_again_is_nobody_else() -> None:
    """A track that began after the touch is not kept as another person's looks."""
    scene = Scene(7, 8)
    scene.touch()
    again = scene.track(3, BESIDE)
    for _ in range(4):
        scene.now += STEP
        again.looks.add(scene.now, look(7))
        scene.identity.watch(scene.mine, [scene.other, again], scene.now)
    scene.other.age = 9.0
    again.filter = BoxFilter(box_at(TOUCHING))
    scene.identity.watch(scene.mine, [again], scene.now)
    for _ in range(3):
        scene.now += STEP
        again.looks.add(scene.now, look(7))
    assert scene.identity.compare([again]) == {again: True}


def test_while_contested_only_looks_open_the_way_back() -> None:
    """A box that cannot be compared may show the followed person only while nobody came close."""
    scene = Scene(7, 8)
    assert scene.identity.may_be_mine(3, ())
    assert scene.identity.may_be_mine(3, (look(9),))
    scene.touch()
    assert not scene.identity.may_be_mine(3, ())
    assert not scene.identity.may_be_mine(3, (look(8),))
    assert scene.identity.may_be_mine(3, (look(7),))


def test_who_stood_beside_is_another_however_they_look() -> None:
    """After one miss of the followed person, the other one's box is not taken for theirs."""
    scene = Scene(7, 7)
    assert not scene.identity.may_be_mine(scene.other.id, (look(7),))
    assert scene.identity.may_be_mine(3, (look(7),))


def test_without_looks_it_is_told_and_believed() -> None:
    """Boxes of a detector without appearances are followed on, once it is said."""
    scene = Scene()
    scene.touch()
    assert scene.identity.may_be_mine(3, ())
    assert not scene.identity.doubt(scene.now + NANOSECONDS)
    assert scene.identity.doubt(scene.now + 2 * NANOSECONDS)
    assert scene.identity.certainty is Certainty.CERTAIN
    assert not scene.identity.doubt(scene.now + 3 * NANOSECONDS)


def test_looks_that_do_not_tell_in_time_leave_it_uncertain() -> None:
    """It is said once."""
    scene = Scene(7, 7)
    scene.touch()
    assert scene.identity.doubt(scene.now + 2 * NANOSECONDS)
    assert scene.identity.certainty is Certainty.UNCERTAIN
    assert not scene.identity.doubt(scene.now + 3 * NANOSECONDS)
    scene.touch()
    assert scene.identity.certainty is Certainty.UNCERTAIN


def test_tracks_that_changed_over_are_known_afterwards() -> None:
    """The other one's track that shows the followed person now is theirs, and later found again."""
    scene = Scene(7, 8)
    scene.touch()
    for _ in range(3):
        scene.show((8, 7))
    scene.identity.settle(scene.other)
    assert scene.identity.certainty is Certainty.CERTAIN
    assert scene.identity.may_be_mine(scene.other.id, (look(7),))


def test_a_box_long_out_of_sight_touches_nobody() -> None:
    """Where a lost track would be is a guess."""
    scene = Scene(7, 8)
    scene.other.age = 0.8
    scene.touch()
    assert scene.identity.certainty is Certainty.CERTAIN


def test_those_who_touched_before_are_forgotten() -> None:
    """Somebody alike who was told apart does not leave the next meeting undecided."""
    scene = Scene(7, -1)
    scene.touch()
    for _ in range(3):
        scene.show((7, 8))
    scene.identity.settle(scene.mine)
    scene.touch()
    for _ in range(3):
        scene.show((7, 8))
    assert scene.identity.compare([scene.mine]) == {scene.mine: True}
