"""OpaqueItem: a result of an application's own class, which its user's side alone can rebuild."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from aerodaas.messages.serialization.records import fast_pickle

__all__ = ["OpaqueItem"]


@fast_pickle
@dataclass(frozen=True, slots=True)
class OpaqueItem:
    """A result of a class that only the user's side knows."""

    kind: str
    """Name of the class."""
    value: Any
    """What can be shown of it, of JSON's types."""
    data: bytes = b""
    """Name by which the user's side finds the object again."""
