"""What a guest's process sends is read as data: known classes, fields of their types, bounds."""

from __future__ import annotations

import json
import socket
import struct
from typing import Any

import numpy as np
import pytest

from aerodaas.analytics.guests.channel import LARGEST_TEXT, Channel, GuestError
from aerodaas.analytics.guests.document import read_document
from aerodaas.analytics.item_json import decoded, encoded
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.errors import GraphError
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.frames import Header
from aerodaas.messages.guest_item import GuestItem
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.readings import Alert, Readings
from aerodaas.messages.schema import MessageError, json_of
from aerodaas.messages.waypoints import (
    NavigationItem,
    SchedulingType,
    VelocityCommand,
    Waypoint,
    WaypointType,
)

HEADER = Header(3, 4, "drone/cam")
POINTS = np.arange(6, dtype=np.float32).reshape(2, 3)


class Own:
    """A class of the guest's."""


def opaque(item: object) -> GuestItem:
    """Hide an item."""
    return GuestItem(type(item).__name__, {"a": 1}, b"secret")


@pytest.mark.parametrize(
    "item",
    [
        None,
        1.5,
        "text",
        [1, ("a", {"b": 2.0})],
        Readings(5, {"count": 1.0}),
        Odometry(np.zeros(3), np.ones(3), 0.5),
        Detections(HEADER, (Detection((0.0, 1.0, 2.0, 3.0), "p", 0.5, keypoints=POINTS),), 64, 48),
        Waypoint("a", 1.0, 2.0, 3.0, waypoint_type=WaypointType.LOCAL, deadline=4.0),
    ],
)
def test_items_come_back(item: object) -> None:
    """As they were, by way of text."""
    back = decoded(json.loads(json.dumps(encoded(item, opaque))))
    assert type(back) is type(item)
    assert str(back) == str(item)


def test_navigation_comes_back() -> None:
    """Its items and whether they may be reordered."""
    items: list[NavigationItem] = [Waypoint("a", 1, 2, 3), VelocityCommand(0.5)]
    sent = AeroNavigation(data=items, scheduling_type=SchedulingType.UNORDERED)
    back = decoded(json.loads(json.dumps(encoded(sent, opaque))))
    assert list(back) == items
    assert back.scheduling_type is SchedulingType.UNORDERED


def test_what_is_unknown_stays_closed() -> None:
    """Its name and a view of it come, its content as bytes that are not decoded."""
    back = decoded(encoded(Own(), opaque))
    assert back == GuestItem("Own", {"a": 1}, b"secret")


def deep(levels: int) -> Any:  # noqa: ANN401 - JSON
    """Lists in lists."""
    content: Any = 1
    for _ in range(levels):
        content = [content]
    return content


@pytest.mark.parametrize(
    "content",
    [
        {"is": "Popen", "of": {"args": "true"}},
        {"is": "Waypoint", "of": {"id": "a", "x": float("nan"), "y": 0, "z": 0}},
        {"is": "Waypoint", "of": {"id": "a", "x": 10**400, "y": 0, "z": 0}},
        {"is": "Waypoint", "of": {"id": "a", "x": "1", "y": 0, "z": 0}},
        {"is": "Waypoint", "of": {"id": "a", "x": 1, "y": 0, "z": 0, "__class__": 1}},
        {"is": "Waypoint", "of": {}},
        {"is": "AeroNavigation", "of": [1.0], "scheduling": "ordered"},
        {"is": "AeroNavigation", "of": []},
        {"is": "array", "type": "O", "shape": [1], "data": ""},
        {"is": "array", "type": "<f8", "shape": [2**62], "data": ""},
        {"is": "array", "type": "<f8", "shape": [-1], "data": ""},
        {"is": "GuestItem", "kind": "a b", "value": 1, "data": ""},
        {"is": "Readings", "of": {"stamp": 1, "values": {"a": []}}},
        [0] * 200_000,
        {"is": []},
        deep(40),
        {"is": "Alert", "of": {**json_of(Alert(HEADER, "a", "b")), "values": {"a": [0] * 200_000}}},
    ],
)
def test_malformed_items_are_refused(content: object) -> None:
    """By one error."""
    with pytest.raises(MessageError):
        decoded(content)


@pytest.mark.parametrize(
    "content",
    [
        None,
        [],
        {},
        {"version": 2, "nodes": []},
        {"version": 1, "nodes": [{"id": "../etc"}]},
        {"version": 1, "nodes": [{"id": "a@b"}]},
        {"version": 1, "nodes": [{"id": "a", "rate": float("inf")}]},
        {"version": 1, "nodes": [{"id": "a", "work": "os:system"}]},
        {"version": 1, "nodes": [{"id": "a", "triggers": [{"target": "d", "method": "fire"}]}]},
        {"version": 1, "nodes": [{"id": f"a{n}"} for n in range(100)]},
    ],
)
def test_malformed_documents_are_refused(content: object) -> None:
    """With the place."""
    with pytest.raises(GraphError, match="its document"):
        read_document(content)


@pytest.mark.parametrize(
    "data",
    [
        struct.pack("<II", LARGEST_TEXT + 1, 0),
        struct.pack("<II", 2, 2**32 - 1) + b"{}",
        struct.pack("<II", 2, 0) + b"[]",
        struct.pack("<II", 4, 0) + b"\xff\xfe{}",
        struct.pack("<II", 100_000, 0) + b"[" * 100_000,
        struct.pack("<II", 50, 0) + b"{",
        b"abc",
        b"",
    ],
)
def test_malformed_messages_are_refused(data: bytes) -> None:
    """Before their size is believed, and when they end early."""
    ours, theirs = socket.socketpair()
    with ours, theirs:
        theirs.sendall(data)
        theirs.close()
        with pytest.raises(GuestError):
            Channel(ours).receive(2.0)


def test_a_message_that_drips_is_cut_off() -> None:
    """The time is for the whole message, not for each byte."""
    ours, theirs = socket.socketpair()
    with ours, theirs:
        theirs.sendall(struct.pack("<II", 50, 0))
        with pytest.raises(GuestError, match="in time"):
            Channel(ours).receive(0.2)
