"""Actions with gimbal and camera: by keywords, in documents, and what is refused."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest

from aerodaas import Waypoint
from aerodaas.dataflow.mission_document import NavigationDocument
from aerodaas.errors import InvalidWaypointError
from aerodaas.extensions.payload.actions import (
    AimGimbal,
    LookAt,
    RecordVideo,
    SetLens,
    TakePhoto,
    TriggerPhotos,
)
from aerodaas.messages.actions import Action
from aerodaas.messages.serialization.schema import json_of, message_of

KEYWORDS: list[tuple[dict[str, Any], tuple[Action, ...]]] = [
    ({"photo": True, "video": False}, (TakePhoto(), RecordVideo(on=False))),
    ({"photo": False, "video": None}, ()),
    ({"trigger_distance": 5}, (TriggerPhotos(distance=5.0),)),
    ({"trigger_interval": 2.0, "zoom": 5}, (TriggerPhotos(interval=2.0), SetLens(zoom=5.0))),
    ({"look_at": (1, 2, 3), "focus": 0.0}, (LookAt(1, 2, 3), SetLens(focus=0.0))),
]


@pytest.mark.parametrize(("keywords", "actions"), KEYWORDS)
def test_keywords_and_earlier_documents_name_actions(
    keywords: dict[str, Any], actions: tuple[Action, ...]
) -> None:
    """The constructor takes them, and so does JSON up to version 0.1; actions are written."""
    waypoint = Waypoint("a", 1, 2, 3, **keywords)
    assert waypoint.actions == actions
    earlier = json.loads(json.dumps({"id": "a", "x": 1, "y": 2, "z": 3, **keywords}))
    assert message_of(Waypoint, earlier) == waypoint
    document = NavigationDocument.model_validate({"robot": "drone", "waypoints": [earlier]})
    assert document.waypoints == [waypoint]
    written = json_of(waypoint)
    assert not written.keys() & keywords.keys()
    assert message_of(Waypoint, written) == waypoint


@pytest.mark.parametrize(
    ("actions", "said"),
    [
        ((AimGimbal(), LookAt(1, 2, 3)), r"one of AimGimbal\(.*\) and LookAt\(.*, not both"),
        ((TakePhoto(), TakePhoto()), "not both"),
    ],
)
def test_actions_that_exclude_each_other_are_refused(
    actions: tuple[Action, ...], said: str
) -> None:
    """And in the place of one, another one comes."""
    with pytest.raises(InvalidWaypointError, match=f"waypoint 'w': .*{said}"):
        Waypoint("w", 1, 2, 3, actions=actions)
    one = Waypoint("w", 1, 2, 3, actions=actions[:1])
    assert one.with_actions(*actions[1:]).actions == actions[1:]


def test_actions_and_keywords_are_not_mixed() -> None:
    """A copy by `replace` would keep what its caller means to replace."""
    with pytest.raises(InvalidWaypointError, match="give it actions or photo, not both"):
        Waypoint("w", 1, 2, 3, actions=[SetLens(5.0)], photo=True)


def test_a_waypoint_says_where_the_gimbal_looks() -> None:
    """One angle leaves the other at zero; none leaves the gimbal."""
    assert Waypoint("a", 0, 0, 2).actions == ()
    assert Waypoint("a", 0, 0, 2, gimbal_pitch=-1.0).actions == (AimGimbal(-1.0, 0.0),)
    assert Waypoint("a", 0, 0, 2, gimbal_yaw=0.5).actions == (AimGimbal(0.0, 0.5),)


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"gimbal_pitch": -90}, "radians"),
        ({"gimbal_yaw": 45.0}, "radians"),
        ({"gimbal_pitch": math.nan}, "finite"),
        ({"photo": "yes"}, "True or False"),
        ({"video": 1}, "video must be True, False or None, not 1"),
        ({"zoom": 101}, "zoom is in percent, from 0 to 100"),
        ({"focus": -1}, "focus is in percent"),
        ({"zoom": float("nan")}, "zoom must be a finite number"),
    ],
)
def test_degrees_and_nonsense_are_refused(fields: dict[str, object], said: str) -> None:
    """By the name of the field."""
    with pytest.raises(InvalidWaypointError, match=said):
        Waypoint("a", 0, 0, 2, **fields)  # type: ignore[arg-type]


def test_a_mission_document_holds_it() -> None:
    """The same waypoint comes back, and one without says nothing of it."""
    waypoint = Waypoint(
        "a", 0, 0, 2, gimbal_pitch=-1.0, gimbal_yaw=0.5, zoom=5, focus=80, photo=True, video=False
    )
    navigation = NavigationDocument(robot="drone", waypoints=[waypoint])
    text = navigation.model_dump_json(exclude_defaults=True)
    assert NavigationDocument.model_validate_json(text).waypoints == [waypoint]
    assert "trigger" not in text
