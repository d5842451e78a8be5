"""YOLO's annotations: a text beside each picture, a line for each object.

A line is a class number and the box's centre, width and height as fractions of the picture. The
pictures lie in `images/`, the texts under the same names in `labels/`, and the classes' names in
`data.yaml` or, one a line, in `classes.txt`. Source: docs.ultralytics.com/datasets/detect.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from aerodaas.errors import ConfigError
from tools.evaluation.dataset import (
    PICTURE_SUFFIXES,
    AnnotatedPicture,
    Dataset,
    Thing,
    checked_box,
    counted,
    read_bytes,
    read_size,
    shown,
)

__all__ = ["read_yolo"]

_MOST_BYTES = 4 << 20
_MOST_DESCRIPTION = 256 << 10
"""Bytes of a data.yaml: those of datasets of a thousand classes have a tenth of that."""
_NUMBERS = 5
_SPLITS = ("val", "test", "train")
_LIST = "classes.txt"


def read_yolo(path: Path, pictures: Path | None = None) -> Dataset:
    """Read a dataset by its `data.yaml`, or by its folder.

    Args:
        path: The file or the folder.
        pictures: Folder of the pictures; by default the file's `val`, `test` or `train`, whichever
            it names first, or `images`.

    Raises:
        ConfigError: That names the file and the line, if one is not as it should be.
    """
    root = path if path.is_dir() else path.parent
    description = _description(path if path.is_file() else root / "data.yaml")
    labels = _labels(description, root)
    folder = pictures or _pictures(description, root)
    if not folder.is_dir():
        raise ConfigError(f"there is no folder {folder}: name the pictures' with --pictures")
    files = [one for one in sorted(folder.rglob("*")) if one.suffix.lower() in PICTURE_SUFFIXES]
    pictures_found = (
        AnnotatedPicture(file, _things(_text_beside(file), file, labels)) for file in files
    )
    return Dataset(counted(pictures_found, folder), tuple(dict.fromkeys(labels)))


def _description(path: Path) -> dict[str, Any]:
    if not path.is_file():
        return {}
    try:
        content = yaml.safe_load(read_bytes(path, _MOST_DESCRIPTION))
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        mark = getattr(error, "problem_mark", None)
        line = f":{mark.line + 1}" if mark is not None else ""
        problem = getattr(error, "problem", None) or "cannot be read"
        raise ConfigError(f"{path}{line}: is not YAML: {shown(problem)}") from None
    if not isinstance(content, dict):
        raise ConfigError(f"{path} is YAML, but not a description of a dataset")
    return content


def _labels(description: dict[str, Any], root: Path) -> list[str]:
    names = description.get("names")
    if names is None and (root / _LIST).is_file():
        names = read_bytes(root / _LIST, _MOST_BYTES).decode("utf-8", "replace").split("\n")
        names = [one.strip() for one in names if one.strip()]
    if isinstance(names, dict) and set(names) == set(range(len(names))):
        names = [names[number] for number in range(len(names))]
    # Nothing but plain names: aliases nest lists until their text has no end.
    if not isinstance(names, list) or not names or not all(_is_plain(one) for one in names):
        raise ConfigError(f"{root} names no classes: give `names` in data.yaml, or {_LIST}")
    return [str(one) for one in names]


def _is_plain(value: object) -> bool:
    return isinstance(value, str | int)


def _pictures(description: dict[str, Any], root: Path) -> Path:
    named = next((description[one] for one in _SPLITS if description.get(one)), "images")
    below = description.get("path") or "."
    if not isinstance(named, str) or not isinstance(below, str) or "\0" in named + below:
        raise ConfigError(f"{root}: data.yaml names no folder of pictures; use --pictures")
    parts = Path(below, named)
    if parts.is_absolute() or ".." in parts.parts:
        raise ConfigError(f"{shown(parts)} leads out of {root}: name it with --pictures")
    return root / parts


def _text_beside(picture: Path) -> Path:
    """The text of a picture: of the same name, in `labels` where the picture is in `images`."""
    parts = list(picture.parts)
    if "images" in parts:
        last = len(parts) - 1 - parts[::-1].index("images")
        parts[last] = "labels"
    return Path(*parts).with_suffix(".txt")


def _things(text: Path, picture: Path, labels: list[str]) -> tuple[Thing, ...]:
    """A picture without a text, or with an empty one, shows nothing."""
    if not text.is_file():
        return ()
    lines = read_bytes(text, _MOST_BYTES).decode("utf-8", "replace").splitlines()
    rows = [(number, line.split()) for number, line in enumerate(lines, 1) if line.strip()]
    if not rows:
        return ()
    size = read_size(picture)
    return tuple(_thing(f"{text}:{number}", row, labels, size) for number, row in rows)


def _thing(place: str, row: list[str], labels: list[str], size: tuple[int, int]) -> Thing:
    if len(row) != _NUMBERS:
        raise ConfigError(
            f"{place}: must be class, centre x, centre y, width, height, not {len(row)} words; "
            "outlines and keypoints are not read"
        )
    try:
        number, (x, y, wide, high) = int(row[0]), (float(one) for one in row[1:])
    except ValueError:
        raise ConfigError(f"{place}: must be five numbers, not {shown(' '.join(row))}") from None
    if not 0 <= number < len(labels):
        raise ConfigError(f"{place}: there is no class {number}; there are {len(labels)}")
    if not all(-1 <= one <= 2 for one in (x, y, wide, high)):  # noqa: PLR2004 - rounding, cut-offs
        raise ConfigError(f"{place}: numbers are fractions of the picture, not {shown(row[1:])}")
    width, height = size
    corners = [
        (x - wide / 2) * width,
        (y - high / 2) * height,
        (x + wide / 2) * width,
        (y + high / 2) * height,
    ]
    return Thing(labels[number], checked_box(corners, place))
