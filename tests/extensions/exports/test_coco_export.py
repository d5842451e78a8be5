"""Recordings as COCO datasets, read by pycocotools."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np
import pytest
from pycocotools.coco import COCO
from recorded_pictures import encoded, strange_pictures
from synthetic_flight import PROVENANCE, SyntheticFlight, record

from aerodaas.clock import NANOSECONDS
from aerodaas.config.model import RecordingConfig
from aerodaas.errors import RecordingError
from aerodaas.extensions.exports.coco import write_coco
from aerodaas.geometry.frames import CameraModel
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Frame, Header
from aerodaas.recording.pictures import detections, shots
from aerodaas.recording.reader import Recording
from aerodaas.recording.recorder import FlightRecorder


@pytest.mark.parametrize("images", ["jpeg", "h264"])
def test_pycocotools_reads_pictures_boxes_and_keypoints(
    tmp_path: Path, images: Literal["jpeg", "h264"]
) -> None:
    """Each annotation belongs to its picture; the box is left, top, width, height."""
    path = tmp_path / "flight.mcap"
    flight = SyntheticFlight(frames=0.5, rate=5.0, hover=0.5)
    record(path, flight, config=RecordingConfig(images=images))
    with Recording.open(path) as recording:
        folder = write_coco(recording, tmp_path, interval=0.0)
        expected = {found.header.id: found for _, found in detections(recording)}
        pictures = list(shots(recording))
    dataset = COCO(folder / "annotations.json")
    assert [dataset.cats[number]["name"] for number in dataset.getCatIds()] == ["person"]
    assert len(dataset.imgs) == len(pictures)
    for image in dataset.loadImgs(dataset.getImgIds()):
        pixels = cv2.imread(str(folder / "images" / image["file_name"]))
        assert pixels is not None
        assert pixels.shape[:2] == (image["height"], image["width"]) == (180, 320)
        number = int(image["file_name"].rpartition("-")[2].partition(".")[0])
        # pycocotools' own types know none of our fields.
        annotations: Any = dataset.loadAnns(dataset.getAnnIds(imgIds=image["id"]))
        (annotation,) = annotations
        (found,) = expected[number].items
        assert annotation["bbox"] == [100.0, 50.0, 40.0, 80.0]
        assert (annotation["score"], annotation["track_id"]) == (0.91, 3)
        assert annotation["num_keypoints"] == 17
        assert found.keypoints is not None
        assert annotation["keypoints"][0] == pytest.approx(float(found.keypoints[0, 0]))


def test_pictures_are_as_far_apart_as_asked(tmp_path: Path) -> None:
    """And stay the files that they were."""
    path = tmp_path / "flight.mcap"
    record(path, SyntheticFlight(frames=1.0, rate=5.0, hover=0.5))
    with Recording.open(path) as recording:
        folder = write_coco(recording, tmp_path, interval=10.0)
        kept = {bytes(shot.record.value.data) for shot in shots(recording)}
        with pytest.raises(RecordingError, match="already exists"):
            write_coco(recording, tmp_path)
    images = list((folder / "images").iterdir())
    assert 5 < len(images) < len(kept) / 5
    assert {image.read_bytes() for image in images} <= kept


def test_odd_boxes_and_frame_numbers_cost_no_others(tmp_path: Path) -> None:
    """Boxes without a pixel and scores that are no number are left out; numbers may begin anew."""
    path, lens = tmp_path / "flight.mcap", CameraModel.from_fov(64, 48, 1.4)
    good = Detection((5.0, 5.0, 200.0, 25.0), "car", 0.9)
    odd = (
        Detection((-20.0, 5.0, -4.0, 25.0), "car", 0.8),
        Detection((30.0, 5.0, 10.0, 25.0), "car", 0.7),
        Detection((5.0, 5.0, 20.0, 25.0), "car", math.nan),
        Detection((math.nan, 5.0, 20.0, 25.0), "car", 0.6),
    )
    with FlightRecorder(path, config=RecordingConfig(), provenance=PROVENANCE) as recorder:
        for number, identity in enumerate((0, 1, 0, 1)):
            header = Header(identity, number * NANOSECONDS, "a/cam")
            image = np.full((48, 64, 3), 90, np.uint8)
            found = Detections(header, (good, *odd), 64, 48)
            for stream, item in (("a/cam", Frame(header, image, lens)), ("found", found)):
                at = header.stamp
                recorder.write(Message(stream, number, at, header, at, (), item))
    with Recording.open(path) as recording:
        folder = write_coco(recording, tmp_path, interval=0.0)
    dataset = COCO(folder / "annotations.json")
    assert len({image["file_name"] for image in dataset.loadImgs(dataset.getImgIds())}) == 4
    assert len(list((folder / "images").iterdir())) == 4
    boxes = [annotation["bbox"] for annotation in dataset.loadAnns(dataset.getAnnIds())]
    assert boxes == [[5.0, 5.0, 59.0, 20.0]] * 4


def test_a_recording_without_pictures_is_told(tmp_path: Path) -> None:
    """As by the other exports."""
    path = tmp_path / "bare.mcap"
    with FlightRecorder(path, config=RecordingConfig(), provenance=PROVENANCE):
        pass
    with Recording.open(path) as recording, pytest.raises(RecordingError, match="no pictures"):
        write_coco(recording, tmp_path)


def test_a_dataset_has_the_files_as_they_were(tmp_path: Path) -> None:
    """Broken ones are left out."""
    with Recording.open(strange_pictures(tmp_path)) as recording:
        folder = write_coco(recording, tmp_path, interval=0.0)
    listed = json.loads((folder / "annotations.json").read_text())["images"]
    assert [Path(one["file_name"]).suffix for one in listed] == [".jpg", ".png", ".webp"]
    assert {(one["width"], one["height"]) for one in listed} == {(80, 60)}
    written = [(folder / "images" / one["file_name"]).read_bytes() for one in listed]
    assert written == [encoded(".jpg"), encoded(".png"), encoded(".webp")]
