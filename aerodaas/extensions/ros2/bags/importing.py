"""A ROS 2 bag written as a recording, which replays, plays in the console and has reports."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from aerodaas.cameras.images import decode_image, picture_bytes
from aerodaas.cameras.picture_size import picture_fits, picture_format, picture_size
from aerodaas.cameras.settings import camera_model
from aerodaas.clock import NANOSECONDS
from aerodaas.config.checked import checked
from aerodaas.config.model import (
    CameraConfig,
    EnvironmentConfig,
    LimitsConfig,
    RecordingConfig,
    validated,
)
from aerodaas.config.redaction import public_document
from aerodaas.errors import AeroDaaSError, RecordingError, SourceError
from aerodaas.extensions.ros2.bags.bag import BagMessage, RosBag
from aerodaas.extensions.ros2.bags.bag_preview import BagPreview, BagTopics
from aerodaas.extensions.ros2.topics import types
from aerodaas.extensions.ros2.topics.incoming import (
    battery_of,
    fix_of,
    odometry_of,
)
from aerodaas.geometry.frames import CameraModel
from aerodaas.identifiers import internal
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Frame, Header
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.vehicle import VehicleMode, VehicleState
from aerodaas.recording.converters.images import EncodedFrame
from aerodaas.recording.output import RecordingSummary
from aerodaas.recording.provenance import Provenance, package_versions
from aerodaas.recording.recorder import FlightRecorder

__all__ = ["ImportedBag", "import_bag"]

_PREFLIGHT = NANOSECONDS
"""Time on the ground that a mission has for its checks before it takes off."""
_MOVING = 0.2
"""Metres a second."""
_LIFTED = 0.15
"""Metres."""


@dataclass(frozen=True, slots=True)
class ImportedBag:
    """Result of an import."""

    summary: RecordingSummary
    skipped: Mapping[str, tuple[int, str]]
    """How many messages were not taken, and why the first was not, by topic."""
    damaged: int
    """Messages and chunks of the bag that could not be read."""
    complete: bool
    """Whether the bag's files were closed properly, and not cut off."""
    lenses: Mapping[str, bool]
    """Whether the bag told of each camera's lens, by the camera's id."""


def import_bag(
    bag: RosBag, topics: BagTopics, path: Path, images: RecordingConfig | None = None
) -> ImportedBag:
    """Write topics of a bag as a recording.

    Headers' stamps become the times of capture, the bag's own those of recording. Odometry becomes
    the vehicle's state and the sensor `odometry`, fix and battery the sensors `gps` and `battery`.
    Compressed pictures are kept as they are, raw ones are encoded. The recorded environment has
    the cameras with lens and mount as far as the bag tells, and a home where there is a fix.

    Args:
        bag: An open bag.
        topics: What to take.
        path: The new MCAP file.
        images: How raw pictures are encoded; None for JPEG.

    Returns:
        Figures of the recording, and what was left out.

    Raises:
        RecordingError: If the topics do not fit the bag, its odometry is not in ENU, nothing of it
            can be read, or the file exists or cannot be written.
        ConfigError: If the extra `ros` is not installed, or an id is none.
    """
    types.ros_types()
    if not bag.topics:
        raise RecordingError(f"{bag.path} holds no whole message: it is empty, or was cut off")
    topics.check(bag.topics)
    preview = BagPreview(bag, topics)
    environment = _environment(bag.path, preview)
    # No revision: it is that of an application.
    provenance = Provenance(
        started_ns=preview.epoch_ns,
        name=bag.path.stem,
        config=public_document(environment),
        versions=package_versions(),
    )
    config = images or RecordingConfig()
    try:
        with FlightRecorder(
            path, config=config, provenance=provenance, home=preview.home
        ) as recorder:
            work = _Import(preview, recorder)
            work.run(bag)
            if not work.taken:
                raise RecordingError(f"nothing of {bag.path} could be read: {_why(bag, work)}")
            summary = recorder.close()
    except AeroDaaSError:
        path.unlink(missing_ok=True)
        raise
    lenses = {
        camera: "horizontal_fov" in preview.camera(topic) for camera, topic in topics.camera.items()
    }
    return ImportedBag(summary, work.skipped, bag.damaged, bag.complete, lenses)


def _why(bag: RosBag, work: _Import) -> str:
    reasons = [f"{topic}: {reason}" for topic, (_, reason) in work.skipped.items()]
    return "; ".join(reasons) or f"{bag.damaged} messages or chunks are broken"


