"""Annotations of both formats mean the same; malformed ones are named by file and place."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from aerodaas.errors import ConfigError
from tools.evaluation import dataset
from tools.evaluation.dataset import Dataset, read_picture, read_size
from tools.evaluation.reading import read_dataset

pytest.importorskip("yaml")

BOX = (20.0, 10.0, 60.0, 90.0)


def coco(**changes: object) -> dict[str, Any]:
    """Annotations of one picture, with something else in them."""
    return {
        "images": [{"id": 4, "file_name": "a.png"}],
        "categories": [{"id": 9, "name": "person"}],
        "annotations": [{"id": 1, "image_id": 4, "category_id": 9, "bbox": [20, 10, 40, 80]}],
    } | changes


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A dataset in both formats, of one picture of 200 x 100."""
    for name in ("images", "labels"):
        (tmp_path / name).mkdir()
    picture = cv2.imencode(".png", np.zeros((100, 200, 3), np.uint8))[1].tobytes()
    (tmp_path / "images/a.png").write_bytes(picture)
    (tmp_path / "labels/a.txt").write_text("0 0.2 0.5 0.2 0.8\n")
    (tmp_path / "data.yaml").write_text("val: images\nnames: {0: person}\n")
    (tmp_path / "coco.json").write_text(json.dumps(coco()))
    return tmp_path


def only(dataset: Dataset) -> Path:
    """The path of the one picture, whose one box is right."""
    (picture,) = dataset.pictures
    (thing,) = picture.things
    assert dataset.labels == ("person",) == (thing.label,)
    assert thing.box == pytest.approx(BOX)
    return picture.path


def test_two_formats_of_one_box(folder: Path) -> None:
    """Corner and size, and fractions about the middle."""
    image = folder / "images/a.png"
    assert only(read_dataset(folder / "coco.json", folder / "images")) == image
    assert only(read_dataset(folder / "data.yaml")) == image
    assert only(read_dataset(folder)) == image


def test_a_picture_without_a_text_shows_nothing(folder: Path) -> None:
    """YOLO's way to say so; the names may stand in classes.txt."""
    (folder / "labels/a.txt").unlink()
    (folder / "data.yaml").unlink()
    (folder / "classes.txt").write_text("person\ncar\n")
    found = read_dataset(folder)
    assert [one.things for one in found.pictures] == [()]
    assert found.labels == ("person", "car")


def thing(**changes: object) -> list[dict[str, Any]]:
    """One annotation, with something else in it."""
    return [{"image_id": 4, "category_id": 9, "bbox": [1, 1, 2, 2]} | changes]


BAD_COCO: dict[str, tuple[object, str]] = {
    "list": ([], "not an object of images"),
    "no images": ({"annotations": []}, "coco.json: categories: must be a list"),
    "category": (
        coco(annotations=thing(category_id=1)),
        r"annotations\[0\].category_id: there is no category 1",
    ),
    "image": (
        coco(annotations=thing(image_id=1)),
        r"annotations\[0\].image_id: there is no image 1",
    ),
    "three numbers": (
        coco(annotations=thing(bbox=[1, 2, 3])),
        r"annotations\[0\].bbox: must be x, y",
    ),
    "text": (coco(annotations=thing(bbox=[1, 2, "a", 3])), "four finite numbers"),
    "empty box": (coco(annotations=thing(bbox=[1, 2, 0, 3])), "the box is empty: 0 x 3"),
    "400 digits": (coco(annotations=thing(bbox=[1, 2, 10**400, 3])), "four finite numbers"),
    "400 digits and a fraction": (
        coco(annotations=thing(bbox=[10**400, 2, 0.5, 3])),
        "four finite numbers",
    ),
    "as many digits as Python reads": (
        coco(annotations=thing(bbox=[1, 10**4300 - 1, 1, 10**4300 - 1])),
        "four finite numbers",
    ),
    "endless": (coco(annotations=thing(bbox=[1, 2, 1e400, 3])), "four finite numbers"),
    "escape": (coco(images=[{"id": 4, "file_name": "../../etc/passwd"}]), "leads out of"),
    "root": (coco(images=[{"id": 4, "file_name": "/etc/passwd"}]), "leads out of"),
    "number": (coco(images=[{"id": 4, "file_name": 5}]), r"images\[0\].file_name: must be a text"),
}


@pytest.mark.parametrize("case", BAD_COCO)
def test_malformed_coco_names_the_entry(folder: Path, case: str) -> None:
    """File, entry, and what stands there."""
    content, problem = BAD_COCO[case]
    (folder / "coco.json").write_text(json.dumps(content))
    with pytest.raises(ConfigError, match=problem):
        read_dataset(folder / "coco.json")


def test_json_that_is_none_names_the_line(folder: Path) -> None:
    """As a file that was cut short."""
    (folder / "coco.json").write_text('{"images": [\n\n{"id": ')
    with pytest.raises(ConfigError, match=r"coco.json:3: is not JSON"):
        read_dataset(folder / "coco.json")


