"""Pictures on the way: where and when they are due, and what becomes of those that are lost."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from flights import Flight, add, flight
from hypothesis import given
from hypothesis import strategies as st
from surveyors import Surveyor, lost, patience, simulated

from aerodaas.clock import NANOSECONDS
from aerodaas.config.model import LimitsConfig
from aerodaas.extensions.payload.photo_trigger import PhotoTrigger
from aerodaas.extensions.payload.photographer import PhotoCapture
from aerodaas.geometry.frames import Vector
from aerodaas.messages.mission import MissionState
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.payload import Photo
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.log import MissionLog

TURN = NANOSECONDS // 20


def flown_straight(trigger: PhotoTrigger, start: Vector, end: Vector, speed: float) -> list[float]:
    """Metres from `start` at which pictures became due, of a drone that flies at `speed`."""
    way = end - start
    long = float(np.linalg.norm(way))
    found: list[float] = []
    now, progress = 0, 0.0
    bearing = math.atan2(way[1], way[0])
    while True:
        velocity = way * (speed / max(long, 1e-9) if progress < long else 0.0)
        seen = Odometry(start + way * (progress / max(long, 1e-9)), velocity, bearing)
        trigger.place_ahead(seen, now)
        arrived = now if progress >= long else None
        found += [progress] * trigger.passed(seen, now, arrived)
        if progress >= long:
            return found
        now, progress = now + TURN, min(progress + speed / 20, long)


coordinate = st.floats(-200.0, 200.0)


@given(
    start=st.tuples(coordinate, coordinate, coordinate),
    end=st.tuples(coordinate, coordinate, coordinate),
    spacing=st.floats(1.5, 50.0),
    speed=st.floats(0.5, 15.0),
)
def test_pictures_lie_where_they_were_asked_for(
    start: tuple[float, ...], end: tuple[float, ...], spacing: float, speed: float
) -> None:
    """Every `spacing` metres from the beginning of the leg, to half a turn's flight."""
    here, there = np.array(start), np.array(end)
    trigger = PhotoTrigger(Waypoint("b", end[0], end[1], end[2], trigger_distance=spacing), here, 0)
    found = flown_straight(trigger, here, there, speed)
    count = math.floor((float(np.linalg.norm(there - here)) + 1e-3) / spacing) + 1
    assert len(found) == count
    for index, progress in enumerate(found):
        assert progress == pytest.approx(index * spacing, abs=speed * 0.0251 + 0.11)


@given(
    legs=st.lists(st.floats(1.0, 60.0), min_size=1, max_size=6),
    spacing=st.floats(1.0, 30.0),
)
def test_legs_of_one_distance_count_on(legs: list[float], spacing: float) -> None:
    """As many pictures as on a single leg of the same length."""
    before, total, reached = None, 0, 0.0
    for index, long in enumerate(legs):
        here, there = np.array([reached, 0.0, 9.0]), np.array([reached + long, 0.0, 9.0])
        waypoint = Waypoint(f"w{index}", reached + long, 0.0, 9.0, trigger_distance=spacing)
        before = PhotoTrigger(waypoint, here, 0, before)
        total += len(flown_straight(before, here, there, 2.0))
        reached += long
    rest = reached % spacing
    off = abs(total - (math.floor(reached / spacing) + 1))
    assert off <= (min(rest, spacing - rest) < 0.01)


def test_another_distance_begins_anew() -> None:
    """At the beginning of its own leg."""
    before = PhotoTrigger(Waypoint("a", 10, 0, 0, trigger_distance=4), np.zeros(3), 0)
    flown_straight(before, np.zeros(3), np.array([10.0, 0, 0]), 2.0)
    same = PhotoTrigger(Waypoint("b", 20, 0, 0, trigger_distance=4), np.array([10.0, 0, 0]), 0)
    assert before.overhang == pytest.approx(2.0)
    other = Waypoint("b", 20, 0, 0, trigger_distance=5)
    trigger = PhotoTrigger(other, np.array([10.0, 0, 0]), 0, before)
    still = Odometry(np.array([10.0, 0, 0]), np.zeros(3), 0.0)
    trigger.place_ahead(still, 0)
    same.place_ahead(still, 0)
    assert trigger.passed(still, 0, None) == same.passed(still, 0, None) == 1


