"""A recorded target is a stranger's word: it is drawn only where it is whole, on its own frame."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerodaas.messages.frames import Header
from aerodaas.messages.waypoints import FollowedTarget, TargetState
from aerodaas.recording.playback.target import target_of

HEADER = Header(3, 10**9, "drone/cam")
BOX = [1.0, 2.0, 30.0, 40.0]


def recorded(target: object, **changes: object) -> dict[str, Any]:
    """Navigation with this target."""
    return {"stamp": 10**9, "source": "drone/cam", "commands": [{"target": target}], **changes}


def test_a_targets_box_is_that_of_its_frame() -> None:
    """And of no other frame, or camera."""
    told = {"state": "sure", "box": BOX, "track_id": 5}
    assert target_of(recorded(told), HEADER) == FollowedTarget(TargetState.SURE, (1, 2, 30, 40))
    assert target_of(recorded(told, stamp=10**9 + 1), HEADER) is None
    assert target_of(recorded(told, source="drone/belly"), HEADER) is None
    unseen = recorded({"state": "unseen", "box": None})
    assert target_of(unseen, HEADER) == FollowedTarget(TargetState.UNSEEN)


@pytest.mark.parametrize(
    "target",
    [
        None,
        [],
        {"state": "certain", "box": BOX},
        {"state": ["sure"], "box": BOX},
        {"state": "sure", "box": BOX[:3]},
        {"state": "sure", "box": [*BOX[:3], "wide"]},
        {"state": "sure", "box": [*BOX[:3], float("inf")]},
        {"state": "sure", "box": [*BOX[:3], 10**400]},
        {"state": "sure", "box": "1234"},
    ],
)
def test_what_is_malformed_is_none(target: object) -> None:
    """As navigation that follows nothing, or was recorded before targets were."""
    assert target_of(recorded(target), HEADER) is None


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=5) | st.dictionaries(st.text(max_size=5), inner),
    max_leaves=12,
)


@given(commands=JSON, box=JSON)
def test_nothing_that_json_holds_breaks_it(commands: object, box: object) -> None:
    """It is none, or has four finite numbers."""
    for content in (recorded(None, commands=commands), recorded({"state": "sure", "box": box})):
        found = target_of(content, HEADER)
        assert found is None or found.box is None or len(found.box) == 4
