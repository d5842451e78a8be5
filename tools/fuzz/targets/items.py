"""Items as another process sends them: messages of the channel, each with an item and its blob."""

from __future__ import annotations

import contextlib
import json
import random
import socket
from collections.abc import Iterable
from typing import Any

import numpy as np

from aerodaas.analytics.here.relay import HEAD, Channel, ChannelError
from aerodaas.analytics.wire_items import pack, unpack
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.frames import Frame, Header
from aerodaas.messages.readings import Readings
from aerodaas.messages.serialization.opaque_item import OpaqueItem
from aerodaas.messages.serialization.schema import MessageError
from aerodaas.messages.waypoints import VelocityCommand, Waypoint
from tools.fuzz.json_changes import VALUES, change_value, flip_byte

_BYTES = 0.2
"""Share of mutations that change a byte."""


def seeds() -> Iterable[bytes]:
    """Messages as the user's side and a flight send them."""
    header = Header(1, 2, "drone/cam")
    points = np.zeros((3, 3), np.float32)
    people = (Detection((0.0, 1.0, 2.0, 3.0), "person", 0.5, keypoints=points),)
    items: list[object] = [
        Detections(header, people, 64, 48),
        Readings(5, {"count": 1.0}),
        AeroNavigation(data=[Waypoint("a", 1, 2, 3, yaw=0.5), VelocityCommand(1.0)]),
        OpaqueItem("Own", {"a": 1}, b"x"),
        float("nan"),
        Frame(header, np.zeros((4, 6, 3), np.uint8), depth=np.ones((4, 6), np.uint16)),
    ]
    for item in items:
        content, blob = pack(item, lossless=True)
        yield _message({"item": content}, blob)


def run(data: bytes) -> None:
    """Receive a message and read its item."""
    ours, theirs = socket.socketpair()
    with ours, theirs:
        theirs.settimeout(0.0)
        with contextlib.suppress(BlockingIOError):
            theirs.send(data)
        theirs.close()
        try:
            content, blob = Channel(ours).receive(1.0)
        except ChannelError:
            return
    with contextlib.suppress(MessageError):
        unpack(content.get("item"), blob)


def mutate(data: bytes, rng: random.Random) -> bytes:
    """Change one value of the JSON, and one byte now and then."""
    size, _ = HEAD.unpack_from(data) if len(data) >= HEAD.size else (0, 0)
    end = HEAD.size + size
    try:
        content = json.loads(data[HEAD.size : end])
    except (ValueError, RecursionError):
        return flip_byte(data, rng)
    if rng.random() < _BYTES or not change_value(content, rng, (*VALUES, {"is": "float"})):
        return flip_byte(data, rng)
    try:
        return _message(content, data[end:])
    except (ValueError, RecursionError):  # it holds itself
        return flip_byte(data, rng)


def _message(content: Any, blob: bytes) -> bytes:  # noqa: ANN401 - JSON
    text = json.dumps(content).encode()
    return HEAD.pack(len(text), len(blob)) + text + blob