@given(
    st.lists(st.floats(width=32), min_size=6, max_size=6),
    st.floats(0.1, 10),
    st.integers(0, 10**12),
)
def test_no_position_is_too_odd(numbers: list[float], spacing: float, now: int) -> None:
    """Whatever an estimator says, the count is one, and the place to fly to finite."""
    trigger = PhotoTrigger(Waypoint("b", 50, 0, 9, trigger_distance=spacing), np.zeros(3), 0)
    seen = Odometry(np.array(numbers[:3]), np.array(numbers[3:]), 0.0)
    ahead = trigger.place_ahead(seen, now)
    assert ahead is None or np.isfinite(ahead).all()
    assert 0 <= trigger.passed(seen, now, None) <= math.hypot(50, 9) / spacing + 2


def test_the_nose_turns_along_the_line_before_the_first_picture() -> None:
    """The drone waits for it at the line's beginning, but not for ever, nor where it looks away."""
    waypoint = Waypoint("b", 0, 50, 9, trigger_distance=5.0)
    start, still = np.array([0, 0, 9.0]), np.zeros(3)
    aside, along = Odometry(start, still, 0.0), Odometry(start, still, math.pi / 2 + 0.09)
    trigger = PhotoTrigger(waypoint, start, 0)
    ahead = trigger.place_ahead(aside, 0)
    assert ahead == pytest.approx(start)
    assert trigger.passed(aside, 0, None) == 0
    ahead = trigger.place_ahead(along, TURN)
    assert ahead is not None
    assert ahead[1] >= 8.0
    assert trigger.passed(along, TURN, None) == 1
    looks_away = PhotoTrigger(waypoint, start, 0)
    looks_away.place_ahead(aside, 0, turns=False)
    assert looks_away.passed(aside, 0, None) == 1
    stuck = PhotoTrigger(waypoint, start, 0)
    stuck.place_ahead(aside, 5 * NANOSECONDS)
    assert stuck.passed(aside, 5 * NANOSECONDS, None) == 1


def test_no_picture_is_taken_beside_the_line() -> None:
    """A drone that has slid round a corner comes back first, but not for ever."""
    trigger = PhotoTrigger(Waypoint("b", 50, 0, 9, trigger_distance=5.0), np.array([0, 0, 9.0]), 0)
    beside = Odometry(np.array([1.0, 2.0, 9.0]), np.zeros(3), 0.0)
    back = trigger.place_ahead(beside, 0)
    assert back is not None
    assert tuple(back) == (1.0, 0.0, 9.0)
    assert trigger.passed(beside, 0, None) == 0
    ahead = trigger.place_ahead(beside, 5 * NANOSECONDS)
    assert ahead is not None
    assert tuple(ahead) == (9.0, 0.0, 9.0)
    assert trigger.passed(beside, 5 * NANOSECONDS, None) == 1


def test_places_that_were_passed_unseen_are_counted() -> None:
    """One picture is taken, of the newest; the others are lost and told."""
    log = MissionLog("drone/mission")
    shutter = PhotoCapture(Surveyor(), log, 4.0)
    shutter.trigger("line", 3, 0)
    shutter.poll(0)
    assert (len(log.photos), log.photos_lost) == (1, 2)
    (alert,) = log.alerts
    assert alert.text.startswith("on the way to line: a picture is missed")
    assert alert.text.endswith("their places were passed before the camera was asked")


