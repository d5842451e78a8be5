"""Recordings of foreign pictures."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from mcap.writer import Writer

__all__ = ["encoded", "foreign", "strange_pictures"]

SECOND = 1_000_000_000


def encoded(suffix: str) -> bytes:
    """A picture of 80 x 60 pixels that lossy encoders keep well."""
    across = np.linspace(0, 255, 80, dtype=np.uint8)
    image = np.repeat(across[None, :, None], 60, axis=0).repeat(3, axis=2)
    return cv2.imencode(suffix, np.ascontiguousarray(image))[1].tobytes()


def foreign(path: Path, pictures: list[tuple[str, bytes]]) -> Path:
    """Formats and files in JSON messages of Foxglove's schema, a second apart."""
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("foxglove.CompressedImage", "jsonschema", b"{}")
        channel = writer.register_channel("/front/image", "json", schema)
        for number, (kind, data) in enumerate(pictures):
            value: dict[str, Any] = {"format": kind, "data": base64.b64encode(data).decode()}
            at = (5 + number) * SECOND
            writer.add_message(channel, at, json.dumps({**value, "frame_id": "front"}).encode(), at)
        writer.finish()
    return path


def strange_pictures(folder: Path) -> Path:
    """One picture of each kind of file, two that are broken, and one of another format."""
    jpeg, png = encoded(".jpg"), encoded(".png")
    return foreign(
        folder / "strange.mcap",
        [
            ("jpeg", jpeg),
            ("jpeg", b"no picture at all"),
            ("png", png),
            ("png", png[:40]),
            ("webp", encoded(".webp")),
            ("bmp", encoded(".bmp")),
        ],
    )
