"""Who falls is told by the height of the body, in and out of the picture; nobody else is."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from aerodaas.analytics.people.falls import FallDetector
from aerodaas.clock import NANOSECONDS
from aerodaas.geometry.frames import CameraModel, enu_to_body, rotation_from_rpy
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.frames import Header
from aerodaas.messages.odometry import Odometry
from aerodaas.simulation.skeleton import KEYPOINTS, Posture, joints

TELLO = CameraModel.from_fov(640, 480, math.radians(55.2), pitch=math.radians(12))
WIDE = CameraModel.from_fov(640, 360, math.radians(82.6), pitch=math.radians(12))
LENSES = pytest.mark.parametrize("camera", [TELLO, WIDE], ids=["tello", "wide"])
FALL, TURN_OFF = 0.7, 2.0
"""Seconds that a fall takes; and of the scene after which something happens."""


class Scene:
    """A person and a drone, each as a function of the time in seconds, seen at ten a second."""

    def __init__(self, camera: CameraModel, rate: float = 10.0) -> None:
        self.camera, self.rate = camera, rate
        self.posture: Callable[[float], Posture] = lambda _: Posture()
        self.place: Callable[[float], tuple[float, float]] = lambda _: (2.0, 0.0)
        self.sink: Callable[[float], float] = lambda _: 0.0
        """Metres by which the body's top is lower, and the rest in proportion."""
        self.drone: Callable[[float], Odometry] = lambda _: hovering()
        self.turn = 0.0
        self.hidden: Callable[[float], bool] = lambda _: False
        self.tall = 1.75
        self.noise: Callable[[], np.ndarray] = lambda: np.zeros(4)
        """Errors of a box's edges in parts of its height."""
        self.hides_joints = False
        """Whether a body that is not upright hides its joints."""

    def seen(self, time: float) -> Detections:
        """What an exact pose model finds; keypoints beside the picture are not."""
        pose = self.drone(time)
        body = joints(self.tall, self.posture(time))
        body[:, 2] *= 1.0 - self.sink(time) / np.ptp(body[:, 2])
        turned = np.array([enu_to_body(point, -self.turn) for point in body])
        placed = turned + np.array([*self.place(time), 0.0]) - pose.position
        tilt = rotation_from_rpy(pose.roll, pose.pitch, pose.yaw)
        pixels = np.array([self.camera.project(point) for point in placed @ tilt])
        width, height = self.camera.width, self.camera.height
        inside = (pixels[:, 2] > 0) & (np.abs(pixels[:, 0] - width / 2) < width / 2)
        inside &= np.abs(pixels[:, 1] - height / 2) < height / 2
        items = []
        if inside.sum() >= 4 and not self.hidden(time):
            flat = pixels[pixels[:, 2] > 0, :2]
            low, high = flat.min(axis=0).tolist(), flat.max(axis=0).tolist()
            edges = np.array([*low, *high]) + self.noise() * (high[1] - low[1])
            left, top, right, bottom = np.clip(edges, 0, [width, height] * 2).tolist()
            if self.hides_joints and self.posture(time).fallen > 0:
                inside[:] = False
            points = np.column_stack([pixels[:, :2], 0.9 * inside])[list(KEYPOINTS)]
            box = (left, top, right, bottom)
            items.append(Detection(box, "person", 0.9, keypoints=points.astype(np.float32)))
        header = Header(0, round(time * NANOSECONDS), "drone/cam")
        return Detections(header, tuple(items), width, height, self.camera, pose)

    def play(self, until: float = 5.0) -> list[float]:
        """Times at which the person is told to be down."""
        falls = FallDetector(0.35)
        told = []
        for step in range(round(until * self.rate)):
            time = step / self.rate
            seen = self.seen(time)
            body = seen.items[0] if seen.items else None
            if falls.shows(body, seen):
                told.append(time)
        return told


def hovering(
    height: float = 1.5, *, east: float = 0.0, yaw: float = 0.0, pitch: float = 0.0
) -> Odometry:
    """A drone that looks east."""
    return Odometry(np.array([east, 0.0, height]), np.zeros(3), yaw, pitch=pitch)


def falling(time: float, *, forward: bool) -> Posture:
    """Over within 0.7 s, as people are."""
    share = min(max((time - TURN_OFF) / FALL, 0.0), 1.0)
    return Posture(fallen=share * share * (3 - 2 * share), forward=forward)


