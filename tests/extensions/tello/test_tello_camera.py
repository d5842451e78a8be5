"""The Tello's camera: real H.264 over loopback, whole or broken, and always the newest frame."""

from __future__ import annotations

import random
import socket
import time
from fractions import Fraction

import av
import numpy as np
import pytest
from av.packet import Packet
from hypothesis import given, settings
from hypothesis import strategies as st

from aerodaas.cameras.base import Camera
from aerodaas.cameras.h264 import FrameAssembler, FrameDecoder
from aerodaas.config.model import EnvironmentConfig, RobotConfig, SensorConfig
from aerodaas.errors import ConfigError, SourceError
from aerodaas.extensions.tello.camera import TelloCamera
from tools.tello_vehicle.video import packets

pytestmark = pytest.mark.wall_clock

WIDTH, HEIGHT = 320, 240
PERIOD = 10
ADDRESS = "127.0.0.1"


def _encode(count: int) -> list[bytes]:
    """A moving gradient with a key frame every `PERIOD`."""
    encoder = av.CodecContext.create("libx264", "w")
    encoder.width, encoder.height, encoder.pix_fmt = WIDTH, HEIGHT, "yuv420p"
    encoder.time_base, encoder.gop_size, encoder.thread_count = Fraction(1, 30), PERIOD, 1
    encoder.bit_rate = 2_000_000
    encoder.options = {
        "preset": "ultrafast",
        "tune": "zerolatency",
        "x264-params": "repeat-headers=1:sliced-threads=0:slices=1:scenecut=0",
    }
    wall = np.random.default_rng(0).integers(0, 256, (HEIGHT, 2 * WIDTH, 3), np.uint8)
    encoded = []
    for index in range(count):
        picture = np.ascontiguousarray(wall[:, 4 * index : 4 * index + WIDTH])
        picture[:16, :16] = 255 * (index % 2)
        frame = av.VideoFrame.from_ndarray(picture, format="bgr24").reformat(format="yuv420p")
        frame.pts = index
        encoded += [bytes(packet) for packet in encoder.encode(frame)]
    return encoded


FRAMES = _encode(30)


def _play(stream: list[bytes], *, only_whole: bool = True) -> tuple[list[int], FrameDecoder]:
    """Assemble and decode; the brightness of the corner of every picture shown."""
    assembler, decoder = FrameAssembler(), FrameDecoder(only_whole=only_whole)
    shown = []
    for index, packet in enumerate(stream):
        for whole in assembler.add_packet(packet, index):
            for picture in decoder.decode(Packet(whole.content)):
                shown.append(round(float(picture.to_ndarray()[4:12, 4:12].mean()) / 255))  # noqa: PERF401
    return shown, decoder


def _packets(frames: list[bytes]) -> list[bytes]:
    return [packet for frame in frames for packet in packets(frame)]


def test_every_frame_comes_with_its_own_last_packet() -> None:
    """No frame waits for the next one: after each frame's packets its picture is there."""
    assembler, decoder = FrameAssembler(), FrameDecoder()
    for frame in FRAMES:
        done = [whole for packet in packets(frame) for whole in assembler.add_packet(packet, 7)]
        assert len(done) == 1
        assert done[0].arrived == 7
        assert len(decoder.decode(Packet(done[0].content))) == 1
    assert (decoder.broken, decoder.waiting, assembler.dropped) == (0, 0, 0)


def test_joining_in_the_middle_waits_for_a_key_frame() -> None:
    """No grey or torn first picture, no exception: it starts with the next key frame."""
    late = _packets(FRAMES)[len(_packets(FRAMES[:3])) + 2 :]
    shown, decoder = _play(late)
    assert len(shown) == len(FRAMES) - PERIOD
    assert decoder.broken == 0
    assert decoder.waiting > 0


def test_a_lost_packet_costs_its_frame_and_is_counted() -> None:
    """And those that rest on it, up to the next key frame, unless smeared ones are asked for."""
    stream = _packets(FRAMES[:13])
    lost = stream[: len(stream) - 3] + stream[len(stream) - 2 :]
    rest = _packets(FRAMES[13:])
    shown, decoder = _play(lost + rest, only_whole=False)
    assert decoder.broken == 1
    assert len(shown) == len(FRAMES) - 1
    shown, decoder = _play(lost + rest)
    assert decoder.broken == 1
    assert len(shown) == len(FRAMES) - 1 - (2 * PERIOD - 12)
    assert decoder.waiting == 2 * PERIOD - 12


