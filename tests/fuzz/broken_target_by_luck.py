"""A target that fails only where a mutation has doubled what a valid input holds once."""

from __future__ import annotations

from collections.abc import Iterable

__all__ = ["run", "seeds"]


def seeds() -> Iterable[bytes]:
    """A valid input."""
    return [b"head,body,tail"]


def run(data: bytes) -> None:
    """Fail on a second body."""
    if data.count(b"body") > 1:
        raise LookupError("two bodies")