@LENSES
@given(turn=st.floats(-math.pi, math.pi), away=st.floats(1.6, 2.2), forward=st.booleans())
@example(turn=0.4375, away=1.75, forward=False)  # past the edge, and gone
@settings(max_examples=40)
def test_a_fall_is_told_wherever_it_goes(
    camera: CameraModel, turn: float, away: float, *, forward: bool
) -> None:
    """Away from the drone, across or towards it, unless the whole of it stays in the picture."""
    scene = Scene(camera)
    scene.turn, scene.place = turn, lambda _: (away, 0.0)
    scene.posture = lambda time: falling(time, forward=forward)
    lying = scene.seen(TURN_OFF + FALL)
    if lying.items and lying.items[0].box[3] < 0.97 * camera.height:
        return
    told = scene.play()
    assert len(told) >= 8, told
    assert TURN_OFF < told[0] <= TURN_OFF + FALL + 0.2


@LENSES
@given(
    turn=st.floats(-math.pi, math.pi),
    away=st.floats(3.3, 8.0),
    height=st.floats(0.8, 2.0),
    tall=st.floats(1.5, 1.95),
    rate=st.sampled_from([5.0, 10.0]),
    forward=st.booleans(),
    seed=st.integers(0, 1000),
)
@settings(max_examples=60)
def test_boxes_alone_tell_a_fall_in_the_picture(
    camera: CameraModel,
    turn: float,
    away: float,
    height: float,
    tall: float,
    rate: float,
    seed: int,
    *,
    forward: bool,
) -> None:
    """Rough boxes, and no joint of who lies; in more than half of the frames from then on.

    Nearer than 3.3 m to a low drone the head of who stands may be above the picture, and nobody is
    known to have stood.
    """
    scene = Scene(camera, rate)
    scene.turn, scene.place, scene.tall = turn, lambda _: (away, 0.0), tall
    scene.drone = lambda _: hovering(height)
    scene.posture = lambda time: falling(time, forward=forward)
    scene.hides_joints = True
    random = np.random.default_rng(seed)
    scene.noise = lambda: random.normal(0, 0.02, 4)
    told = scene.play()
    after = 5.0 - TURN_OFF - FALL
    assert len(told) > 0.5 * after * rate, told
    assert TURN_OFF < told[0] <= TURN_OFF + FALL + 2 / rate


@LENSES
@pytest.mark.parametrize("turn", [0.0, 0.1, -0.3])
@pytest.mark.parametrize("tall", [1.65, 1.75, 1.9])
def test_who_falls_away_from_a_camera_at_their_height_is_told(
    camera: CameraModel, turn: float, tall: float
) -> None:
    """They lie lengthwise before it, the feet just below the picture, and hide their joints."""
    scene = Scene(camera, 5.0)
    scene.turn, scene.place, scene.tall = turn, lambda _: (2.35, 0.0), tall
    scene.drone = lambda _: hovering(1.59)
    scene.posture = lambda time: falling(time, forward=True)
    scene.hides_joints = True
    told = scene.play()
    assert len(told) >= 8, told


@pytest.mark.parametrize("late", np.linspace(0.0, 0.45, 10))
@pytest.mark.parametrize("forward", [False, True])
def test_two_frames_a_second_show_who_lies(late: float, *, forward: bool) -> None:
    """The fall lies between them, so that its speed is not seen."""
    scene = Scene(WIDE, 2.0)
    scene.turn, scene.place = 1.3, lambda _: (4.0, 0.0)
    scene.hides_joints = True
    scene.posture = lambda time: falling(time - late, forward=forward)
    assert len(scene.play()) >= 3


@LENSES
@pytest.mark.parametrize("rate", [2.0, 5.0, 10.0])
@pytest.mark.parametrize("away", [2.0, 4.0])
def test_sitting_down_on_the_ground_is_no_fall(
    camera: CameraModel, rate: float, away: float
) -> None:
    """Then a body is 0.52 of its height."""
    scene = Scene(camera, rate)
    scene.place = lambda _: (away, 0.0)
    scene.sink = lambda time: 0.46 * scene.tall * min(max((time - TURN_OFF) / 1.5, 0.0), 1.0)
    assert scene.play() == []


def test_who_sinks_slowly_to_the_ground_and_lies_is_told() -> None:
    """However long it takes, once they are lower than anybody who sits."""
    scene = Scene(TELLO, 5.0)
    scene.turn, scene.place = 1.3, lambda _: (4.0, 0.0)
    scene.hides_joints = True
    scene.posture = lambda time: falling(TURN_OFF + (time - TURN_OFF) / 4, forward=True)
    assert len(scene.play(7.0)) >= 8


