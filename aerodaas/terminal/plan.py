"""A small plan of the flight in braille characters, 2 x 4 dots in each."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import TypeAlias

from rich.text import Text

__all__ = ["braille_plan"]

_DOTS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
"""Bits of a braille character by row and column, after U+2800."""
_BLANK = 0x2800
_LEAST_METRES = 2.0

Place: TypeAlias = tuple[float, float]
Dot: TypeAlias = tuple[int, int]


def braille_plan(
    path: Sequence[Place], waypoints: Sequence[Place], *, columns: int, rows: int
) -> Text:
    """Draw a path, its end as a drone, and waypoints; east to the right, north up, to scale.

    Places are east and north in metres. Terminal cells are twice as high as wide, so the dots
    lie on a square grid.
    """
    canvas = _Canvas([*path, *waypoints], columns, rows)
    for begin, end in pairwise(path):
        canvas.line(begin, end)
    for place in waypoints:
        canvas.mark(place, "○", "yellow")
    for place in path[-1:]:
        canvas.mark(place, "●", "bold bright_green")
    return canvas.text()


class _Canvas:
    """Dots, and characters over them, on a map that shows all of `places`."""

    def __init__(self, places: Sequence[Place], columns: int, rows: int) -> None:
        self._columns, self._rows = columns, rows
        self._wide, self._high = 2 * columns - 1, 4 * rows - 1
        easts, norths = [x for x, _ in places] or [0.0], [y for _, y in places] or [0.0]
        self._metres = max(
            (max(easts) - min(easts)) / self._wide,
            (max(norths) - min(norths)) / self._high,
            _LEAST_METRES / self._wide,
        )
        self._left = (min(easts) + max(easts) - self._metres * self._wide) / 2
        self._top = (min(norths) + max(norths) + self._metres * self._high) / 2
        self._bits: dict[Dot, int] = {}
        self._marks: dict[Dot, tuple[str, str]] = {}

    def line(self, begin: Place, end: Place) -> None:
        for across, down in _between(self._dot(begin), self._dot(end)):
            cell = (down // 4, across // 2)
            self._bits[cell] = self._bits.get(cell, 0) | _DOTS[down % 4][across % 2]

    def mark(self, place: Place, character: str, style: str) -> None:
        across, down = self._dot(place)
        self._marks[down // 4, across // 2] = (character, style)

    def text(self) -> Text:
        lines = []
        for row in range(self._rows):
            cells = ((row, column) for column in range(self._columns))
            lines.append(Text.assemble(*(self._marks.get(at) or self._braille(at) for at in cells)))
        return Text("\n").join(lines)

    def _braille(self, cell: Dot) -> tuple[str, str]:
        bits = self._bits.get(cell, 0)
        return (chr(_BLANK | bits) if bits else " ", "bright_blue")

    def _dot(self, place: Place) -> Dot:
        across = round((place[0] - self._left) / self._metres)
        down = round((self._top - place[1]) / self._metres)
        return min(max(across, 0), self._wide), min(max(down, 0), self._high)


def _between(begin: Dot, end: Dot) -> Iterator[Dot]:
    (x0, y0), (x1, y1) = begin, end
    count = max(abs(x1 - x0), abs(y1 - y0), 1)
    for step in range(count + 1):
        yield round(x0 + (x1 - x0) * step / count), round(y0 + (y1 - y0) * step / count)
