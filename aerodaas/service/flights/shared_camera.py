"""SharedCamera: a camera of another mission in flight, by the API of that flight's process."""

from __future__ import annotations

import json
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError
from websockets.exceptions import InvalidStatus, WebSocketException
from websockets.sync.client import ClientConnection, unix_connect

from aerodaas.analytics.wire_items import unpack
from aerodaas.cameras.base import Picture
from aerodaas.config.checked import checked
from aerodaas.config.model import EnvironmentConfig, SensorConfig, validated
from aerodaas.errors import SourceError
from aerodaas.geometry.frames import CameraModel
from aerodaas.messages.frames import Frame
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.serialization.schema import MessageError
from aerodaas.protocol.schemas import RefusalOut, Role
from aerodaas.service.flights.link import flight_address
from aerodaas.service.flights.orders import HostFlight

__all__ = ["SharedCamera", "SharedCameraSettings", "attached_config"]

_ANSWER_SECONDS = 5.0
_DRIVER = "aerodaas.service.flights.shared_camera:SharedCamera"


class SharedCameraSettings(BaseModel):
    """Settings of a shared camera, which the service writes."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    socket: Path
    """Unix socket at which the flight's process serves the API."""
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
        self._connection: ClientConnection | None = None
        self._stack = ExitStack()
        self.model: CameraModel | None = None
        self.finished = False
        self.skipped = 0

    def open(self) -> None:
        """Ask for the camera; raises SourceError if it is not shared, or its flight is over."""
        settings = self._settings
        try:
            path = f"shares/{settings.mission}"
            address = flight_address(path, Role.VIEWER, stream=settings.stream)
            connected = unix_connect(str(settings.socket), **address)
            self._connection = self._stack.enter_context(connected)
        except InvalidStatus as error:
            try:
                said = RefusalOut.model_validate_json(error.response.body or b"").text
            except ValidationError:
                said = f"{settings.stream}: its flight refuses it: {error}"
            raise SourceError(said) from None
        except (OSError, EOFError, WebSocketException) as error:
            raise SourceError(f"{settings.stream}: its flight does not answer: {error}") from None

    def capture(self, stamp: int, pose: Odometry | None) -> Picture | None:
        """Return the flight's newest picture; None if there is no new one.

        Args:
            stamp: Mission clock, nanoseconds; the picture's age is subtracted.
            pose: Ignored.
        """
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
        if self._connection is None or self.finished:
            return None
        try:
            self._connection.send("")
            message = json.loads(self._connection.recv(_ANSWER_SECONDS))
            if not message:
                return None
            blob = self._connection.recv(_ANSWER_SECONDS) if message.get("blob") else b""
            item = unpack(message.get("item"), blob if isinstance(blob, bytes) else b"")
        except (OSError, EOFError, WebSocketException):
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
        self._stack.close()
        self._connection = None


def attached_config(
    config: EnvironmentConfig, attached: HostFlight, mission: str
) -> EnvironmentConfig:
    """The environment of a mission that senses only: the shared cameras, and nothing that flies.

    The vehicles' drivers and settings are left out; nobody makes a vehicle of them.

    Args:
        config: The provider's environment.
        attached: The flight whose cameras are shared.
        mission: Id of the attached mission.
    """
    content = config.model_dump(by_alias=True)

    def shared(sensor: SensorConfig) -> dict[str, Any]:
        given = SharedCameraSettings(socket=attached.socket, mission=mission, stream=sensor.full_id)
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
