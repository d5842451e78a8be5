"""SharedCamera: a camera of another mission in flight, by that flight's control socket."""

from __future__ import annotations

import socket
import time
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict

from aerodaas.analytics.here.channel import Channel, ChannelError
from aerodaas.analytics.wire_items import unpack
from aerodaas.cameras.base import Picture
from aerodaas.config.checked import checked
from aerodaas.config.model import EnvironmentConfig, SensorConfig, validated
from aerodaas.errors import SourceError
from aerodaas.geometry.frames import CameraModel
from aerodaas.messages.frames import Frame
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.schema import MessageError
from aerodaas.service.flights.order import Attached

__all__ = ["SharedCamera", "SharedCameraSettings", "attached_config"]

_CONNECT_SECONDS = 10.0
_ANSWER_SECONDS = 5.0
_DRIVER = "aerodaas.service.flights.shared_camera:SharedCamera"


class SharedCameraSettings(BaseModel):
    """Settings of a shared camera, which the service writes."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    control: Path
    """Control socket of the flight."""
    mission: str
    """The attached mission, with which the camera is shared."""
    stream: str
    """Full id of the camera."""


class SharedCamera:
    """Asks the flight for its newest picture, at the sensor's rate; implements `Camera`.

    The flight packs a picture only when it is asked for one, so a reader that is slow or stands
    still costs it nothing, and gets no stale one. It has ended when the flight has, or when the
    grant was withdrawn.
    """

    settings_model = SharedCameraSettings

    def __init__(self, sensor: SensorConfig, environment: EnvironmentConfig) -> None:
        """Validate the settings of `sensor`; raises ConfigError."""
        del environment
        self._settings = checked(SharedCameraSettings, sensor.settings, f"sensor {sensor.full_id}")
        self._channel: Channel | None = None
        self.model: CameraModel | None = None
        self.finished = False
        self.skipped = 0

    def open(self) -> None:
        """Ask for the camera; raises SourceError if it is not shared, or its flight is over."""
        settings = self._settings
        connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            connection.settimeout(_CONNECT_SECONDS)
            connection.connect(str(settings.control))
            self._channel = Channel(connection)
            wanted = {"for": "share", "mission": settings.mission, "stream": settings.stream}
            self._channel.send(wanted, timeout=_CONNECT_SECONDS)
            answer, _ = self._channel.receive(_CONNECT_SECONDS)
        except (OSError, ChannelError) as error:
            connection.close()
            raise SourceError(f"{settings.stream}: its flight does not answer: {error}") from None
        if "refused" in answer:
            self.close()
            raise SourceError(str(answer["refused"]))

    def capture(self, stamp: int, pose: Odometry | None) -> Picture | None:
        """Return the flight's newest picture; None if there is no new one."""
        del pose
        frame = self._next_frame()
        if frame is None:
            return None
        item, captured = frame
        self.model = item.camera
        age = time.monotonic_ns() - captured
        return Picture(item.image, max(0, stamp - age), odometry=item.odometry, depth=item.depth)

    def _next_frame(self) -> tuple[Frame, int] | None:
        """The newest frame that was not returned, and its capture by `time.monotonic_ns`."""
        if self._channel is None or self.finished:
            return None
        try:
            self._channel.send({}, timeout=_ANSWER_SECONDS)
            message, blob = self._channel.receive(_ANSWER_SECONDS)
            if not message:
                return None
            item = unpack(message.get("item"), blob)
        except ChannelError:
            self.finished = True
            return None
        except MessageError:
            self.skipped += 1
            return None
        if not isinstance(item, Frame):
            self.skipped += 1
            return None
        return item, time.monotonic_ns() - int(message["age"])

    def close(self) -> None:
        """Ask no more."""
        if self._channel is not None:
            self._channel.close()
            self._channel = None


def attached_config(
    config: EnvironmentConfig, attached: Attached, mission: str
) -> EnvironmentConfig:
    """The environment of a mission that senses only: the shared cameras, and nothing that flies.

    The vehicles' drivers and settings are left out; nobody makes a vehicle of them.
    """
    content = config.model_dump(by_alias=True)

    def shared(sensor: SensorConfig) -> dict[str, Any]:
        given = SharedCameraSettings(
            control=attached.control, mission=mission, stream=sensor.full_id
        )
        settings = given.model_dump(mode="json")
        return {**sensor.model_dump(), "driver": _DRIVER, "settings": settings}

    content["robots"] = [
        {
            **entry,
            "driver": "simulated",
            "settings": {},
            "sensors": [shared(one) for one in robot.sensors if one.full_id in attached.sensors],
        }
        for entry, robot in zip(content["robots"], config.robots, strict=True)
        if any(one.full_id in attached.sensors for one in robot.sensors)
    ]
    content["sensors"] = [shared(one) for one in config.sensors if one.full_id in attached.sensors]
    return validated(content, "the attached mission's environment")