@LENSES
@pytest.mark.parametrize(("tall", "sinks"), [(1.9, 0.6), (1.45, 0.4)])
def test_a_quick_bow_is_no_fall(camera: CameraModel, tall: float, sinks: float) -> None:
    """Deep, but not low; and by a short person, low, but not deep."""
    scene = Scene(camera)
    scene.place, scene.tall = lambda _: (4.0, 0.0), tall
    scene.sink = lambda time: sinks * min(max((time - TURN_OFF) / 0.3, 0.0), 1.0)
    assert scene.play() == []


@LENSES
def test_who_is_cut_off_by_the_upper_edge_has_not_sunk(camera: CameraModel) -> None:
    """As the drone brakes hard, the camera looks down and the head is not seen."""
    scene = Scene(camera)
    scene.drone = lambda time: hovering(pitch=0.6 * min(max((time - TURN_OFF) / 0.3, 0.0), 1.0))
    assert scene.play() == []


def test_who_fell_out_of_the_picture_is_not_told_by_pictures_of_elsewhere() -> None:
    """The drone turns away: nobody is there, but that says nothing."""
    scene = Scene(TELLO)
    scene.place = lambda _: (1.7, 0.0)
    scene.posture = lambda time: falling(time, forward=False)
    scene.turn = math.pi
    assert [time for time in scene.play() if time > 3.5] != []
    scene.drone = lambda time: hovering(yaw=2.0 * max(0.0, time - TURN_OFF - FALL))
    assert [time for time in scene.play() if time > 3.5] == []


def test_who_gets_up_is_down_no_more() -> None:
    """And may fall again."""
    scene = Scene(TELLO)

    def twice(time: float) -> Posture:
        return falling(time if time < 5.0 else time - 6.0, forward=True)

    scene.posture = twice
    told = scene.play(12.0)
    assert [time for time in told if 2.7 < time < 4.9] != []
    assert [time for time in told if 5.0 <= time <= 8.0] == []
    assert [time for time in told if time > 8.7] != []


@LENSES
@pytest.mark.parametrize("far", [12.0, 20.0])
@pytest.mark.parametrize("seed", range(5))
def test_who_is_taken_for_another_one_far_away_has_not_fallen(
    camera: CameraModel, far: float, seed: int
) -> None:
    """Somebody cut off by the lower edge is near, and no part of who stood far away."""
    scene = Scene(camera)
    random = np.random.default_rng(seed)
    scene.noise = lambda: random.normal(0, 0.02, 4)
    scene.place = lambda time: (far if time < TURN_OFF else 1.75, 0.0)

    def braking(time: float) -> Odometry:
        since = time - TURN_OFF
        return hovering(pitch=0.3 * min(max((since - 0.6) / 0.3, 0.0), 1.0))

    scene.drone = braking
    assert scene.play() == []


@pytest.mark.parametrize("rate", [5.0, 10.0])
@pytest.mark.parametrize("tops", [[91, 145], [80, 110, 140, 170], [145, 145]])
def test_who_leaves_by_the_side_leaves_an_arm_and_a_leg_and_has_not_fallen(
    rate: float, tops: list[int]
) -> None:
    """As a detector boxes what remains of them, which is low, and then nothing."""
    falls, told = FallDetector(0.35), []
    for step in range(30):
        box = (566.0, 70.0, 620.0, 226.0)
        if 10 <= step < 10 + len(tops):
            box = (606.0, float(tops[step - 10]), 639.0, 240.0)
        gone = step >= 10 + len(tops)
        body = Detection(box, "person", 0.8, keypoints=np.zeros((17, 3), np.float32))
        header = Header(step, round(step / rate * NANOSECONDS), "drone/cam")
        items = () if gone else (body,)
        seen = Detections(header, items, 640, 360, WIDE, hovering(1.57))
        told.append(falls.shows(None if gone else body, seen))
    assert not any(told)


@LENSES
@pytest.mark.parametrize("away", [3.0, 12.0])
@pytest.mark.parametrize("seed", range(8))
def test_a_drone_that_lands_makes_nobody_fall(camera: CameraModel, away: float, seed: int) -> None:
    """Near the ground, a box's error of a few pixels moves the feet by metres."""
    scene = Scene(camera, 5.0)
    scene.place = lambda _: (away, 0.0)
    random = np.random.default_rng(seed)
    scene.noise = lambda: random.normal(0, 0.03, 4)
    scene.drone = lambda time: hovering(max(0.1, 1.5 - 0.35 * max(0.0, time - TURN_OFF)))
    assert scene.play(9.0) == []