def test_legs_of_one_interval_count_on() -> None:
    """No picture is taken twice where one leg ends and the next begins."""
    still = Odometry(np.zeros(3), np.zeros(3), 0.0)
    first = PhotoTrigger(Waypoint("a", 9, 0, 0, trigger_interval=2.0), np.zeros(3), 0)
    assert first.passed(still, 0, None) == 1
    second = PhotoTrigger(Waypoint("b", 18, 0, 0, trigger_interval=2.0), np.zeros(3), TURN, first)
    assert second.passed(still, TURN, None) == 0


def test_time_counts_from_the_first_and_not_while_elsewhere() -> None:
    """A drone that was called away owes no pictures for the time of its absence."""
    still = Odometry(np.zeros(3), np.zeros(3), 0.0)
    trigger = PhotoTrigger(Waypoint("b", 50, 0, 9, trigger_interval=2.0), np.zeros(3), 0)
    due = [trigger.passed(still, turn * TURN, None) for turn in range(20 * 5)]
    assert [turn for turn, count in enumerate(due) if count] == [0, 40, 80]
    assert trigger.passed(still, 60 * NANOSECONDS, None) == 1
    assert trigger.passed(still, 60 * NANOSECONDS + TURN, None) == 0
    assert trigger.place_ahead(still, 0) is None


LINE = (
    Waypoint("begin", 0, 0, 3, speed=2),
    Waypoint("line", 12, 0, 3, speed=2, trigger_distance=3.0),
)


def surveyed(vehicle: Surveyor, *waypoints: Waypoint, timeout: float = 4.0) -> Flight:
    """A whole flight."""
    limits = LimitsConfig(arrival_radius=0.3)
    options = patience(timeout)
    made = flight(add(*(waypoints or LINE)), vehicle=vehicle, limits=limits, options=options)
    made.run()
    made.expect(MissionState.LANDED)
    return made


def test_the_drone_does_not_stop_for_pictures_on_the_way() -> None:
    """Its speed along the line stays what was asked for."""
    vehicle = Surveyor()
    made = flight(add(*LINE), vehicle=vehicle)
    made.run(until=lambda: len(made.mission.photos) == 2)
    slowest = math.inf
    while len(made.mission.photos) < 4:
        made.turn()
        slowest = min(slowest, float(np.linalg.norm(vehicle.velocity)))
    assert slowest > 1.5
    made.run()
    assert made.status.photos == (5, 0)
    assert not lost(made)


def slow(duration: float) -> Surveyor:
    """A vehicle whose camera tells of its pictures after so many seconds."""
    vehicle = Surveyor()
    assert vehicle.photo_camera is not None
    ready = vehicle.photo_camera.outcomes
    held: list[Photo] = []

    def late() -> list[Photo]:
        held.extend(ready())  # type: ignore[arg-type]
        due = [one for one in held if vehicle.clock.now - one.stamp >= duration * NANOSECONDS]
        held[:] = [one for one in held if one not in due]
        return due

    vehicle.photo_camera.outcomes = late  # type: ignore[method-assign,assignment]
    return vehicle


def test_at_its_end_the_drone_waits_for_a_busy_camera() -> None:
    """There it has the time: both pictures of a short line are taken."""
    line = (LINE[0], Waypoint("line", 3, 0, 3, speed=2, trigger_distance=3.0))
    made = surveyed(slow(5.0), *line, timeout=9.0)
    assert made.status.photos == (2, 0)


def test_a_waypoints_own_picture_waits_for_the_one_before() -> None:
    """A camera is asked for one at a time: drivers give up the first for the second."""
    vehicle = slow(3.0)
    camera = vehicle.photo_camera
    assert camera is not None
    take, asked = camera.take_photo, list[int]()

    def noted(label: str) -> int:
        asked.append(vehicle.clock.now)
        return take(label)

    camera.take_photo = noted  # type: ignore[method-assign]
    line = (LINE[0], Waypoint("line", 3, 0, 3, speed=2, trigger_distance=3.0, photo=True))
    made = surveyed(vehicle, *line, timeout=15.0)
    assert made.status.photos == (3, 0)
    assert all(b - a >= 3 * NANOSECONDS for a, b in pairwise(asked))


