"""Pictures of the worst mistakes, to look at."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from aerodaas.errors import ConfigError
from aerodaas.geometry.frames import Box
from aerodaas.text.printable import printable
from tools.evaluation.dataset import AnnotatedPicture, read_picture
from tools.evaluation.figures import Mistake

__all__ = ["draw_mistakes"]

_TRUE, _FALSE, _MISSED = (90, 200, 90), (60, 60, 230), (0, 200, 255)
"""Blue, green, red: annotated, false, not found."""


def draw_mistakes(mistakes: Sequence[Mistake], folder: Path, most: int) -> list[Path]:
    """Draw at most `most` pictures: half with false boxes, half with things not found.

    Annotations are green, false boxes red with their score, missed things yellow.

    Returns:
        The files, the worst first.

    Raises:
        ConfigError: If the folder cannot be written.
    """
    false = _by_picture([one for one in mistakes if one.score is not None])
    missed = _by_picture([one for one in mistakes if one.score is None])
    share = max(most - most // 2, most - len(missed))
    chosen = [("false", one) for one in false[:share]]
    chosen += [("missed", one) for one in missed[: most - len(chosen)]]
    files = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for number, (kind, group) in enumerate(chosen, 1):
            picture = group[0].picture
            file = folder / f"{number:03}_{kind}_{printable(picture.path.stem)}.jpg"
            file.write_bytes(_drawn(picture, group))
            files.append(file)
    except OSError as error:
        raise ConfigError(f"cannot write into {folder}: {error.strerror}") from None
    return files


def _by_picture(mistakes: Sequence[Mistake]) -> list[list[Mistake]]:
    groups: dict[Path, list[Mistake]] = {}
    for one in mistakes:
        groups.setdefault(one.picture.path, []).append(one)
    return list(groups.values())


def _drawn(picture: AnnotatedPicture, mistakes: Sequence[Mistake]) -> bytes:
    image = read_picture(picture.path)
    for thing in picture.things:
        _frame(image, thing.box, _TRUE, "")
    for one in mistakes:
        missed = one.score is None
        text = one.label if missed else f"{one.label} {one.score:.2f}"
        _frame(image, one.box, _MISSED if missed else _FALSE, text)
    return bytes(cv2.imencode(".jpg", image)[1])


def _frame(
    image: np.typing.NDArray[np.uint8], box: Box, colour: tuple[int, int, int], text: str
) -> None:
    left, top, right, bottom = (round(one) for one in box)
    cv2.rectangle(image, (left, top), (right, bottom), colour, 2)
    if text:
        place = (max(0, left), max(12, top - 4))
        shown = text.encode("ascii", "replace").decode()
        cv2.putText(image, shown, place, cv2.FONT_HERSHEY_SIMPLEX, 0.5, colour, 1, cv2.LINE_AA)