def test_who_got_up_and_bends_has_not_fallen_again() -> None:
    """A fall is over with it."""
    scene = Scene(WIDE)
    scene.place = lambda _: (4.0, 0.0)
    scene.posture = lambda time: falling(time, forward=True) if time < 5.0 else Posture()
    scene.sink = lambda time: 0.75 * min(max((time - 6.0) / 1.5, 0.0), 1.0)
    told = scene.play(9.0)
    assert told != []
    assert told[-1] < 5.0


@LENSES
@pytest.mark.parametrize("seconds", [0.9, 1.5, 3.0])
def test_bending_and_crouching_is_no_fall(camera: CameraModel, seconds: float) -> None:
    """The top of the body sinks by 0.8 m, and stays there."""
    scene = Scene(camera)
    scene.sink = lambda time: 0.8 * min(max((time - TURN_OFF) / seconds, 0.0), 1.0)
    assert scene.play() == []


@pytest.mark.slow
@LENSES
@given(
    swing=st.floats(0.0, 0.3),
    climb=st.floats(-0.4, 0.6),
    turning=st.floats(-1.2, 1.2),
    speed=st.floats(-1.0, 1.0),
)
@settings(max_examples=30)
def test_a_drone_that_moves_makes_nobody_fall(
    camera: CameraModel, swing: float, climb: float, turning: float, speed: float
) -> None:
    """It pitches by 17 degrees, climbs, turns until nobody is in the picture, comes and goes."""
    scene = Scene(camera)

    def moving(time: float) -> Odometry:
        since = max(0.0, time - TURN_OFF)
        height = 1.5 + climb * math.sin(min(since, 1.6))
        pitch = swing * math.sin(4.0 * since)
        return hovering(height, east=speed * min(since, 0.8), yaw=turning * since, pitch=pitch)

    scene.drone = moving
    assert scene.play() == []


@pytest.mark.slow
@LENSES
@given(course=st.floats(-math.pi, math.pi), speed=st.floats(0.3, 2.5), height=st.floats(0.8, 3.0))
@example(course=3.0, speed=1.0, height=1.75)
@example(course=3.08, speed=1.69, height=1.65)
@example(course=3.0, speed=2.0, height=2.0)
@example(course=3.0, speed=2.5, height=2.0)
@settings(max_examples=40)
def test_walking_out_of_the_picture_is_no_fall(
    camera: CameraModel, course: float, speed: float, height: float
) -> None:
    """Sideways, and below the drone."""
    scene = Scene(camera)
    scene.turn = course
    scene.drone = lambda _: hovering(height)

    def walking(time: float) -> tuple[float, float]:
        way = speed * max(0.0, time - TURN_OFF)
        return 2.0 + way * math.cos(course), way * math.sin(course)

    scene.place = walking
    scene.posture = lambda time: Posture(travelled=speed * time, stepping=0.8)
    assert scene.play() == []


@LENSES
def test_who_is_not_found_for_a_while_has_not_fallen(camera: CameraModel) -> None:
    """A detector that misses, a person who steps behind a wall."""
    scene = Scene(camera)
    scene.hidden = lambda time: TURN_OFF < time < TURN_OFF + 2.0
    assert scene.play() == []


def test_a_camera_that_knows_neither_height_nor_lens_tells_nothing() -> None:
    """And does not stumble over it."""
    seen = Scene(TELLO).seen(0.0)
    blind = Detections(seen.header, seen.items, seen.width, seen.height)
    assert not FallDetector(0.35).shows(seen.items[0], blind)


def test_a_fall_that_a_braking_drone_saw_five_times_a_second_is_told() -> None:
    """As a flight recorded it: it begins between two frames, and ends at the lower edge."""
    falls, told = FallDetector(0.35), []
    for stamp, box, position, yaw, roll, pitch in _SEEN_BY_A_BRAKING_DRONE:
        camera = replace(WIDE, mount=(0.1, 0.0, 0.08))
        pose = Odometry(np.array(position), np.zeros(3), yaw, roll, pitch)
        body = Detection(box, "person", 0.9)
        header = Header(0, round(stamp * NANOSECONDS), "drone/cam")
        if falls.shows(body, Detections(header, (body,), 640, 360, camera, pose)):
            told.append(stamp)
    assert told == [row[0] for row in _SEEN_BY_A_BRAKING_DRONE[3:]]


