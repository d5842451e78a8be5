"""Export of a recording as a ROS 2 bag, in MCAP or SQLite storage."""

from __future__ import annotations

import heapq
import shutil
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from aerodaas.errors import RecordingError
from aerodaas.extensions.ros2.bags.outgoing import Lens, MessageBuilder, Outgoing
from aerodaas.extensions.ros2.topics import types
from aerodaas.extensions.ros2.topics.names import permitted_topic
from aerodaas.recording.new_file import new_file
from aerodaas.recording.pictures import DETECTIONS_SCHEMA, RecordedImage, shots
from aerodaas.recording.reader import Record, Recording

if TYPE_CHECKING:
    from rosbags.interfaces import Connection, Qos
    from rosbags.rosbag2 import Writer

__all__ = ["write_bag"]

_METADATA_VERSION: Final = 8
"""The newest that Humble reads; Jazzy reads it, too."""
_STATE = "aerodaas.VehicleState"
_CALIBRATION = "foxglove.CameraCalibration"
_TRANSFORM = "foxglove.FrameTransform"
_MOUNT = "/mount"


def write_bag(recording: Recording, folder: Path, storage: str = "mcap") -> Path:
    """Write a recording as a ROS 2 bag.

    States become odometry, transforms, battery and fix of each robot; frames compressed pictures
    with a `camera_info` of the same stamp, and depth; detections `vision_msgs`. A message's time in
    the bag is that of its recording, its header's stamp that of the measurement, both since 1970.

    Args:
        recording: An open recording of this project.
        folder: Folder of the bag, which is a folder itself, named after the file and the storage.
        storage: `mcap` or `sqlite3`, the storage plug-ins that Jazzy and Humble begin with.

    Returns:
        The bag.

    Raises:
        RecordingError: If the recording holds nothing of it, two streams would have the same topic,
            the bag exists or cannot be written.
        ConfigError: If the extra `ros` is not installed.
    """
    store = types.ros_types()
    from rosbags.rosbag2 import StoragePlugin, Writer  # noqa: PLC0415 - an extra

    path = new_file(folder / f"{recording.path.stem}_{storage}")
    conversion = _Conversion(recording.epoch_ns)
    plugin = StoragePlugin[storage.upper()]
    topics = _Topics()
    try:
        with Writer(path, version=_METADATA_VERSION, storage_plugin=plugin) as writer:
            for record, messages in conversion.all(recording):
                for message in messages:
                    connection = topics.connection(writer, message)
                    data = store.serialize_cdr(message.make(), message.type)
                    writer.write(connection, recording.epoch_ns + record.stamp, data)
            if not topics.known:
                raise RecordingError(
                    f"{recording.path} holds no states, pictures or detections for a bag"
                )
    except OSError as error:
        raise RecordingError(f"cannot write {path}: {error.strerror}") from None
    except struct.error:
        raise RecordingError(
            f"{recording.path} has times that ROS 2 cannot hold: its stamps end in the year 2038"
        ) from None
    finally:
        # Nothing that is not whole is left: a bag without its metadata opens nowhere.
        if not (path / "metadata.yaml").is_file():
            shutil.rmtree(path, ignore_errors=True)
    return path


class _Topics:
    """Connections of a bag, by topic."""

    def __init__(self) -> None:
        self.known: dict[str, tuple[str, Connection]] = {}

    def connection(self, writer: Writer, message: Outgoing) -> Connection:
        topic = permitted_topic(message.topic)
        owner, connection = self.known.get(topic, ("", None))
        if connection is None:
            connection = writer.add_connection(
                topic,
                message.type,
                typestore=types.ros_types(),
                offered_qos_profiles=[_qos(latched=topic == "/tf_static")],
            )
            self.known[topic] = message.topic, connection
        elif owner != message.topic:
            raise RecordingError(
                f"{owner} and {message.topic} would both be {topic} in ROS 2; rename one of them"
            )
        return connection


class _Conversion:
    """Converts records in the order of recording, as far as ROS 2 has messages for them."""

    def __init__(self, epoch_ns: int) -> None:
        self._build = MessageBuilder(epoch_ns)
        self._lenses: dict[str, Lens] = {}
        """Lens of each stream's camera."""
        self._converters: dict[str, Callable[[Record], Iterator[Outgoing]]] = {
            _STATE: lambda record: self._build.state(record.value, record.labels.robot),
            _CALIBRATION: self._calibration,
            _TRANSFORM: self._mount,
            DETECTIONS_SCHEMA: self._detections,
        }

    def all(self, recording: Recording) -> Iterator[tuple[Record, Iterator[Outgoing]]]:
        records = (
            (record, self._converters[record.schema](record))
            for record in recording.records(schemas=self._converters)
        )
        pictures = ((shot.record, self._picture(shot)) for shot in shots(recording))
        return heapq.merge(records, pictures, key=lambda pair: pair[0].stamp)

    def _calibration(self, record: Record) -> Iterator[Outgoing]:
        value = record.value
        matrix = [float(one) for one in value.K]
        if len(matrix) == 9:  # noqa: PLR2004 - three by three
            stream = record.topic.rpartition("/")[0]
            self._lenses[stream] = Lens((value.width, value.height), matrix)
        return iter(())

    def _mount(self, record: Record) -> Iterator[Outgoing]:
        if not record.topic.endswith(_MOUNT):
            return
        value = record.value
        place, turn = value.translation, value.rotation
        transform = self._build.transform(
            record.captured,
            value.parent_frame_id,
            value.child_frame_id,
            np.array([place.x, place.y, place.z]),
            (turn.x, turn.y, turn.z, turn.w),
        )
        yield Outgoing("/tf_static", types.TRANSFORMS, lambda: self._build.transforms(transform))

    def _picture(self, shot: RecordedImage) -> Iterator[Outgoing]:
        stream = shot.record.topic.removesuffix("/image")
        # ROS 2 has no message of its own for videos: their frames are files, too.
        picture = shot.file()
        if picture is None:
            return
        lens, depth = self._lenses.get(stream), shot.depth()
        file = picture.data, picture.format
        yield from self._build.picture(stream, shot.header, lambda: file, lens, depth)

    def _detections(self, record: Record) -> Iterator[Outgoing]:
        yield Outgoing(record.topic, types.DETECTIONS, lambda: self._build.detections(record.value))


def _qos(*, latched: bool) -> Qos:
    """Reliable; kept for those who come later where a message is published only once."""
    from rosbags.interfaces import (  # noqa: PLC0415 - an extra
        Qos,
        QosDurability,
        QosHistory,
        QosLiveliness,
        QosReliability,
        QosTime,
    )

    never = QosTime(0, 0)
    return Qos(
        history=QosHistory.KEEP_LAST,
        depth=10,
        reliability=QosReliability.RELIABLE,
        durability=QosDurability.TRANSIENT_LOCAL if latched else QosDurability.VOLATILE,
        deadline=never,
        lifespan=never,
        liveliness=QosLiveliness.AUTOMATIC,
        liveliness_lease_duration=never,
        avoid_ros_namespace_conventions=False,
    )
