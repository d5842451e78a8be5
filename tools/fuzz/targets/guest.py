"""What a guest's process sends its owner: messages of the channel, documents, and results."""

from __future__ import annotations

import contextlib
import json
import random
import socket
import struct
from collections.abc import Iterable
from typing import Any

import numpy as np

from aerodaas.analytics.guests.channel import Channel, GuestError
from aerodaas.analytics.guests.document import (
    GuestDocument,
    GuestNavigation,
    GuestNode,
    GuestTrigger,
    read_document,
)
from aerodaas.analytics.item_json import decoded, encoded
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.errors import GraphError
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.frames import Header
from aerodaas.messages.guest_item import GuestItem
from aerodaas.messages.readings import Readings
from aerodaas.messages.schema import MessageError
from aerodaas.messages.waypoints import VelocityCommand, Waypoint
from tools.fuzz.json_changes import VALUES, change_value, flip_byte

_HEAD = struct.Struct("<II")
_BYTES = 0.2
"""Share of mutations that change a byte."""


def seeds() -> Iterable[bytes]:
    """Messages as a guest's process sends them."""
    header = Header(1, 2, "drone/cam")
    points = np.zeros((3, 3), np.float32)
    people = (Detection((0.0, 1.0, 2.0, 3.0), "person", 0.5, keypoints=points),)
    items: list[object] = [
        Detections(header, people, 64, 48),
        Readings(5, {"count": 1.0}),
        AeroNavigation(data=[Waypoint("a", 1, 2, 3, yaw=0.5), VelocityCommand(1.0)]),
        GuestItem,
    ]
    for item in items:
        content = encoded(item, lambda _: GuestItem("Own", {"a": 1}, b"x"))
        yield _message({"item": content, "fired": [0], "alerts": ["a"]})
    node = GuestNode(
        id="drone/a",
        robot="drone",
        inputs=["drone/cam"],
        compute="edge",
        navigation=True,
        triggers=[GuestTrigger(target="drone", method="end_mission")],
    )
    flight = GuestNavigation(robot="drone", stream="drone/a", waypoints=[])
    document = GuestDocument(version=1, nodes=[node], navigation=[flight])
    yield _message({"document": document.model_dump(mode="json")})


def run(data: bytes) -> None:
    """Receive a message as the owner does, and read what it holds."""
    ours, theirs = socket.socketpair()
    with ours, theirs:
        theirs.settimeout(0.0)
        with contextlib.suppress(BlockingIOError):
            theirs.send(data)
        theirs.close()
        try:
            content, _ = Channel(ours).receive(1.0)
        except GuestError:
            return
    with contextlib.suppress(MessageError):
        decoded(content.get("item"))
    with contextlib.suppress(GraphError):
        read_document(content.get("document"))


def mutate(data: bytes, rng: random.Random) -> bytes:
    """Change one value of the JSON, and one byte now and then."""
    size, _ = _HEAD.unpack_from(data) if len(data) >= _HEAD.size else (0, 0)
    try:
        content = json.loads(data[_HEAD.size : _HEAD.size + size])
    except (ValueError, RecursionError):
        return flip_byte(data, rng)
    if rng.random() < _BYTES or not change_value(content, rng, (*VALUES, {"is": "tuple"})):
        return flip_byte(data, rng)
    try:
        return _message(content)
    except (ValueError, RecursionError):  # it holds itself
        return flip_byte(data, rng)


def _message(content: Any) -> bytes:  # noqa: ANN401 - JSON
    text = json.dumps(content).encode()
    return _HEAD.pack(len(text), 0) + text
