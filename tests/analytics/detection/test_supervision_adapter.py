"""Detections to and from `supervision` itself."""

from __future__ import annotations

import sys

import numpy as np
import pytest
import supervision
from hypothesis import given
from hypothesis import strategies as st

from aerodaas.analytics import from_supervision, to_supervision
from aerodaas.errors import ConfigError
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.frames import Frame, Header

FRAME = Frame(Header(7, 5, "drone/cam"), np.zeros((120, 160, 3), np.uint8))
EDGE = st.floats(0, 100)
ITEMS = st.builds(
    lambda left, top, label, score, track, depth: Detection(
        (left, top, left + 10, top + 20), label, score, track, depth=depth
    ),
    EDGE,
    EDGE,
    st.sampled_from(["person", "car", "tower"]),
    st.floats(0, 1),
    st.none() | st.integers(0, 1000),
    st.none() | st.floats(0.1, 50),
)


@given(st.lists(ITEMS, max_size=8))
def test_there_and_back_is_the_same(items: list[Detection]) -> None:
    """Boxes, labels, scores, identities and depths, best first, with the frame's header."""
    ours = Detections.of(FRAME, items)
    theirs = to_supervision(ours)
    assert len(theirs) == len(ours)
    assert from_supervision(theirs, ours) == ours


def test_their_filters_tracker_and_zones_take_it() -> None:
    """What the adapter is for: supervision's own tools, and the result as ours."""
    items = [
        Detection((10.0, 10.0, 50.0, 90.0), "person", 0.9),
        Detection((100.0, 20.0, 150.0, 60.0), "car", 0.8),
    ]
    ours = Detections.of(FRAME, items)
    theirs = to_supervision(ours, classes=["person", "car"])
    assert theirs.class_id is not None
    assert theirs.class_id.tolist() == [0, 1]
    left_half = np.array([[0, 0], [80, 0], [80, 120], [0, 120]])
    zone = supervision.PolygonZone(
        left_half, triggering_anchors=[supervision.Position.CENTER]
    ).trigger(theirs)
    inside = theirs[zone]
    assert isinstance(inside, supervision.Detections)
    assert [one.label for one in from_supervision(inside, ours)] == ["person"]


def test_results_of_other_models_become_ours() -> None:
    """Without names by `classes`, without confidence with a score of one; depth is measured."""
    depth = np.full((120, 160), 2500, np.uint16)
    frame = Frame(FRAME.header, FRAME.image, depth=depth)
    theirs = supervision.Detections(
        xyxy=np.array([[10.0, 10.0, 50.0, 90.0]]), class_id=np.array([1])
    )
    (found,) = from_supervision(theirs, frame, classes=["person", "car"])
    assert (found.label, found.score, found.track_id, found.depth) == ("car", 1.0, None, 2.5)
    with pytest.raises(ConfigError, match="give `classes`"):
        from_supervision(theirs, frame)


def test_keypoints_come_along() -> None:
    """Where all objects have as many."""
    points = np.arange(51, dtype=np.float32).reshape(17, 3)
    ours = Detections.of(FRAME, [Detection((0, 0, 9, 9), "person", 0.5, keypoints=points)])
    (found,) = from_supervision(to_supervision(ours), ours)
    np.testing.assert_array_equal(found.keypoints, points)


def test_a_label_without_a_number_and_a_missing_package_are_told(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """With their remedies."""
    ours = Detections.of(FRAME, [Detection((0, 0, 9, 9), "tower", 0.5)])
    with pytest.raises(ConfigError, match="'tower' is not among the classes"):
        to_supervision(ours, classes=["car"])
    monkeypatch.setitem(sys.modules, "supervision", None)
    with pytest.raises(ConfigError, match=r"pip install 'aerodaas\[supervision\]'"):
        to_supervision(ours)
