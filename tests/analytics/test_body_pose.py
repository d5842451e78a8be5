"""Gestures of the simulator's own people: a raised hand lands, a fall alerts, nothing else does."""

from __future__ import annotations

import math
import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from follow_world import TELLO, Snapshot
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from aerodaas.analytics.people.body_pose import BodyPoseEmergencyAnalytics, fallen, hand_raised
from aerodaas.analytics.people.debounce import Debounce
from aerodaas.analytics.people.gestures import GESTURES, GestureClassifier, normalised
from aerodaas.clock import NANOSECONDS
from aerodaas.dataflow.graph import AeroStreamData, Graph, Node
from aerodaas.errors import ConfigError, GraphError, ModelError
from aerodaas.geometry.frames import enu_to_body
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.frames import Header
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.readings import Alert
from aerodaas.simulation.skeleton import KEYPOINTS, Posture, joints

RATE = 10


def body(
    posture: Posture,
    *,
    ahead: float = 4.0,
    left: float = 0.0,
    turn: float = math.pi,
    up: float = 1.5,
) -> Detection:
    """A person as an exact pose model would find it, from a level drone."""
    points = joints(1.75, posture)[list(KEYPOINTS)]
    turned = np.array([enu_to_body(point, turn) for point in points])
    placed = turned + np.array([ahead, left, -up])
    pixels = np.array([TELLO.project(point) for point in placed])
    confidence = 0.9 * ((np.abs(pixels[:, 0] - 640) < 640) & (np.abs(pixels[:, 1] - 360) < 360))
    keypoints = np.column_stack([pixels[:, :2], confidence]).astype(np.float32)
    low, high = pixels[:, :2].min(axis=0), pixels[:, :2].max(axis=0)
    box = (float(low[0]) - 5, float(low[1]) - 5, float(high[0]) + 5, float(high[1]) + 5)
    return Detection(box, "person", 0.9, keypoints=keypoints)


