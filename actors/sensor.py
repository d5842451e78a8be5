"""Sensor actor: publishes a camera's images as a stream of frames."""

from __future__ import annotations

from typing import Any

from aerodaas.actors.base import ActorInfo, StreamActor
from aerodaas.cameras.base import (
    Camera,
    GimballedCamera,
    Picture,
    PlacingCamera,
    ToldCamera,
    ZoomingCamera,
    most_memory,
)
from aerodaas.config.model import SensorConfig
from aerodaas.config.plugins import load_plugin
from aerodaas.mission.commands import End
from aerodaas.runtime.reports import StreamCount
from aerodaas.runtime.session import Session, next_due
from aerodaas.runtime.stream_names import end_stream
from aerodaas.types.clock import NANOSECONDS, host_time_ns
from aerodaas.types.data import Frame, Header
from aerodaas.types.memory_limit import limit_memory
from aerodaas.types.status import Message
from aerodaas.types.vehicle import VehicleState

__all__ = ["SensorActor"]


class SensorActor(StreamActor):
    """Actor that publishes a camera's newest image as a Frame at the sensor's rate."""

    niceness = 5
    state_depth = 1
    """Queue depth of the vehicle's states, of which the newest is used."""

    def __init__(self, session: Session, stream: str, sensor: SensorConfig, state: str) -> None:
        """Publish `stream` from `sensor`, with odometry from the vehicle states of `state`."""
        super().__init__(session, f"sensor/{stream}", {state: self.state_depth})
        self._stream = stream
        self._sensor = sensor
        self._ends = False
        self._ended = False
        self._vehicle: VehicleState | None = None

    def prepare(self, ends: bool = False) -> ActorInfo:  # noqa: FBT001, FBT002 - Ray's
        """Open the camera; with `ends`, the mission ends when it has no more images."""
        self._ends = ends
        return super().prepare()

    def end_mission_when_finished(self, ends: bool) -> None:  # noqa: FBT001
        """Change `ends`, as in `prepare`."""
        self._ends = ends

    def _open(self) -> None:
        environment = self.session.environment
        plugin = load_plugin("cameras", environment.camera_driver(self._sensor))
        self._camera: Camera = plugin(self._sensor, environment)
        most = most_memory(self._camera)
        if most is not None:
            limit_memory(most)
        self._camera.open()
        self._told_camera = self._camera if isinstance(self._camera, ToldCamera) else None
        self._gimballed = self._camera if isinstance(self._camera, GimballedCamera) else None
        self._zooming = self._camera if isinstance(self._camera, ZoomingCamera) else None
        self._frames = self.publisher(self._stream)
        if isinstance(self._camera, PlacingCamera):
            self._camera.place_in(self._frames.picture_memory)
        self._commands = self.publisher(end_stream(self._stream))

    def _run(self) -> None:
        assert self.subscriber is not None  # noqa: S101 - set by prepare
        due = next_due(self._sensor.rate, self.clock.now())
        while not self.stopping:
            self.clock.sleep_until(due)
            for message in self.subscriber.receive(0.0):
                self._take(message)
            now = self.clock.now()
            self._capture(now)
            due = next_due(self._sensor.rate, now)

    def counts(self) -> dict[str, StreamCount]:
        """Empty: only the newest vehicle state is used, so dropped ones are intended."""
        return {}

    def _take(self, message: Message[Any]) -> None:
        self.follow(message.stamp)
        if isinstance(message.item, VehicleState):
            self._vehicle = message.item
            if self._told_camera is not None:
                self._told_camera.follow_video(message.item.video)

    def _capture(self, stamp: int) -> None:
        vehicle = self._vehicle
        if self._gimballed is not None and vehicle is not None:
            self._gimballed.follow_gimbal(vehicle.gimbal)
        if self._zooming is not None and vehicle is not None:
            self._zooming.follow_zoom(vehicle.zoom)
        picture = self._camera.capture(stamp, vehicle.truth if vehicle else None)
        taken = host_time_ns()
        # Before the frame: mission time may wait for the frame's readers, and then advance.
        if self._camera.finished and self._ends and not self._ended:
            self._ended = True
            header = Header(0, stamp, self._stream)
            self._commands.measure(End(f"{self._stream} has no more pictures"), header, taken)
        self._publish(picture, stamp, taken)

    def _publish(self, picture: Picture | None, stamp: int, taken: int) -> None:
        """Publish an image captured at mission time `stamp` and host time `taken`, if there is one.

        A live camera's image is already some milliseconds old.
        """
        if picture is not None:
            age = self.session.host_seconds(max(0, stamp - picture.stamp))
            frame = self._frame(picture)
            self._frames.measure(frame, frame.header, taken - int(age * NANOSECONDS))

    def _frame(self, picture: Picture) -> Frame:
        header = Header(self._frames.sent, picture.stamp, self._stream)
        odometry = picture.odometry
        if odometry is None and self._vehicle is not None:
            odometry = self._vehicle.odometry
        return Frame(header, picture.image, self._camera.model, odometry, picture.depth)

    def _close(self) -> None:
        self._camera.close()

    def _values(self) -> dict[str, Any]:
        if self._phase == "new":
            return {}
        return {"skipped": self._camera.skipped, "finished": self._camera.finished}
