"""TelloCamera: the newest frame of a Tello's video, with its age."""

from __future__ import annotations

import logging
import socket
import threading
from dataclasses import dataclass

from av.packet import Packet
from av.video.frame import VideoFrame

from aerodaas.cameras.base import Picture
from aerodaas.cameras.h264 import FrameAssembler, FrameDecoder, bgr_image
from aerodaas.cameras.settings import camera_model
from aerodaas.clock import host_time_ns
from aerodaas.config.model import EnvironmentConfig, RobotConfig, SensorConfig
from aerodaas.drivers.pin import Pin
from aerodaas.drivers.waiting import wait_readable
from aerodaas.errors import ConfigError, SourceError
from aerodaas.extensions.tello.link import bound_socket, datagrams
from aerodaas.extensions.tello.settings import (
    TelloCameraSettings,
    tello_camera_settings,
    tello_settings,
)
from aerodaas.geometry.frames import CameraModel
from aerodaas.messages.odometry import Odometry

__all__ = ["TelloCamera", "VideoCounts"]

_log = logging.getLogger(__name__)

_BUFFER = 1 << 20
"""Bytes of the socket's receive buffer: two seconds of video, to lose none while stalled."""
_LISTEN = 0.2
"""Seconds between checks for the end."""
_LARGEST_PICTURE = 1920 * 1088
"""Pixels: a Tello's pictures have 960 x 720 or 1280 x 720."""
_QUIET = 3.0
"""Seconds without video after which an alert is due."""


@dataclass(slots=True)
class VideoCounts:
    """Counters of the video stream."""

    frames: int = 0
    """Images decoded."""
    overtaken: int = 0
    """Images replaced by a newer one before they were read: no loss, as the camera is read at its
    own rate."""
    broken: int = 0
    """Frames that could not be decoded, or only with damage."""
    waiting: int = 0
    """Frames skipped while waiting for a key frame."""
    dropped: int = 0
    """Packets that belong to no frame."""
    strangers: int = 0
    """Packets of other addresses and ports."""


class TelloCamera:
    """The camera of a robot whose driver is `tello`; implements `aerodaas.cameras.base.Camera`.

    Packets are received and decoded in a thread of their own, and only the newest picture is kept;
    its stamp is that of the arrival of its first packet. The robot's own driver switches the
    stream on and takes the settings of address and interface; the camera only listens.

    Settings: those of `TelloCameraSettings`. Raises ConfigError if the sensor does not belong to a
    robot whose driver is `tello`.
    """

    settings_model = TelloCameraSettings

    def __init__(self, sensor: SensorConfig, environment: EnvironmentConfig) -> None:
        """Check the settings; nothing is opened yet."""
        self._name = sensor.id
        self._settings = tello_camera_settings(sensor)
        self._robot = tello_settings(_carrier(sensor, environment))
        self.counts = VideoCounts()
        self._model: CameraModel | None = None
        self._pin = Pin("the Tello", lambda: True)
        self._assembler = FrameAssembler()
        self._decoder = FrameDecoder(
            only_whole=self._settings.only_whole, most_pixels=_LARGEST_PICTURE
        )
        self._lock = threading.Lock()
        self._newest: tuple[VideoFrame, int] | None = None
        self._closing = threading.Event()
        self._thread: threading.Thread | None = None

    @property
    def model(self) -> CameraModel | None:
        """Calibration for the size of the newest image; None before the first."""
        return self._model

    @property
    def finished(self) -> bool:
        """False: video that stops may resume."""
        return False

    @property
    def skipped(self) -> int:
        """Frames that could not be decoded, or rest on one that could not."""
        return self.counts.broken + self.counts.waiting

    def open(self) -> None:
        """Listen for video; raises SourceError if the port is taken.

        The first picture comes with the next key frame, a second or so later.
        """
        self._socket = bound_socket(
            f"{self._name}, video",
            self._settings.video_port,
            address=self._robot.local_address,
            interface=self._robot.interface,
            receive_buffer=_BUFFER,
            raises=SourceError,
        )
        self._closing.clear()
        self._thread = threading.Thread(target=self._run, name=f"{self._name}-video", daemon=True)
        self._thread.start()

    def capture(self, stamp: int, pose: Odometry | None) -> Picture | None:
        """Return the newest image; None without a new one.

        Args:
            stamp: Mission clock, nanoseconds; the image's age is subtracted.
            pose: Ignored.
        """
        del pose
        with self._lock:
            newest, self._newest = self._newest, None
        if newest is None:
            return None
        frame, arrived = newest
        image = bgr_image(frame)
        height, width = image.shape[:2]
        if self._model is None or (self._model.width, self._model.height) != (width, height):
            self._model = camera_model(self._settings, width, height)
        return Picture(image, max(0, stamp - (host_time_ns() - arrived)))

    def close(self) -> None:
        """Stop listening and free the port."""
        self._closing.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
            self._socket.close()

    def _run(self) -> None:
        quiet_since, told = host_time_ns(), False
        while not self._closing.is_set():
            wait_readable([self._socket.fileno()], _LISTEN)
            now = host_time_ns()
            arrived = self._from_tello(self._socket)
            if arrived:
                quiet_since, told = now, False
            elif not told and now - quiet_since > _QUIET * 1e9:
                told = True
                _log.warning("%s", self._why_quiet())
            for packet in arrived:
                self.on_packet(packet, now)

    def on_packet(self, packet: bytes, now: int) -> None:
        """Process a video packet of the Tello.

        Args:
            packet: Its bytes.
            now: When it was received, host nanoseconds.
        """
        decoder = self._decoder
        for whole in self._assembler.add_packet(packet, now):
            for picture in decoder.decode(Packet(whole.content)):
                self._show(picture, whole.arrived)
        counts = self.counts
        counts.broken, counts.waiting = decoder.broken, decoder.waiting
        counts.dropped = self._assembler.dropped

    def _from_tello(self, source: socket.socket) -> list[bytes]:
        packets = []
        now = host_time_ns() / 1e9
        for content, address, port in datagrams(source):
            if address == self._robot.address and self._pin.admits((address, port), now):
                packets.append(content)
            else:
                self.counts.strangers += 1
        return packets

    def _show(self, picture: VideoFrame, arrived: int) -> None:
        with self._lock:
            self.counts.frames += 1
            self.counts.overtaken += self._newest is not None
            self._newest = (picture, arrived)

    def _why_quiet(self) -> str:
        port = self._settings.video_port
        if self.counts.strangers:
            return (
                f"{self._name}: no video from {self._robot.address}, but {self.counts.strangers} "
                f"packets from elsewhere came to UDP port {port}: set the Tello's address"
            )
        return (
            f"{self._name}: no video at UDP port {port} for {_QUIET:g} s; is the Tello connected, "
            f"and the firewall open (`sudo ufw allow {port}/udp`)?"
        )


def _carrier(sensor: SensorConfig, environment: EnvironmentConfig) -> RobotConfig:
    for robot in environment.robots:
        if robot.driver == "tello" and robot.id == sensor.robot:
            return robot
    raise ConfigError(
        f'sensor {sensor.full_id}: the driver "tello" is for a sensor of a robot whose driver is '
        '"tello", which switches its video on'
    )