def frame(step: int, *items: Detection) -> Detections:
    """Frame `step` of ten a second."""
    pose = Odometry(np.array([0.0, 0.0, 1.5]), np.zeros(3), 0.0)
    header = Header(step, step * NANOSECONDS // RATE, "drone/cam")
    return Detections(header, items, 1280, 720, TELLO, pose)


class Watch:
    """A mission's worth of frames through the analysis."""

    def __init__(self, **words: object) -> None:
        self.pose = BodyPoseEmergencyAnalytics(**words)  # type: ignore[arg-type]
        self.pose.open()
        self.alerts: list[Alert] = []
        self.step = 0

    def see(self, count: int, *items: Detection) -> Detections | None:
        """Show the same frame `count` times; returns the last result."""
        result = None
        for _ in range(count):
            item = frame(self.step, *items)
            result = self.pose.process(item, Snapshot(item.header.stamp, None, self.alerts))
            self.step += 1
        return result


@pytest.mark.parametrize("turn", [0.0, 0.8, math.pi / 2, math.pi, -2.0])
@pytest.mark.parametrize("ahead", [2.0, 4.0, 8.0])
def test_a_raised_hand_is_confirmed_from_all_sides(turn: float, ahead: float) -> None:
    """Also at two metres, where the feet are out of the picture; walking before tells nothing."""
    watch = Watch()
    for step in range(15):
        walking = body(Posture(travelled=0.1 * step, stepping=0.8), ahead=ahead, turn=turn)
        result = watch.see(1, walking)
        assert not hand_raised(result)
        assert not fallen(result)
    result = watch.see(13, body(Posture(raised=1.0), ahead=ahead, turn=turn))
    assert hand_raised(result)
    assert not fallen(result)
    assert [alert.kind for alert in watch.alerts] == ["hand_raised"]


@pytest.mark.parametrize("turn", [0.4, math.pi / 2, 2.5, -1.2])
def test_a_fall_alerts_once(turn: float) -> None:
    """And is over when the person stands again."""
    watch = Watch()
    watch.see(5, body(Posture(), ahead=5.0, turn=turn))
    result = watch.see(22, body(Posture(fallen=1.0), ahead=5.0, turn=turn))
    assert fallen(result)
    assert [alert.kind for alert in watch.alerts] == ["fallen"]
    assert not fallen(watch.see(22, body(Posture(), ahead=5.0, turn=turn)))


def test_who_falls_out_of_the_picture_is_told_and_shown_where_last_seen() -> None:
    """So that a trigger by `fallen` fires, too; a person who is merely gone is not."""
    for shares, told in (((0.1, 0.3, 0.42), ["fallen"]), ((), [])):
        watch = Watch()
        watch.see(10, body(Posture(), ahead=2.0, turn=0.0))
        for share in shares:
            watch.see(1, body(Posture(fallen=share), ahead=2.0, turn=0.0))
        result = watch.see(7)
        assert [alert.kind for alert in watch.alerts] == told
        assert fallen(result) is bool(told)


def test_a_moment_is_no_gesture() -> None:
    """Five frames in a row, less than the six that it takes, tell nothing."""
    watch = Watch()
    for _ in range(5):
        watch.see(6, body(Posture()))
        assert not hand_raised(watch.see(5, body(Posture(raised=1.0))))
    assert watch.alerts == []


def test_only_the_person_in_the_middle_counts() -> None:
    """A passer-by who waves lands nothing, though nearer to the middle later on."""
    watch = Watch()
    result = None
    for step in range(20):
        passer = body(Posture(raised=1.0), ahead=9.0, left=3.0 - 0.3 * step)
        result = watch.see(1, body(Posture(), ahead=3.0, left=0.4), passer)
    assert watch.alerts == []
    assert result is not None
    assert sorted(one.label for one in result) == ["person", "upright"]


def test_who_stays_in_the_middle_is_watched_after_two_seconds() -> None:
    """A passer-by who was seen first is not for ever the one whom the drone follows."""
    watch = Watch()
    aside, middle = body(Posture(), ahead=4.0, left=1.8), body(Posture(), ahead=3.0)
    watch.see(10, aside)
    hand = body(Posture(raised=1.0), ahead=3.0)
    watch.see(19, aside, hand)
    assert watch.alerts == []
    watch.see(5, aside, middle)
    watch.see(15, aside, hand)
    assert [alert.kind for alert in watch.alerts] == ["hand_raised"]


def test_who_crosses_the_middle_is_not_watched() -> None:
    """Nor is anybody else while the one who is watched lies."""
    watch = Watch()
    aside, hand = body(Posture(), ahead=4.0, left=1.8), body(Posture(raised=1.0), ahead=3.0)
    watch.see(10, aside)
    for _ in range(3):
        watch.see(15, aside, hand)
        watch.see(1, aside)
    assert watch.alerts == []
    watch.see(20, body(Posture(fallen=1.0), ahead=4.0, left=1.8, turn=1.0))
    watch.see(40, body(Posture(fallen=1.0), ahead=4.0, left=1.8, turn=1.0), hand)
    assert [alert.kind for alert in watch.alerts] == ["fallen"]


def test_who_wears_the_vest_counts() -> None:
    """Wherever in the picture; with no vest in sight for a second, nobody does."""
    watch = Watch()
    watch.pose._streams = 2
    wearer = body(Posture(raised=1.0), ahead=5.0, left=2.0)
    other = body(Posture(), ahead=3.0)
    u, v = wearer.centre
    result = None
    vest = Detection((u - 20, v - 60, u + 20, v), "vest", 0.8)
    for _ in range(8):
        assert watch.see(1, vest) is None
        result = watch.see(1, other, wearer)
    assert hand_raised(result)
    assert not hand_raised(watch.see(25, other, wearer))
    assert len(watch.alerts) == 1


@given(seed=st.integers(0, 10_000), count=st.integers(0, 6))
@settings(max_examples=10)
def test_nonsense_is_never_a_crash_and_never_a_landing(seed: int, count: int) -> None:
    """NaN, infinite, empty, misshapen keypoints: nobody counts, and it is counted."""
    random = np.random.default_rng(seed)
    watch = Watch()
    for _ in range(8):
        items = []
        for _ in range(count):
            points = random.normal(0, 1e3, (17, 3)).astype(np.float32)
            points[random.random((17, 3)) < 0.5] = random.choice([math.nan, math.inf, -math.inf])
            shape = points if random.random() < 0.8 else points[: random.integers(0, 17)]
            box = tuple(random.choice([math.nan, 1.0, 5.0, 300.0, 700.0], 4).tolist())
            items.append(Detection(box, "person", 0.5, keypoints=shape))
        watch.see(1, *items)
    assert watch.alerts == []


def test_thousands_of_people_are_bounded() -> None:
    """Those nearest to the middle are looked at, and a body that is boxed often counts once."""
    watch = Watch()
    crowd = [body(Posture(), left=0.8 * index) for index in range(-1, 2)] * 1000
    result = watch.see(2, *crowd)
    assert result is not None
    assert 1 <= len(result) <= 3


def test_a_body_that_is_boxed_in_parts_is_one_body() -> None:
    """Whole, then without its legs, then both: the gesture goes on."""
    watch = Watch()
    whole = body(Posture(raised=1.0))
    left, top, right, bottom = whole.box
    assert whole.keypoints is not None
    points = whole.keypoints.copy()
    points[11:, 2] = 0.1
    upper = replace(whole, box=(left, top, right, (top + bottom) / 2), keypoints=points)
    watch.see(6, whole)
    watch.see(2, upper)
    watch.see(2, whole, upper)
    result = watch.see(3, upper)
    assert hand_raised(result)
    assert result is not None
    assert len(result) == 1


def test_what_cannot_work_is_refused_at_build_time(tmp_path: Path) -> None:
    """Streams of something else, models without keypoints, settings; each with the remedy."""

    class Boxes:
        path = "yolo11n.onnx"

        class decoder:  # noqa: N801 - an attribute
            keypoints = None

    graph = Graph()
    graph.add(Node("drone/boxes", "analytics", Detections, Boxes(), robot="drone"))
    graph.add(Node("drone/odom", "sensor", Odometry, None, robot="drone"))
    with pytest.raises(GraphError, match="use a pose model, or analyse the camera's stream"):
        BodyPoseEmergencyAnalytics().analyse(AeroStreamData(graph, "drone/boxes", Detections))
    with pytest.raises(GraphError, match="takes a stream of Detections or Frame"):
        BodyPoseEmergencyAnalytics().analyse(AeroStreamData(graph, "drone/odom", Odometry))
    with pytest.raises(ConfigError, match="needed must lie between"):
        BodyPoseEmergencyAnalytics(needed=7, of=6)
    (tmp_path / "broken.onnx").write_bytes(b"no model")
    with pytest.raises(ModelError, match="is no ONNX model"):
        BodyPoseEmergencyAnalytics(gestures=tmp_path / "broken.onnx")
    with pytest.raises(ModelError, match="cannot read the gesture model"):
        BodyPoseEmergencyAnalytics(gestures=tmp_path / "none.onnx")


def test_a_raised_hand_lands_the_robot_whose_camera_it_is() -> None:
    """By a trigger that travels; unless told not to."""
    graph = Graph()
    graph.add(Node("drone/poses", "analytics", Detections, None, robot="drone"))
    poses = AeroStreamData[Detections](graph, "drone/poses", Detections)
    pose = BodyPoseEmergencyAnalytics()
    assert pose.analyse(poses).item is Detections
    assert pose.node is not None
    (trigger,) = pickle.loads(pickle.dumps(pose.node.triggers))  # noqa: S301
    assert (trigger.target, trigger.method) == ("drone", "end_mission")
    assert trigger.when(frame(0, replace(body(Posture()), label="hand_raised")))
    assert not trigger.when(frame(0, body(Posture())))
    quiet = BodyPoseEmergencyAnalytics(lands=False)
    quiet.analyse(poses)
    assert quiet.node is not None
    assert quiet.node.triggers == []


def test_boxes_without_keypoints_are_explained_once() -> None:
    """In flight, where the model's kind could not be told before."""
    watch = Watch()
    watch.pose._streams = 1
    watch.see(5, replace(body(Posture()), keypoints=None))
    assert [alert.kind for alert in watch.alerts] == ["no_keypoints"]


@given(
    scale=st.floats(0.2, 5.0),
    right=st.floats(-500, 500),
    down=st.floats(-500, 500),
    seed=st.integers(0, 99),
)
@settings(max_examples=20)
def test_features_do_not_depend_on_place_and_size(
    scale: float, right: float, down: float, seed: int
) -> None:
    """A body moved and scaled in the picture gives the same numbers."""
    random = np.random.default_rng(seed)
    keypoints = body(Posture(0.3, 0.5, float(random.random()))).keypoints
    assert keypoints is not None
    keypoints[random.random(17) < 0.2, 2] = 0.0
    moved = keypoints * [scale, scale, 1.0] + [right, down, 0.0]
    here, useful = normalised(keypoints[None], 0.35)
    there, _ = normalised(moved[None].astype(np.float32), 0.35)
    assert not useful[0] or there == pytest.approx(here, abs=2e-3)


def test_the_shipped_model_is_as_good_as_its_card_says() -> None:
    """On bodies of a seed of its own: above 90 % right, and next to no upright body lands."""
    from tools.training.gestures import sample_keypoints  # noqa: PLC0415 - slow to draw

    random = np.random.default_rng(424242)
    classifier = GestureClassifier()
    classifier.open()
    told = {name: [sample_keypoints(random, name) for _ in range(40)] for name in GESTURES}
    guesses = {name: classifier.classify(bodies) for name, bodies in told.items()}
    right = [guess is not None and guess[0] == name for name in told for guess in guesses[name]]
    assert np.mean(right) > 0.87
    landing = [
        one is not None and one[0] == "hand_raised" and one[1] > 0.6 for one in guesses["upright"]
    ]
    assert np.mean(landing) < 0.08


@given(
    shown=st.lists(st.booleans(), max_size=60),
    needed=st.integers(1, 5),
    more=st.integers(0, 3),
    hold=st.sampled_from([0.0, 0.5]),
)
@settings(max_examples=60, suppress_health_check=[HealthCheck.too_slow])
def test_an_event_has_its_frames_and_its_time(
    shown: list[bool], needed: int, more: int, hold: float
) -> None:
    """It begins only with `needed` of the last frames, and ends only when none shows it."""
    event = Debounce(needed, needed + more, hold)
    for index, one in enumerate(shown):
        before = event.active
        active = event.update(index * NANOSECONDS // 10, one)
        window = shown[max(0, index - needed - more + 1) : index + 1]
        if active and not before:
            assert sum(window) >= needed
            assert event.began
        if before and not active:
            assert not any(window)


def test_a_hand_that_is_not_seen_is_not_raised() -> None:
    """Hips and legs alone, as of one whose trunk is hidden, land nothing."""
    one = body(Posture(raised=1.0), ahead=4.0)
    assert one.keypoints is not None
    points = one.keypoints.copy()
    points[:11, 2] = 0.1
    watch = Watch()
    assert not hand_raised(watch.see(12, replace(one, keypoints=points)))
    assert watch.alerts == []
