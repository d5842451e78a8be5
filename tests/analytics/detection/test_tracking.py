"""Targets keep their identity through misses, crossings and occlusions."""

from __future__ import annotations

import math
import pickle
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aerodaas.analytics.detection.tracking import Tracker, TrackingAnalytics
from aerodaas.clock import NANOSECONDS
from aerodaas.dataflow.graph import AeroStreamData, Graph, Node
from aerodaas.geometry.frames import CameraModel
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.frames import Header
from aerodaas.messages.odometry import Odometry


def detections(step: int, boxes: Sequence[tuple[float, ...]], label: str = "person") -> Detections:
    """Boxes found in frame `step` of 10 a second."""
    items = tuple(Detection((box[0], box[1], box[2], box[3]), label, 0.9) for box in boxes)
    return Detections(Header(step, step * NANOSECONDS // 10, "cam"), items, 1280, 720)


def person(u: float, v: float = 360.0) -> tuple[float, float, float, float]:
    """A box 80 pixels wide and 200 tall about (u, v)."""
    return u - 40, v - 100, u + 40, v + 100


def ids(tracked: Detections) -> list[int | None]:
    """Identities in the order of the boxes."""
    return [item.track_id for item in tracked]


def test_a_target_is_trusted_from_its_second_sighting_and_survives_misses() -> None:
    """Five frames without it in between change nothing."""
    tracker = Tracker()
    assert ids(tracker.update(detections(0, [person(300)]))) == [None]
    assert ids(tracker.update(detections(1, [person(305)]))) == [1]
    for step in range(2, 7):
        assert ids(tracker.update(detections(step, []))) == []
    assert ids(tracker.update(detections(7, [person(335)]))) == [1]


def test_a_target_unseen_for_its_age_is_lost() -> None:
    """Who comes after that is somebody else."""
    tracker = Tracker(max_age=0.5)
    for step in range(3):
        tracker.update(detections(step, [person(300)]))
    for step in range(3, 9):
        tracker.update(detections(step, []))
    assert tracker.tracks == []
    assert ids(tracker.update(detections(9, [person(300)]))) == [None]
    assert ids(tracker.update(detections(10, [person(300)]))) == [2]


@given(
    speed=st.floats(100, 500),
    height=st.floats(-60, 60),
    gap=st.integers(0, 5),
    noise=st.integers(0, 2**16),
)
@settings(max_examples=40)
def test_two_who_cross_keep_their_identities(
    speed: float, height: float, gap: int, noise: int
) -> None:
    """One hides the other for `gap` frames at the crossing; motion tells who is who."""
    random = np.random.default_rng(noise)
    tracker = Tracker()
    before: list[int | None] = []
    found: list[int | None] = []
    crossing = 15
    for step in range(30):
        shift = speed * (step - crossing) / 10
        jitter = random.normal(0, 3, 4)
        walker = person(640 + shift + jitter[0], 360 + jitter[1])
        other = person(640 - shift + jitter[2], 360 + height + jitter[3])
        hidden = gap > 0 and abs(step - crossing) <= gap / 2
        found = ids(tracker.update(detections(step, [walker] if hidden else [walker, other])))
        if step == 5:
            before = found
    assert None not in before
    assert found == before


def test_labels_are_never_mixed() -> None:
    """A car does not become the person who stood at its place."""
    tracker = Tracker()
    for step in range(3):
        tracker.update(detections(step, [person(300)]))
    assert ids(tracker.update(detections(3, [person(300)], label="car"))) == [None]


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_boxes_that_are_not_finite_are_left_out(bad: float) -> None:
    """The target beside them is still tracked."""
    tracker = Tracker()
    boxes = [(bad, 0, 10, 10), person(300)]
    found = [ids(tracker.update(detections(step, boxes))) for step in range(3)]
    assert found[-1] == [1]


def test_a_frame_that_runs_back_gives_no_identities() -> None:
    """Nothing is predicted backwards."""
    tracker = Tracker()
    tracker.update(detections(5, [person(300)]))
    assert ids(tracker.update(detections(4, [person(300)]))) == [None]
    assert len(tracker.tracks) == 1


def test_thousands_of_boxes_come_to_an_end() -> None:
    """A detector gone wild makes many tracks, which age away."""
    random = np.random.default_rng(0)
    tracker = Tracker(max_age=0.3)
    for step in range(3):
        boxes = [person(u, v) for u, v in random.uniform(0, 700, (150, 2))]
        tracker.update(detections(step, boxes))
    for step in range(3, 8):
        tracker.update(detections(step, []))
    assert tracker.tracks == []


def test_the_analysis_reads_boxes_and_travels_to_its_actor() -> None:
    """It joins the graph as a stream of Detections."""
    graph = Graph()
    graph.add(Node("boxes", "analytics", Detections, None))
    analysis = TrackingAnalytics()
    stream = analysis.analyse(AeroStreamData(graph, "boxes", Detections))
    assert stream.item is Detections
    assert pickle.loads(pickle.dumps(analysis)).tracker.tracks == []  # noqa: S301


def unsure(found: Detections, *places: int) -> Detections:
    """The same frame, in which the boxes at `places` are hardly told from nothing."""
    items = [replace(item, score=0.2) if i in places else item for i, item in enumerate(found)]
    return replace(found, items=tuple(items))


def test_the_unsure_continue_a_track_and_begin_none() -> None:
    """Nor do they take a track from a sure box, however well they fit."""
    tracker = Tracker(sure=0.5)
    pair = [person(300), person(900)]
    for step in range(2):
        tracker.update(unsure(detections(step, pair), 1))
    assert ids(tracker.update(unsure(detections(2, pair), 1))) == [1, None]
    assert ids(tracker.update(unsure(detections(3, pair), 0, 1))) == [1, None]
    both = unsure(detections(4, [person(300), person(306)]), 0)
    assert ids(tracker.update(both)) == [None, 1]
    assert len(tracker.tracks) == 1


def test_somebody_who_looks_otherwise_takes_no_track_over() -> None:
    """In the very place of somebody just hidden, another one is another one."""
    tracker = Tracker()
    random = np.random.default_rng(3)
    first, second = (random.integers(40, 200, 24).astype(np.uint8).tobytes() for _ in range(2))

    def seen(step: int, appearance: bytes) -> list[int | None]:
        found = detections(step, [person(300)])
        shown = tuple(replace(item, appearance=appearance) for item in found)
        return ids(tracker.update(replace(found, items=shown)))

    for step in range(5):
        seen(step, first)
    assert seen(5, first) == [1]
    seen(6, second)
    assert seen(7, second) == [2]
    assert seen(8, first) == [1]


@pytest.mark.parametrize(("told", "kept"), [(True, 1), (False, None)])
def test_a_camera_that_turns_loses_nobody(told: bool, kept: int | None) -> None:  # noqa: FBT001
    """A step of 0.35 rad moves the picture by more than anybody walks, if the attitude is told."""
    camera = CameraModel.from_fov(1280, 720, math.radians(82.6))
    tracker = Tracker()

    def seen(step: int, yaw: float) -> list[int | None]:
        pose = Odometry(np.array([0.0, 0.0, 1.5]), np.zeros(3), yaw)
        u, v, _ = camera.project(np.array([math.cos(-yaw), math.sin(-yaw), 0.0]))
        found = detections(step, [person(u, v)])
        return ids(tracker.update(replace(found, camera=camera, odometry=pose) if told else found))

    for step in range(6):
        seen(step, 0.0)
    assert seen(6, 0.35) == [kept]
