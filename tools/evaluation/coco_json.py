"""COCO's annotations: one JSON of images, annotations and categories.

Source of the format: cocodataset.org/#format-data, object detection.
"""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from aerodaas.errors import ConfigError
from tools.evaluation.dataset import (
    MOST_SIDE,
    MOST_THINGS,
    AnnotatedPicture,
    Dataset,
    Thing,
    checked_box,
    read_bytes,
    shown,
)

__all__ = ["read_coco"]

_MOST_BYTES = 512 << 20
"""Of a file; COCO's own of its training set have 450 MB."""
_SIDES = 4


def read_coco(path: Path, pictures: Path | None = None) -> Dataset:
    """Read annotations; `pictures` is the folder of the pictures, by default the file's own.

    Raises:
        ConfigError: That names the file and the entry, if one is not as it should be.
    """
    content = _content(path)
    folder = pictures or path.parent
    labels = {
        _number(one, "id", place): _text(one, "name", place)
        for place, one in _entries(content, "categories", path)
    }
    files = {
        _number(one, "id", place): _inside(folder, _text(one, "file_name", place), place)
        for place, one in _entries(content, "images", path)
    }
    things: dict[int, list[Thing]] = defaultdict(list)
    for place, one in _entries(content, "annotations", path):
        picture = _number(one, "image_id", place)
        if picture not in files:
            raise ConfigError(f"{place}.image_id: there is no image {picture}")
        things[picture].append(_thing(one, labels, place))
    return Dataset(
        tuple(AnnotatedPicture(file, tuple(things[number])) for number, file in files.items()),
        tuple(dict.fromkeys(labels.values())),
    )


def _content(path: Path) -> dict[str, Any]:
    try:
        content = json.loads(read_bytes(path, _MOST_BYTES))
    except json.JSONDecodeError as error:
        raise ConfigError(f"{path}:{error.lineno}: is not JSON: {error.msg}") from None
    except (UnicodeDecodeError, RecursionError, ValueError):
        raise ConfigError(f"{path} is not JSON of COCO's form") from None
    if not isinstance(content, dict):
        raise ConfigError(f"{path} is JSON, but not an object of images, annotations, categories")
    return content


def _entries(content: dict[str, Any], key: str, path: Path) -> Iterator[tuple[str, dict[str, Any]]]:
    entries = content.get(key)
    if not isinstance(entries, list) or len(entries) > MOST_THINGS:
        raise ConfigError(f"{path}: {key}: must be a list of at most {MOST_THINGS:,} entries")
    for index, one in enumerate(entries):
        place = f"{path}: {key}[{index}]"
        if not isinstance(one, dict):
            raise ConfigError(f"{place}: must be an object, not {shown(one)}")
        yield place, one


def _number(entry: dict[str, Any], key: str, place: str) -> int:
    value = entry.get(key)
    if not isinstance(value, int) or isinstance(value, bool):
        raise ConfigError(f"{place}.{key}: must be a whole number, not {shown(value)}")
    return value


def _text(entry: dict[str, Any], key: str, place: str) -> str:
    value = entry.get(key)
    if not isinstance(value, str) or not value:
        raise ConfigError(f"{place}.{key}: must be a text, not {shown(value)}")
    return value


def _inside(folder: Path, name: str, place: str) -> Path:
    if "\0" in name or Path(name).is_absolute() or ".." in Path(name).parts:
        raise ConfigError(f"{place}.file_name: {shown(name)!r} leads out of the pictures' folder")
    return folder / name


def _thing(entry: dict[str, Any], labels: dict[int, str], place: str) -> Thing:
    category = _number(entry, "category_id", place)
    if category not in labels:
        raise ConfigError(f"{place}.category_id: there is no category {category}")
    box = entry.get("bbox")
    if not isinstance(box, list) or len(box) != _SIDES:
        raise ConfigError(f"{place}.bbox: must be x, y, width, height, not {shown(box)}")
    try:
        left, top, width, height = box
        # As floating point, in which a sum has no digits without end.
        corners = [left, top, 1.0 * left + width, 1.0 * top + height]
    except (TypeError, OverflowError):
        corners = box
    area = entry.get("area")
    usable = isinstance(area, int | float) and 0 < area <= MOST_SIDE**2
    return Thing(
        labels[category],
        checked_box(corners, f"{place}.bbox"),
        bool(entry.get("iscrowd")),
        float(area) if usable and area is not None else None,
    )
