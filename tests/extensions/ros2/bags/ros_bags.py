"""ROS 2 bags as others write them, by the library `rosbags` itself."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer

from aerodaas.extensions.ros2.bags.outgoing import MessageBuilder
from aerodaas.extensions.ros2.topics.types import ros_types
from aerodaas.messages.odometry import Odometry

EPOCH = 1_750_000_000_000_000_000
SECOND = 1_000_000_000
TYPES = ros_types()


class Sent(NamedTuple):
    """A message of a bag; one that is bytes already stays as it is."""

    topic: str
    time: int
    """Nanoseconds since 1970."""
    value: Any
    kind: str = ""


def write(path: Path, sent: Iterable[Sent], storage: str = "MCAP") -> Path:
    """Write a bag."""
    with Writer(path, version=8, storage_plugin=StoragePlugin[storage]) as writer:
        connections: dict[str, Any] = {}
        for one in sent:
            kind = one.kind or one.value.__msgtype__
            if one.topic not in connections:
                connections[one.topic] = writer.add_connection(one.topic, kind, typestore=TYPES)
            raw = one.value if one.kind else TYPES.serialize_cdr(one.value, kind)
            writer.write(connections[one.topic], one.time, raw)
    return path


def read(path: Path) -> dict[str, list[tuple[int, Any]]]:
    """All messages of a bag by topic, read by the library with the definitions in the bag."""
    found: dict[str, list[tuple[int, Any]]] = {}
    with AnyReader([path]) as reader:
        for connection, time, raw in reader.messages():
            value = reader.deserialize(raw, connection.msgtype)
            found.setdefault(connection.topic, []).append((time, value))
    return found


def odometry(index: int, *, frame: str = "map", late: int = 0) -> Sent:
    """A vehicle that climbs at 1 m/s, ten times a second."""
    stamp = index * SECOND // 10
    value = Odometry(np.array([1.0, 2.0, index / 10]), np.array([0.0, 0.0, 1.0]), 0.5)
    message = MessageBuilder(EPOCH).odometry(value, stamp, "drone")
    message.header.frame_id = frame
    return Sent("/odom", EPOCH + stamp + late, message)
