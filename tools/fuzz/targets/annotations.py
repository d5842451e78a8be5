"""Annotations of pictures: COCO's JSON, YOLO's YAML and lines."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterable
from pathlib import Path

import cv2
import numpy as np

from aerodaas.errors import AeroDaaSError
from tools.evaluation.dataset import Dataset
from tools.evaluation.reading import read_dataset

__all__ = ["run", "seeds"]

_FOLDER = Path(tempfile.mkdtemp(prefix="aerodaas-fuzz-"))
_PICTURE = cv2.imencode(".png", np.zeros((40, 60, 3), np.uint8))[1].tobytes()
for _name in ("coco", "images", "labels"):
    (_FOLDER / _name).mkdir()
(_FOLDER / "images/a.png").write_bytes(_PICTURE)


def seeds() -> Iterable[bytes]:
    """A picture's annotations in each format, told apart by their first byte."""
    content = {
        "images": [{"id": 1, "file_name": "a.png", "width": 60, "height": 40}],
        "categories": [{"id": 1, "name": "person"}, {"id": 2, "name": "car"}],
        "annotations": [
            {"id": 1, "image_id": 1, "category_id": 1, "bbox": [1, 2.5, 20, 30], "area": 500},
            {"id": 2, "image_id": 1, "category_id": 2, "bbox": [1, 2, 9, 9], "iscrowd": 1},
        ],
    }
    yield b"j" + json.dumps(content).encode()
    yield b"ypath: .\nval: images\nnames:\n  0: person\n  1: car\n"
    yield b"t0 0.5 0.5 0.25 0.5\n1 0.25 0.25 0.1 0.1\n"


def run(data: bytes) -> None:
    """Read one file of a dataset; all its boxes have a size, and its pictures stay inside."""
    kind, content = data[:1], data[1:]
    (_FOLDER / "data.yaml").write_bytes(content if kind == b"y" else b"names: [person, car]\n")
    (_FOLDER / "labels/a.txt").write_bytes(content if kind == b"t" else b"")
    (_FOLDER / "coco/a.json").write_bytes(content if kind == b"j" else b"")
    path = "coco/a.json" if kind == b"j" else "data.yaml"
    try:
        dataset = read_dataset(_FOLDER / path)
    except AeroDaaSError as error:
        str(error).encode()
        return
    _check(dataset)


def _check(dataset: Dataset) -> None:
    for picture in dataset.pictures:
        if not picture.path.resolve().is_relative_to(_FOLDER.resolve()):
            raise AssertionError(f"a picture elsewhere: {picture.path}")
        for thing in picture.things:
            left, top, right, bottom = thing.box
            if not (left < right and top < bottom and thing.label in dataset.labels):
                raise AssertionError(f"an annotation {thing}")
