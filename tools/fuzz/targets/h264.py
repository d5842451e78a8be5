"""Packets of H.264 into a Tello's camera: whatever comes, pictures of a bounded size or none."""

from __future__ import annotations

import random
import struct
from collections.abc import Iterable
from fractions import Fraction

import av
import numpy as np
from av import logging as av_logging

from aerodaas.config.model import EnvironmentConfig
from aerodaas.extensions.tello.camera import TelloCamera
from tools.fuzz.flight import require
from tools.tello_vehicle.video import packets

__all__ = ["mutate", "run", "seeds"]

_LENGTH = struct.Struct(">H")
_LONGEST = 1460
_MOST_PIXELS = 1920 * 1088
_COLOURS = 3
_ENVIRONMENT = EnvironmentConfig.model_validate(
    {"robots": [{"id": "d", "driver": "tello", "sensors": [{"id": "c", "driver": "tello"}]}]}
)
# FFmpeg tells each damaged packet on the terminal.
av_logging.set_level(None)


def seeds() -> Iterable[bytes]:
    """Short videos, as length and content of each packet: even and odd sizes, and a huge one."""
    for width, height, kind in ((64, 48, "yuv420p"), (33, 31, "gray"), (4096, 2160, "gray")):
        encoder = av.CodecContext.create("libx264", "w")
        encoder.width, encoder.height, encoder.pix_fmt = width, height, kind
        encoder.time_base, encoder.gop_size, encoder.thread_count = Fraction(1, 30), 3, 1
        encoder.options = {
            "preset": "ultrafast",
            "tune": "zerolatency",
            "x264-params": "repeat-headers=1:sliced-threads=0:slices=1:scenecut=0",
        }
        video = b""
        for index in range(4):
            grey = np.full((height, width), 40 * index, np.uint8)
            grey[: height // 2, index:] = np.arange(width - index, dtype=np.uint8)
            frame = av.VideoFrame.from_ndarray(grey, format="gray").reformat(format=kind)
            frame.pts = index
            for encoded in encoder.encode(frame):
                video += _framed(packets(bytes(encoded)))
        yield video[: 20 * _LONGEST]


def run(data: bytes) -> None:
    """Take each packet as it comes, and each picture as an application would."""
    robot = _ENVIRONMENT.robots[0]
    camera = TelloCamera(robot.sensors[0], _ENVIRONMENT)
    for number, packet in enumerate(_packets(data)):
        camera.on_packet(packet, 1_000_000 * number)
        picture = camera.capture(10**12, None)
        if picture is not None:
            height, width, colours = picture.image.shape
            bytes_of_pixel = picture.image.itemsize * colours
            require(bytes_of_pixel == _COLOURS, "a picture of another kind")
            require(0 < height * width <= _MOST_PIXELS, "a picture beyond all bounds")
            require(camera.model is not None, "a picture without a calibration")


def mutate(data: bytes, rng: random.Random) -> bytes:
    """Lose, repeat, swap, cut or garble packets."""
    found = list(_packets(data))
    for _ in range(rng.randint(1, 3)):
        if not found:
            break
        index = rng.randrange(len(found))
        match rng.randrange(6):
            case 0:
                del found[index]
            case 1:
                found.insert(rng.randrange(len(found)), found[index])
            case 2:
                found[index] = found[index][: rng.randint(0, _LONGEST)]
            case 3:
                found[index] += bytes(_LONGEST - len(found[index]))
            case _:
                packet = bytearray(found[index])
                for _ in range(rng.randint(1, 6) if packet else 0):
                    # Headers and parameter sets stand first, and say the most.
                    reach = min(len(packet), rng.choice((8, 40, _LONGEST)))
                    packet[rng.randrange(reach)] ^= 1 << rng.randrange(8)
                found[index] = bytes(packet)
    return _framed(found)


def _framed(content: Iterable[bytes]) -> bytes:
    return b"".join(_LENGTH.pack(len(one)) + one for one in content)


def _packets(data: bytes) -> Iterable[bytes]:
    place = 0
    while len(data) - place >= _LENGTH.size:
        (length,) = _LENGTH.unpack_from(data, place)
        place += _LENGTH.size
        yield data[place : place + min(length, _LONGEST)]
        place += length
