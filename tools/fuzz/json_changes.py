"""Mutation of JSON by its structure: one value is replaced by another, so that it stays JSON."""

from __future__ import annotations

import random
from collections.abc import Iterator, Sequence
from typing import Any

__all__ = ["VALUES", "change_value", "flip_byte"]

VALUES: tuple[Any, ...] = (
    None,
    True,
    -1,
    10**30,
    1e308,
    float("nan"),
    "",
    "a" * 300,
    [],
    {},
)
"""What a value is replaced by, beside another value of the same content."""


def change_value(content: Any, rng: random.Random, values: Sequence[Any] = VALUES) -> bool:  # noqa: ANN401 - JSON
    """Replace one value within `content`; False if it has none.

    The value may be put within itself, which cannot be written as JSON.
    """
    places = list(_places(content))
    if not places:
        return False
    holder, key = rng.choice(places)
    other, name = rng.choice(places)
    holder[key] = rng.choice([*values, other[name], other])
    return True


def flip_byte(data: bytes, rng: random.Random) -> bytes:
    """Replace one byte."""
    changed = bytearray(data)
    if changed:
        changed[rng.randrange(len(changed))] = rng.randrange(256)
    return bytes(changed)


def _places(content: Any) -> Iterator[tuple[Any, Any]]:  # noqa: ANN401 - JSON
    if isinstance(content, dict | list):
        for key in content if isinstance(content, dict) else range(len(content)):
            yield content, key
            yield from _places(content[key])
