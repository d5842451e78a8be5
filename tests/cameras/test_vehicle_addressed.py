"""Video whose address the vehicle tells: read only where asked for, and never from a file."""

from __future__ import annotations

import contextlib
import socket
import threading
import time
from pathlib import Path

import cv2
import numpy as np
import pytest

from aerodaas.cameras.base import VehicleAddressedCamera, most_memory
from aerodaas.cameras.live import LiveSource
from aerodaas.cameras.vehicle_addressed import VehicleAddressedSource
from aerodaas.cameras.video import VideoCamera
from aerodaas.config.model import EnvironmentConfig, RobotConfig, SensorConfig
from aerodaas.config.secrets import SecretUrl


@pytest.fixture
def film(tmp_path: Path) -> Path:
    """A short film on this machine."""
    path = tmp_path / "secret.ts"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), 10, (64, 48))
    if not writer.isOpened():
        pytest.skip("OpenCV cannot write a film here")
    for shade in range(20):
        writer.write(np.full((48, 64, 3), shade * 10, np.uint8))
    writer.release()
    return path


def serve(content: bytes) -> int:
    """Give `content` to everybody who connects to a port of loopback."""
    server = socket.create_server(("127.0.0.1", 0))

    def run() -> None:
        while True:
            peer, _ = server.accept()
            with contextlib.suppress(OSError), peer:
                peer.sendall(content)

    threading.Thread(target=run, daemon=True).start()
    return int(server.getsockname()[1])


def frames(source: LiveSource | VehicleAddressedSource, duration: float) -> int:
    """How many frames came within that time."""
    end, count = time.monotonic() + duration, 0
    while time.monotonic() < end and not count:
        count += source.newest(10**12) is not None
        time.sleep(0.02)
    return count


def camera(path: str, driver: str = "mavlink") -> VideoCamera:
    """A camera of a robot with that driver."""
    sensor = SensorConfig(id="cam", type="camera", driver=driver, rate=10, settings={"path": path})
    robot = RobotConfig(id="drone", driver="mavlink", sensors=[sensor])
    environment = EnvironmentConfig(robots=[robot])
    return VideoCamera(environment.robots[0].sensors[0], environment)


def test_the_first_address_is_read_and_no_other(film: Path) -> None:
    """A vehicle does not send its watcher from one address to the next."""
    port = serve(film.read_bytes())
    told = camera("mavlink")
    assert isinstance(told, VehicleAddressedCamera)
    assert most_memory(told) == LiveSource.most_memory
    told.open()
    assert told.model is None
    assert told.capture(0, None) is None
    told.follow_video("")
    told.follow_video(f"tcp://127.0.0.1:{port}")
    told.follow_video("tcp://127.0.0.1:1")
    source = told._source
    assert isinstance(source, VehicleAddressedSource)
    assert frames(source, 8.0)
    told.close()


def test_a_camera_with_a_path_of_its_own_is_not_told() -> None:
    """Nothing is connected to."""
    own = camera("rtsp://127.0.0.1:1/live")
    own.follow_video("tcp://127.0.0.1:1")
    assert isinstance(own._source, LiveSource)
    assert own._source._thread is None


def test_a_stream_does_not_lead_to_a_file(film: Path) -> None:
    """A playlist may name any address: those of a told one are of the network alone."""
    playlist = (
        "#EXTM3U\n#EXT-X-TARGETDURATION:2\n#EXT-X-MEDIA-SEQUENCE:0\n"
        f"#EXTINF:2.0,\nfile://{film}\n#EXT-X-ENDLIST\n"
    )
    address = f"tcp://127.0.0.1:{serve(playlist.encode())}/live.m3u8"
    free = LiveSource(SecretUrl(address))
    free.start()
    assert frames(free, 8.0)
    free.close()
    told = VehicleAddressedSource("drone/cam")
    told.follow(address)
    assert not frames(told, 1.5)
    told.close()