class _Import:
    """One pass over the bag, message by message."""

    def __init__(self, preview: BagPreview, recorder: FlightRecorder) -> None:
        self.skipped: dict[str, tuple[int, str]] = {}
        self.taken = 0
        self._preview = preview
        self._recorder = recorder
        topics = self._topics = preview.topics
        self._streams = {one.topic: f"{topics.robot}/{one.name}" for one in topics.taken()}
        self._models: dict[str, CameraModel | None] = {}
        self._sequences: Counter[str] = Counter()
        self._newest: dict[str, int] = {}
        self._odometry: Odometry | None = None
        self._battery = preview.battery
        self._fix = preview.fix
        self._flying = False
        self._ground: float | None = None
        """Height at which it stood first, metres."""

    def run(self, bag: RosBag) -> None:
        """Read all and write what is whole."""
        takers: dict[str, Callable[[BagMessage, int, int], None]] = {
            "camera": self._picture,
            "odometry": self._state,
            "gps": self._gps,
            "battery": self._charge,
        }
        uses = {one.topic: takers[one.use] for one in self._topics.taken()}
        epoch = self._preview.epoch_ns
        for message in bag.messages(uses.keys()):
            try:
                captured, recorded = self._preview.times(message)
                if captured <= self._newest.get(message.topic, captured - 1):
                    raise ValueError("it is not newer than the one before")  # noqa: TRY301
                uses[message.topic](message, captured - epoch, recorded - epoch)
            except (ValueError, SourceError) as error:
                count, reason = self.skipped.get(message.topic, (0, str(error)))
                self.skipped[message.topic] = count + 1, reason
                continue
            self._newest[message.topic] = captured
            self.taken += 1

    def _state(self, message: BagMessage, captured: int, recorded: int) -> None:
        self._odometry = odometry_of(message.value)
        robot = self._topics.robot
        self._flying = self._flying or self._takes_off(self._odometry, captured)
        mode = VehicleMode.GUIDED if self._flying else VehicleMode.GROUNDED
        state = VehicleState(
            captured, self._odometry, self._battery, mode, armed=self._flying, gps=self._fix
        )
        self._write(internal(robot, "state"), Header(0, captured, robot), recorded, state)
        self._reading(message, captured, recorded, self._odometry)

    def _takes_off(self, odometry: Odometry, captured: int) -> bool:
        """Whether the vehicle moves at last. No topic says how it is flown, or that it landed."""
        if self._ground is None:
            self._ground = odometry.height
        moves = float(np.linalg.norm(odometry.velocity)) > _MOVING
        return captured >= _PREFLIGHT and (moves or odometry.height > self._ground + _LIFTED)

    def _gps(self, message: BagMessage, captured: int, recorded: int) -> None:
        self._fix = fix_of(message.value)
        self._reading(message, captured, recorded, self._fix)

    def _charge(self, message: BagMessage, captured: int, recorded: int) -> None:
        self._battery = battery_of(message.value)
        self._reading(message, captured, recorded, self._battery)

    def _reading(self, message: BagMessage, captured: int, recorded: int, item: object) -> None:
        stream = self._streams[message.topic]
        self._write(stream, Header(self._sequences[stream], captured, stream), recorded, item)

    def _picture(self, message: BagMessage, captured: int, recorded: int) -> None:
        stream = self._streams[message.topic]
        header = Header(self._sequences[stream], captured, stream)
        item = self._frame(message, header)
        self._write(stream, header, recorded, item)

    def _frame(self, message: BagMessage, header: Header) -> Frame | EncodedFrame:
        value = message.value
        if not hasattr(value, "encoding"):
            data = picture_bytes(value)
            size, kind = picture_size(data), picture_format(data)
            if size is None or kind is None or not picture_fits(*size):
                raise ValueError(f"no JPEG, PNG or WebP of a bearable size ({value.format!r:.40})")
            camera = self._model(message.topic, *size)
            return EncodedFrame(header, data, kind, *size, camera, self._odometry)
        image = decode_image(types.IMAGE, value)
        if image is None:
            raise ValueError("a broken picture, or one of unbearable size")
        camera = self._model(message.topic, image.shape[1], image.shape[0])
        return Frame(header, image, camera, self._odometry)

    def _model(self, topic: str, width: int, height: int) -> CameraModel | None:
        known = self._models.get(topic)
        if topic not in self._models or (known and (known.width, known.height) != (width, height)):
            settings = self._preview.camera(topic)
            self._models[topic] = None
            if "horizontal_fov" in settings:
                lens = checked(CameraConfig, settings, f"the camera on {topic}")
                self._models[topic] = camera_model(lens, width, height)
        return self._models[topic]

    def _write(self, stream: str, header: Header, recorded: int, item: object) -> None:
        sequence = self._sequences[stream]
        self._sequences[stream] += 1
        self._recorder.write(Message(stream, sequence, recorded, header, 0, (), item))


def _environment(path: Path, preview: BagPreview) -> EnvironmentConfig:
    """The environment that a run with these sensors would have had."""
    topics = preview.topics
    sensors: list[dict[str, Any]] = []
    for use, name, topic in topics.taken():
        sensor: dict[str, Any] = {"id": name, "type": use}
        rate = preview.rate(topic)
        if rate is not None:
            sensor["rate"] = rate
        if use == "camera":
            sensor |= {"driver": "mcap", "settings": preview.camera(topic)}
        sensors.append(sensor)
    # The bag may begin in the air, above which nothing has to be reached for a take-off.
    limits = {"takeoff_height": LimitsConfig().arrival_radius}
    robot = {"id": topics.robot, "sensors": sensors, "limits": limits}
    content: dict[str, Any] = {"robots": [robot]}
    home = preview.home
    if home is not None:
        content["home"] = {
            "latitude": home.latitude,
            "longitude": home.longitude,
            "altitude": home.altitude,
        }
    return validated(content, f"the environment of {path}")
