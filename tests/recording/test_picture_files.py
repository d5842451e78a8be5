"""Pictures of another program's recording, as the files of a dataset and of a bag."""

from __future__ import annotations

import base64
import json
from pathlib import Path

import cv2
import numpy as np
from mcap.writer import Writer

from aerodaas.recording.pictures import shots
from aerodaas.recording.reader import Recording

SECOND = 1_000_000_000


def test_other_pictures_become_jpeg(tmp_path: Path) -> None:
    """Raw pixels, which no program opens as a file."""
    path = tmp_path / "raw.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("foxglove.RawImage", "jsonschema", b"{}")
        channel = writer.register_channel("/front/image", "json", schema)
        data = base64.b64encode(bytes([200]) * (80 * 60)).decode()
        value = {"width": 80, "height": 60, "step": 80, "encoding": "mono8", "data": data}
        writer.add_message(channel, SECOND, json.dumps(value).encode(), SECOND)
        writer.finish()
    with Recording.open(path) as recording:
        (shot,) = shots(recording)
        found = shot.file()
    assert found is not None
    assert (found.format, found.width, found.height) == ("jpeg", 80, 60)
    pixels = cv2.imdecode(np.frombuffer(found.data, np.uint8), cv2.IMREAD_COLOR)
    assert pixels is not None
    assert np.abs(pixels.astype(int) - 200).max() <= 2
