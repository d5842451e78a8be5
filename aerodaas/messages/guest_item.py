"""GuestItem: a guest's result of its own class, which only that guest's process can rebuild."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

__all__ = ["GuestItem"]


@dataclass(frozen=True, slots=True)
class GuestItem:
    """A result of a class that only its guest knows."""

    kind: str
    """Name of the class."""
    value: Any
    """What can be shown of it, of JSON's types."""
    data: bytes = b""
    """The object as its guest's process encoded it; nobody else may decode it."""