def test_a_busy_camera_misses_pictures_and_says_so_once() -> None:
    """They are counted, and the drone flies on; the camera's own time-out frees it again."""
    vehicle = slow(4.0)
    made = surveyed(vehicle, timeout=9.0)
    taken, missed = made.status.photos
    assert taken + missed == 5
    assert missed >= 2
    busy = [text for text in lost(made) if "line" in text]
    assert len(busy) == 1
    assert busy[0].endswith("more are counted: the camera was still busy with the one before")
    assert made.status.visited[-1] == "line"


@pytest.mark.parametrize(
    ("fault", "told"),
    [
        ("gone", "no camera for pictures"),
        ("refuses", "no card"),
        ("silent", "took none within 4 s"),
        ("raises", "a bug"),
    ],
)
def test_a_camera_at_fault_costs_its_pictures_and_not_the_flight(fault: str, told: str) -> None:
    """All five are counted, each reason is told once."""
    vehicle = Surveyor()
    camera = vehicle.photo_camera
    assert camera is not None
    if fault == "gone":
        vehicle.photo_camera = None
    elif fault == "refuses":
        camera.refuses = "no card"
    elif fault == "silent":
        camera.silent = True
    else:

        def broken(label: str) -> int:
            raise RuntimeError(f"a bug at {label}")

        camera.take_photo = broken  # type: ignore[method-assign]
    made = surveyed(vehicle)
    assert list(made.status.visited) == ["begin", "line"]
    assert made.status.photos == (0, 5)
    texts = [text for text in lost(made) if told in text]
    assert len(texts) == 1


def test_pictures_by_time_go_on_during_the_stay() -> None:
    """From when the drone sets out until it leaves."""
    vehicle = Surveyor()
    stay = Waypoint("stay", 0, 4, 3, hover_duration=6, speed=2, trigger_interval=1.0)
    made = surveyed(vehicle, stay)
    taken, missed = made.status.photos
    assert missed == 0
    assert 8 <= taken <= 12
    stamps = [photo.stamp for photo in made.mission.photos]
    assert all(b - a == NANOSECONDS for a, b in pairwise(stamps))


def test_an_interrupted_line_is_gone_on_with() -> None:
    """No place is photographed twice; those that were passed on the detour are counted."""
    vehicle = Surveyor()
    made = flight(add(*LINE), vehicle=vehicle)
    made.run(until=lambda: len(made.mission.photos) == 2)
    made.tell(add(Waypoint("urgent", 3, 5, 3, priority=1)))
    made.run()
    made.expect(MissionState.LANDED)
    taken, missed = made.status.photos
    assert taken + missed == 5
    assert taken >= 4


@pytest.mark.parametrize("speed", [2.0, 5.0])
@pytest.mark.parametrize(("noise", "wind"), [(0.0, 0.0), (1.0, 3.0)])
def test_pictures_of_a_survey_lie_within_half_a_metre(
    speed: float, noise: float, wind: float
) -> None:
    """By the simulator's truth, at both ends of the lines, too, in wind and with noisy sensors."""
    mission = simulated(
        Waypoint("a", 0, 0, 10, speed=speed),
        Waypoint("b", 40, 0, 10, speed=speed, trigger_distance=5.0),
        Waypoint("c", 40, 10, 10, speed=speed),
        Waypoint("d", 0, 10, 10, speed=speed, trigger_distance=5.0),
        noise=noise,
        wind=wind,
    )
    assert mission.state is MissionState.LANDED
    photos = mission.photos
    asked = [("b", x, 0.0) for x in range(0, 41, 5)] + [("d", x, 10.0) for x in range(40, -1, -5)]
    assert [photo.label for photo in photos] == [label for label, _, _ in asked]
    for photo, (_, x, y) in zip(photos, asked, strict=True):
        assert photo.truth is not None
        assert float(np.linalg.norm(photo.truth.position - (x, y, 10.0))) < 0.5
