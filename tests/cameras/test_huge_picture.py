"""A small file that claims a huge picture is skipped like a broken one."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest

from aerodaas.cameras.folder import FolderCamera
from aerodaas.config.model import EnvironmentConfig, SensorConfig
from aerodaas.errors import SourceError


def _png(width: int, height: int) -> bytes:
    def chunk(kind: bytes, data: bytes) -> bytes:
        return (
            struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        )

    head = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    packed = zlib.compress(bytes((width + 1) * height), 9)
    body = chunk(b"IHDR", head) + chunk(b"IDAT", packed) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + body


def _camera(folder: Path) -> FolderCamera:
    sensor = SensorConfig(id="cam", settings={"path": str(folder)})
    return FolderCamera(sensor, EnvironmentConfig.model_validate({"robots": [{"id": "d"}]}))


def test_a_bomb_is_skipped(tmp_path: Path) -> None:
    """It is never unpacked; the next picture plays."""
    (tmp_path / "a.png").write_bytes(_png(12_000, 9_000))
    with pytest.raises(SourceError, match="none of the 1 pictures"):
        _camera(tmp_path).open()
    cv2.imwrite(str(tmp_path / "b.jpg"), np.zeros((48, 64, 3), np.uint8))
    camera = _camera(tmp_path)
    camera.open()
    assert camera.skipped == 1


def test_a_jpeg_that_claims_too_much(tmp_path: Path) -> None:
    """By the size in the start of its frame."""
    data = cv2.imencode(".jpg", np.zeros((48, 64, 3), np.uint8))[1].tobytes()
    place = data.index(b"\xff\xc0") + 5
    (tmp_path / "a.jpg").write_bytes(data[:place] + b"\xff\xff\xff\xff" + data[place + 4 :])
    with pytest.raises(SourceError, match="none of the 1 pictures"):
        _camera(tmp_path).open()
