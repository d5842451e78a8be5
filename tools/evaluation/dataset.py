"""Annotated pictures: boxes and labels, of COCO's and YOLO's formats.

Annotations are a stranger's data: sizes, counts and numbers have bounds, and pictures lie in the
folder of the pictures alone, whatever path an annotation names.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from aerodaas.cameras.picture_size import picture_fits, picture_size
from aerodaas.errors import ConfigError
from aerodaas.geometry.frames import Box
from aerodaas.text.printable import printable

__all__ = [
    "MOST_SIDE",
    "MOST_THINGS",
    "PICTURE_SUFFIXES",
    "AnnotatedPicture",
    "Dataset",
    "Thing",
    "checked_box",
    "counted",
    "read_bytes",
    "read_picture",
    "read_size",
    "shown",
]

MOST_THINGS = 2_000_000
"""Most annotations of a dataset: COCO's training set has 860,000."""
MOST_SIDE = 1e6
"""Pixels; beyond them no box lies."""
PICTURE_SUFFIXES = (".jpg", ".jpeg", ".png", ".webp")
_MOST_PICTURE_BYTES = 64 << 20
_HEAD = 64 << 10
"""Bytes of a file in which most pictures tell their size; others have more metadata before it."""
_SHOWN = 60
"""Characters of a stranger's text in an error."""


@dataclass(frozen=True)
class Thing:
    """One annotated object."""

    label: str
    box: Box
    ignored: bool = False
    """Need not be found, and may be: COCO's crowds."""
    area: float | None = None
    """Square pixels of its outline where that is annotated; otherwise the box's count."""


@dataclass(frozen=True)
class AnnotatedPicture:
    """One picture with all its annotations."""

    path: Path
    things: tuple[Thing, ...]


@dataclass(frozen=True)
class Dataset:
    """Annotated pictures, and the labels that were annotated throughout."""

    pictures: tuple[AnnotatedPicture, ...]
    labels: tuple[str, ...]

    def renamed(self, names: Mapping[str, str]) -> Dataset:
        """The dataset with other labels; several may get one name.

        Raises:
            ConfigError: If there is no such label.
        """
        unknown = [name for name in names if name not in self.labels]
        if unknown:
            known = ", ".join(shown(label) for label in self.labels)
            raise ConfigError(f"the dataset has no label {', '.join(unknown)}; it has {known}")
        pictures = tuple(
            AnnotatedPicture(
                picture.path,
                tuple(
                    replace(one, label=names.get(one.label, one.label)) for one in picture.things
                ),
            )
            for picture in self.pictures
        )
        return Dataset(
            pictures, tuple(dict.fromkeys(names.get(label, label) for label in self.labels))
        )


def shown(content: object) -> str:
    """A stranger's value, short and printable."""
    text = printable(str(content))
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}…"


def checked_box(numbers: Sequence[object], place: str) -> Box:
    """Return left, top, right, bottom as given.

    Raises:
        ConfigError: That names the `place`, for anything but finite numbers of a box with a size.
    """
    plain = [
        float(one)
        for one in numbers
        if isinstance(one, int | float) and not isinstance(one, bool) and abs(one) <= MOST_SIDE
    ]
    if len(plain) != len(numbers):
        raise ConfigError(f"{place}: a box has four finite numbers, not {shown(list(numbers))}")
    left, top, right, bottom = plain
    if right <= left or bottom <= top:
        raise ConfigError(
            f"{place}: the box is empty: {right - left:g} x {bottom - top:g} pixels; remove it, or "
            "give it a size"
        )
    return left, top, right, bottom


def counted(pictures: Iterable[AnnotatedPicture], place: Path) -> tuple[AnnotatedPicture, ...]:
    """Collect pictures one by one; raises ConfigError once they have too many annotations."""
    found = []
    count = 0
    for picture in pictures:
        count += len(picture.things)
        if count > MOST_THINGS:
            raise ConfigError(f"{place} has more than {MOST_THINGS:,} annotations")
        found.append(picture)
    return tuple(found)


def read_bytes(path: Path, most: int, head: int | None = None) -> bytes:
    """Read a file of at most `most` bytes, or its first `head` bytes; raises ConfigError."""
    try:
        with path.open("rb") as file:
            # Python takes the memory for as much as is asked for, however small the file.
            size = os.fstat(file.fileno()).st_size
            if size <= most:
                return file.read(size if head is None else min(head, size))
    except OSError as error:
        raise ConfigError(f"cannot read {path}: {error.strerror}") from None
    raise ConfigError(f"{path} is larger than {most / (1 << 20):.3g} MiB; is it what was meant?")


def read_size(path: Path) -> tuple[int, int]:
    """Read a picture's width and height in pixels, without decoding it; raises ConfigError."""
    head = read_bytes(path, _MOST_PICTURE_BYTES, _HEAD)
    size = picture_size(head) or picture_size(read_bytes(path, _MOST_PICTURE_BYTES))
    return _checked_size(path, size)


def read_picture(path: Path) -> NDArray[np.uint8]:
    """Read a picture as height x width x 3 (BGR), not turned by its EXIF; raises ConfigError."""
    content = read_bytes(path, _MOST_PICTURE_BYTES)
    _checked_size(path, picture_size(content))
    flags = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION
    image = cv2.imdecode(np.frombuffer(content, np.uint8), flags)
    if image is None:
        raise _unreadable(path)
    return np.asarray(image, np.uint8)


def _checked_size(path: Path, size: tuple[int, int] | None) -> tuple[int, int]:
    if size is None:
        raise _unreadable(path)
    if not picture_fits(*size):
        raise ConfigError(f"{path} has {size[0]} x {size[1]} pixels, too many to be read")
    return size


def _unreadable(path: Path) -> ConfigError:
    return ConfigError(f"{path} is no JPEG, PNG or WebP that can be read")