@pytest.mark.parametrize("area", [10**400, float("inf"), float("nan"), -1, 0, "wide", None])
def test_an_area_that_is_none_is_not_taken(folder: Path, area: object) -> None:
    """That of the box counts instead."""
    (folder / "coco.json").write_text(json.dumps(coco(annotations=thing(area=area))))
    (picture,) = read_dataset(folder / "coco.json").pictures
    assert [one.area for one in picture.things] == [None]


@pytest.mark.parametrize(
    ("line", "problem"),
    [
        ("1 0.2 0.5 0.2 0.8", "there is no class 1; there are 1"),
        ("0 0.2 0.5 0.2", "not 4 words"),
        ("0 20 50 20 80", "fractions of the picture"),
        ("0 nan 0.5 0.2 0.8", "fractions of the picture"),
        ("person 0.2 0.5 0.2 0.8", "five numbers"),
        ("0 0.2 0.5 0 0.8", "the box is empty"),
    ],
)
def test_malformed_yolo_names_the_line(folder: Path, line: str, problem: str) -> None:
    """The second line here."""
    (folder / "labels/a.txt").write_text(f"0 0.2 0.5 0.2 0.8\n{line}\n")
    with pytest.raises(ConfigError, match=rf"labels/a.txt:2: .*{problem}"):
        read_dataset(folder)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("val: [\n", r"data.yaml:2: is not YAML"),
        ("val: images\n", "names no classes"),
        ("val: ../elsewhere\nnames: [a]\n", "leads out of"),
        ("path: /srv\nval: images\nnames: [a]\n", "leads out of"),
        ("a: &a [x,x]\nb: &b [*a,*a]\nnames: [*b]\n", "names no classes"),
        ("names: !!python/object/apply:os.getcwd []\n", "is not YAML"),
    ],
)
def test_a_malformed_description_of_a_yolo_dataset(folder: Path, text: str, problem: str) -> None:
    """It names no folder elsewhere, and runs nothing."""
    (folder / "data.yaml").write_text(text)
    with pytest.raises(ConfigError, match=problem):
        read_dataset(folder / "data.yaml")


def test_annotations_are_counted(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Over all pictures, as they are read."""
    monkeypatch.setattr(dataset, "MOST_THINGS", 1)
    assert len(read_dataset(folder).pictures) == 1
    for name in ("images/b.png", "labels/b.txt"):
        (folder / name).write_bytes((folder / name.replace("b.", "a.")).read_bytes())
    with pytest.raises(ConfigError, match="has more than 1 annotations"):
        read_dataset(folder)


@pytest.mark.parametrize(
    ("suffix", "before"), [(".png", 0), (".webp", 0), (".jpg", 0), (".jpg", 3)]
)
def test_a_size_is_that_of_the_decoded_picture(tmp_path: Path, suffix: str, before: int) -> None:
    """However much metadata a JPEG has before it."""
    content = cv2.imencode(suffix, np.zeros((30, 50, 3), np.uint8))[1].tobytes()
    content = content[:2] + before * (b"\xff\xe1\xff\xff" + bytes(0xFFFD)) + content[2:]
    path = tmp_path / "a"
    path.write_bytes(content)
    assert read_size(path) == (50, 30) == read_picture(path).shape[1::-1]


def test_sizes_that_cannot_be_had_are_refused(tmp_path: Path) -> None:
    """No file, no picture, one that claims too much, and one that is too long."""
    path = tmp_path / "a.png"
    with pytest.raises(ConfigError, match=r"cannot read .*a\.png"):
        read_size(path)
    path.write_bytes(b"no picture")
    with pytest.raises(ConfigError, match="is no JPEG, PNG or WebP"):
        read_size(path)
    path.write_bytes(b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR" + 2 * (20_000).to_bytes(4, "big"))
    with pytest.raises(ConfigError, match="has 20000 x 20000 pixels, too many"):
        read_size(path)
    os.truncate(path, (64 << 20) + 1)
    with pytest.raises(ConfigError, match="is larger than 64 MiB"):
        read_size(path)


def test_pictures_are_not_decoded_for_their_size(folder: Path) -> None:
    """The beginning of one is enough to read YOLO's fractions."""
    picture = folder / "images/a.png"
    picture.write_bytes(picture.read_bytes()[:40])
    only(read_dataset(folder / "data.yaml"))
    with pytest.raises(ConfigError, match="is no JPEG, PNG or WebP"):
        read_picture(picture)


def test_what_is_no_dataset_is_told_what_would_be(folder: Path) -> None:
    """An empty folder, a picture, nothing at all."""
    for path in (folder / "images", folder / "images/a.png", folder / "gone"):
        with pytest.raises(ConfigError, match="no annotations that are known"):
            read_dataset(path)
