"""One object, one box: halves and loose boxes go, neighbours stay."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from aerodaas.analytics.detection.suppression import one_for_each
from aerodaas.messages.detections import Detection

CORNER, LENGTH = st.floats(0, 300), st.floats(0, 200)


@st.composite
def boxes(draw: st.DrawFn) -> Detection:
    """A box of one of two labels, perhaps an empty one."""
    left, top = draw(CORNER), draw(CORNER)
    box = left, top, left + draw(LENGTH), top + draw(LENGTH)
    return Detection(box, draw(st.sampled_from(["car", "person"])), draw(st.floats(0, 1)))


def shared(one: Detection, other: Detection) -> float:
    """Square pixels that two boxes have in common."""
    left, top = max(one.box[0], other.box[0]), max(one.box[1], other.box[1])
    right, bottom = min(one.box[2], other.box[2]), min(one.box[3], other.box[3])
    return max(0.0, right - left) * max(0.0, bottom - top)


def test_half_a_car_counts_with_the_whole() -> None:
    """Its box is all inside, and less than half of the union."""
    whole = Detection((100, 100, 300, 200), "car", 0.8)
    half = Detection((100, 120, 190, 200), "car", 0.4)
    beside = Detection((310, 100, 500, 200), "car", 0.4)
    driver = Detection((180, 110, 220, 150), "person", 0.4)
    assert one_for_each([half, whole, beside, driver], 0.6) == [whole, beside, driver]


@given(items=st.lists(boxes(), max_size=12), share=st.floats(0.1, 0.9))
def test_what_stays_is_apart_and_what_goes_lay_in_a_better_one(
    items: list[Detection], share: float
) -> None:
    """Nothing is invented, and the best box of all stays."""
    kept = one_for_each(items, share)
    for item in items:
        better = [
            one
            for one in kept
            if one is not item and one.label == item.label and one.score >= item.score
        ]
        covered = any(shared(one, item) > share * min(one.area, item.area) for one in better)
        assert any(one is item for one in kept) != covered