@settings(max_examples=40)
@given(st.randoms(use_true_random=False), st.floats(0.0, 0.4))
def test_any_loss_order_and_garbage_is_survived(draw: random.Random, share: float) -> None:
    """Lost, doubled, swapped, cut and foreign packets: no exception, and the end is shown."""
    spoilt = []
    for packet in _packets(FRAMES[:20]):
        kind = draw.random()
        if kind >= share:
            spoilt.append(packet)
        elif kind >= share / 2:
            cut, twice, foreign = packet[: len(packet) // 2], packet + packet, draw.randbytes(99)
            spoilt.append(draw.choice([cut, twice, foreign]))
    shown, _ = _play([*spoilt, *_packets(FRAMES[20:])])
    assert len(shown) >= len(FRAMES) - 20 - 1


def _camera(port: int, **robot: object) -> TelloCamera:
    sensor = SensorConfig(id="eye", settings={"video_port": port})
    config = RobotConfig.model_validate(
        {"id": "t", "driver": "tello", "settings": {"address": ADDRESS}, "sensors": [sensor]}
        | robot
    )
    return TelloCamera(config.sensors[0], EnvironmentConfig(robots=[config]))


def _free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind((ADDRESS, 0))
        port: int = probe.getsockname()[1]
        return port


def _wait(camera: TelloCamera, frames: int) -> None:
    deadline = time.monotonic() + 10.0
    while camera.counts.frames < frames:
        assert time.monotonic() < deadline
        time.sleep(0.01)


def test_only_the_newest_frame_is_handed_out_once() -> None:
    """Whoever asks late gets what is new now; the others are counted as overtaken."""
    camera = _camera(port := _free_port())
    assert isinstance(camera, Camera)
    camera.open()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as tello:
        assert camera.capture(5, None) is None
        for packet in _packets(FRAMES[:16]):
            tello.sendto(packet, (ADDRESS, port))
        _wait(camera, 16)
        stamp = 1_000_000_000_000
        picture = camera.capture(stamp, None)
        assert picture is not None
        assert picture.image.shape == (HEIGHT, WIDTH, 3)
        assert picture.image[4:12, 4:12].mean() > 200, "the sixteenth has a white corner"
        assert stamp - 10_000_000_000 < picture.stamp < stamp
        assert camera.capture(stamp, None) is None
        assert camera.counts.overtaken == 15
        assert camera.model is not None
        assert (camera.model.width, camera.model.height) == (WIDTH, HEIGHT)
    camera.close()


def test_video_that_stops_comes_again_and_strangers_are_left_out() -> None:
    """A stream cut in the middle of a frame goes on with the next key frame."""
    camera = _camera(port := _free_port())
    camera.open()
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as tello,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger,
    ):
        stranger.bind(("127.0.0.77", 0))
        first = _packets(FRAMES[:5])
        for packet in first[:-1]:
            tello.sendto(packet, (ADDRESS, port))
            stranger.sendto(b"\x00\x00\x00\x01\x65garbage", (ADDRESS, port))
        _wait(camera, 4)
        for packet in _packets(FRAMES[PERIOD : 2 * PERIOD]):
            tello.sendto(packet, (ADDRESS, port))
        _wait(camera, 4 + PERIOD)
    assert camera.counts.strangers == len(first) - 1
    assert camera.skipped <= 1
    camera.close()


def _one(width: int, height: int, kind: str) -> bytes:
    """A black picture, coded."""
    encoder = av.CodecContext.create("libx264", "w")
    encoder.width, encoder.height, encoder.pix_fmt = width, height, kind
    encoder.time_base, encoder.thread_count = Fraction(1, 30), 1
    encoder.options = {
        "preset": "ultrafast",
        "tune": "zerolatency",
        "x264-params": "sliced-threads=0:slices=1",
    }
    grey = np.zeros((height, width), np.uint8)
    frame = av.VideoFrame.from_ndarray(grey, format="gray").reformat(format=kind)
    return b"".join(bytes(packet) for packet in encoder.encode(frame))


@pytest.mark.parametrize(
    ("width", "height", "shown"), [(1920, 1088, True), (1936, 1088, False), (4096, 4096, False)]
)
def test_a_picture_larger_than_any_tellos_is_not_decoded(
    width: int, height: int, *, shown: bool
) -> None:
    """A stream may claim any size, and takes no memory for it."""
    camera = _camera(_free_port())
    for packet in packets(_one(width, height, "yuv420p")):
        camera.on_packet(packet, 0)
    assert (camera.capture(10**10, None) is not None) is shown
    assert (camera.counts.waiting > 0) is not shown


def test_a_taken_port_and_a_camera_without_a_tello_are_told() -> None:
    """What is wrong, and where."""
    port = _free_port()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("", port))
        with pytest.raises(SourceError, match=f"eye, video: UDP port {port} is taken"):
            _camera(port).open()
    with pytest.raises(ConfigError, match="a robot whose driver is"):
        _camera(port, driver="simulated", settings={})
