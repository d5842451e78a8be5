"""Rings of polygons, as readers of KML and GeoJSON find them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from aerodaas.errors import ConfigError
from aerodaas.extensions.plans.formats.numbers import LatLon, finite, place

__all__ = ["AreaReader"]

_MOST_AREAS = 1000
_MOST_CORNERS = 20_000
"""Of all areas of a file together."""
_CORNERS = 3
_PAIR = 2
_WITH_HEIGHT = 3
_SHOWN = 60
_NAME = 80


class AreaReader:
    """Collects a file's polygons within bounds, and counts what is none."""

    def __init__(self) -> None:
        self.found: list[tuple[str, list[tuple[LatLon, ...]]]] = []
        """Names, and rings: the outline, then holes."""
        self.others: Counter[str] = Counter()
        self._corners = 0

    def add(self, name: object, rings: Sequence[Sequence[Sequence[object]]]) -> None:
        """Add a polygon.

        Args:
            name: Its name; what is no text, or empty, becomes a numbered one.
            rings: Its outline, then its holes: corners of longitude, latitude and, if given,
                height.

        Raises:
            ConfigError: If a ring has too few corners, a corner is no place or has more numbers, or
                a bound is passed.
        """
        number = len(self.found) + 1
        where = f"polygon {number}"
        if not rings:
            raise ConfigError(f"{where} has no outline")
        if number > _MOST_AREAS:
            raise ConfigError(f"it has more than {_MOST_AREAS} polygons: split it")
        read = [self._ring(ring, where) for ring in rings]
        named = name[:_NAME] if isinstance(name, str) and name.strip() else f"area{number}"
        self.found.append((named.strip(), read))

    def _ring(self, ring: Sequence[Sequence[object]], where: str) -> tuple[LatLon, ...]:
        self._corners += len(ring)
        if self._corners > _MOST_CORNERS:
            raise ConfigError(f"it has more than {_MOST_CORNERS} corners: simplify its outlines")
        corners = [_corner(corner, where) for corner in ring]
        if corners[:1] == corners[1:][-1:]:
            corners.pop()
        if len(set(corners)) < _CORNERS:
            raise ConfigError(f"{where} has less than three corners")
        return tuple(corners)


def _corner(corner: Sequence[object], where: str) -> LatLon:
    if not _PAIR <= len(corner) <= _WITH_HEIGHT:
        # More may be the next corner, or halves of numbers with decimal commas.
        listed = ",".join(map(str, corner))[:_SHOWN]
        raise ConfigError(
            f"{where}: a corner is {listed!r}, not longitude, latitude and at most a height; "
            "write decimals with a point and each corner by itself"
        )
    for height in corner[_PAIR:]:
        finite(height, f"{where}: height")
    return place(corner[1], corner[0], where)