def test_who_sits_down_on_the_ground_as_quickly_as_people_do_has_not_fallen() -> None:
    """Slower than 1.3 m/s at every moment, though it begins and ends slowly."""
    for rate in (5.0, 10.0, 30.0):
        scene = Scene(WIDE, rate)
        scene.place = lambda _: (3.0, 0.0)

        def sink(time: float, scene: Scene = scene) -> float:
            share = min(max((time - TURN_OFF) / 1.0, 0.0), 1.0)
            return 0.46 * scene.tall * share * share * (3 - 2 * share)

        scene.sink = sink
        assert scene.play() == [], rate


@LENSES
@pytest.mark.parametrize("rate", [2.0, 5.0, 10.0])
@pytest.mark.parametrize("raised", [0.5, 0.9])
@pytest.mark.parametrize("tall", [1.55, 1.75])
def test_who_waved_and_sits_down_on_the_ground_has_not_fallen(
    camera: CameraModel, rate: float, raised: float, tall: float
) -> None:
    """A raised hand makes nobody taller, of whom sitting were less than half."""
    scene = Scene(camera, rate)
    scene.place, scene.tall = lambda _: (4.0, 0.0), tall
    scene.posture = lambda time: Posture(raised=float(TURN_OFF - raised < time <= TURN_OFF))
    scene.sink = lambda time: 0.46 * tall * min(max((time - TURN_OFF) / 1.5, 0.0), 1.0)
    assert scene.play() == []


def test_who_waved_for_long_is_known_again_soon_after() -> None:
    """What a body's height is told by is five seconds long."""
    scene = Scene(WIDE, 5.0)
    scene.place = lambda _: (4.0, 0.0)
    scene.posture = lambda time: Posture(raised=float(time <= 8.0))
    scene.sink = lambda time: 0.46 * scene.tall * min(max((time - 13.0) / 1.5, 0.0), 1.0)
    assert scene.play(17.0) == []


def test_who_comes_where_a_taller_one_stood_is_not_lower_for_it() -> None:
    """Nobody is in the picture for longer than somebody who falls."""
    scene = Scene(WIDE, 5.0)
    scene.tall, child = 1.95, 1.45
    scene.place = lambda _: (4.0, 0.0)
    scene.hidden = lambda time: 1.0 < time < 2.7
    sits = 3.2

    def sink(time: float) -> float:
        sitting = 0.46 * child * min(max((time - sits) / 1.5, 0.0), 1.0)
        return 0.0 if time < TURN_OFF else scene.tall - child + sitting

    scene.sink = sink
    assert scene.play(7.0) == []


_SEEN_BY_A_BRAKING_DRONE = (
    (120.8, (250, 69, 348, 326), (29.712, 0.402, 1.479), 0.483, -0.009, 0.076),
    (121.0, (256, 59, 341, 287), (29.735, 0.434, 1.487), 0.511, -0.013, 0.111),
    (121.2, (254, 74, 337, 282), (29.819, 0.459, 1.507), 0.543, -0.014, 0.131),
    (121.4, (261, 191, 354, 346), (29.963, 0.564, 1.513), 0.569, -0.007, 0.023),
    (121.6, (268, 285, 350, 360), (30.091, 0.638, 1.501), 0.605, -0.002, -0.118),
    (121.8, (279, 290, 355, 360), (30.159, 0.688, 1.490), 0.627, 0.001, -0.127),
    (122.0, (282, 280, 366, 360), (30.207, 0.707, 1.492), 0.648, 0.004, -0.102),
    (122.2, (287, 270, 375, 360), (30.221, 0.689, 1.497), 0.659, 0.001, -0.068),
    (122.4, (289, 260, 384, 359), (30.213, 0.699, 1.509), 0.668, 0.016, -0.041),
    (122.6, (291, 250, 388, 359), (30.163, 0.663, 1.494), 0.667, 0.002, -0.027),
    (122.8, (293, 243, 390, 360), (30.151, 0.638, 1.487), 0.667, 0.004, -0.003),
    (123.0, (293, 237, 389, 360), (30.123, 0.659, 1.502), 0.674, 0.001, 0.001),
    (123.2, (292, 236, 387, 359), (30.093, 0.635, 1.529), 0.673, 0.001, -0.006),
)
"""Seconds; the box; the drone's position, yaw, roll and pitch."""
