"""Camera node: publishes a camera's images as a stream of frames."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from aerodaas.cameras.base import (
    Camera,
    GimballedCamera,
    Picture,
    VehicleAddressedCamera,
    ZoomingCamera,
)
from aerodaas.clock import NANOSECONDS, Clock, host_time_ns
from aerodaas.config.model import SensorConfig
from aerodaas.config.plugins import load_plugin
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Frame, Header
from aerodaas.messages.vehicle import VehicleState
from aerodaas.mission.commands import End
from aerodaas.runtime.node import NEVER, Host, Node
from aerodaas.runtime.session import Session
from aerodaas.runtime.stream_names import end_stream

__all__ = ["CameraNode"]

T = TypeVar("T", bound=np.generic)


class CameraNode(Node):
    """Publishes a camera's newest image as a Frame at the sensor's rate."""

    waits_for_inputs = False

    def __init__(
        self, session: Session, stream: str, sensor: SensorConfig, state: str, *, ends: bool
    ) -> None:
        """Load the camera's plug-in.

        Args:
            session: The run.
            stream: Name of the stream of frames.
            sensor: The camera's settings.
            state: Stream of the vehicle states from which frames get their odometry.
            ends: Whether the mission ends when the camera has no more images.
        """
        super().__init__(stream, {state: 1})
        self.ends = ends
        self._session = session
        self._sensor = sensor
        plugin = load_plugin("cameras", session.environment.camera_driver(sensor))
        self.camera: Camera = plugin(sensor, session.environment)
        self._frames = self.outlet(stream)
        self._commands = self.outlet(end_stream(stream))
        self._opened = False
        self._ended = False
        self._due = NEVER
        self._vehicle: VehicleState | None = None

    def open(self, host: Host) -> None:
        """Open the camera; raises SourceError if it cannot be opened."""
        super().open(host)
        self._opened = True
        self.camera.open()
        self._told_camera = self.camera if isinstance(self.camera, VehicleAddressedCamera) else None
        self._gimballed = self.camera if isinstance(self.camera, GimballedCamera) else None
        self._zooming = self.camera if isinstance(self.camera, ZoomingCamera) else None

    def start(self, clock: Clock) -> Sequence[Message[Any]]:
        """Begin at the first time at which the sensor is due."""
        self._due = self._next_due(clock.now() - 1)
        return ()

    @property
    def due(self) -> int:
        """Mission time of the next image."""
        return self._due

    def step(self, now: int, inputs: Sequence[Message[Any]]) -> Sequence[Message[Any]]:
        """Capture an image if one is due.

        Args:
            now: Mission clock, nanoseconds.
            inputs: New messages, each stream's in order.
        """
        for message in inputs:
            if isinstance(message.item, VehicleState):
                self._vehicle = message.item
                if self._told_camera is not None:
                    self._told_camera.follow_video(message.item.video)
        if now < self._due:
            return ()
        self._due = self._next_due(now)
        return self._capture(now)

    def _next_due(self, after: int) -> int:
        return self._session.next_due(self.name, self._sensor.rate, after)

    def _capture(self, stamp: int) -> list[Message[Any]]:
        vehicle = self._vehicle
        if self._gimballed is not None and vehicle is not None:
            self._gimballed.follow_gimbal(vehicle.gimbal)
        if self._zooming is not None and vehicle is not None:
            self._zooming.follow_zoom(vehicle.zoom)
        picture = self.camera.capture(stamp, vehicle.truth if vehicle else None)
        captured = host_time_ns()
        published: list[Message[Any]] = []
        if picture is not None:
            # A live camera's image is already some milliseconds old.
            age = self._session.host_seconds(max(0, stamp - picture.stamp))
            frame = self._frame(picture)
            before = captured - int(age * NANOSECONDS)
            published.append(self._frames.measure(frame, frame.header, before))
        if self.finished and self.ends and not self._ended:
            self._ended = True
            end = End(f"{self.name} has no more pictures")
            published.append(self._commands.measure(end, Header(0, stamp, self.name), captured))
        return published

    def _frame(self, picture: Picture) -> Frame:
        header = Header(self._frames.sent, picture.stamp, self.name)
        odometry = picture.odometry
        if odometry is None and self._vehicle is not None:
            odometry = self._vehicle.odometry
        depth = None if picture.depth is None else _read_only(picture.depth)
        return Frame(header, _read_only(picture.image), self.camera.model, odometry, depth)

    @property
    def finished(self) -> bool:
        """Whether the camera has no more images."""
        return self.camera.finished

    def close(self) -> None:
        """Close the camera."""
        if self._opened:
            self._opened = False
            self.camera.close()

    def values(self) -> dict[str, Any]:
        """Images that were skipped, and whether there are no more, by camera."""
        if not self._opened:
            return {}
        return {
            "skipped": {self.name: self.camera.skipped},
            "finished": {self.name: self.finished},
        }


def _read_only(pixels: NDArray[T]) -> NDArray[T]:
    """A view that cannot be written to: every reader of a frame is given the same pixels."""
    view = pixels.view()
    view.flags.writeable = False
    return view
