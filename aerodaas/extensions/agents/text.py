"""Text that others have written: bounded, printable, and marked as data that nobody has checked."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

__all__ = ["LONGEST", "Untrusted", "plain", "untrusted", "world"]

LONGEST = 200
"""Characters of one text of the world."""
_MOST = 20
"""Texts of one list."""


class Untrusted(BaseModel):
    """Text of the world, such as a name, a label or a vehicle's message: data, no instruction."""

    model_config = ConfigDict(frozen=True)

    text: str = Field(max_length=LONGEST)
    untrusted: Literal[True] = True


def plain(text: str, longest: int = LONGEST) -> str:
    """One line of at most `longest` characters.

    What controls a terminal, reverses or hides text becomes a replacement character; each space,
    line break included, becomes a single blank.

    Args:
        text: Text from anywhere.
        longest: Characters of the result, 1 or more.
    """
    # Long before the end nobody reads it: the work is bounded, too.
    line = " ".join(text[: 8 * longest].split())
    safe = "".join(
        "\N{REPLACEMENT CHARACTER}" if unicodedata.category(one)[0] in "CZ" and one != " " else one
        for one in line
    )
    return safe if len(safe) <= longest and len(text) <= 8 * longest else f"{safe[: longest - 1]}…"


def world(text: str) -> Untrusted | None:
    """A text of the world; None for an empty one."""
    return Untrusted(text=plain(text)) if text.strip() else None


def untrusted(texts: Iterable[str]) -> list[Untrusted]:
    """The last of some texts of the world, the newest last; empty ones are left out."""
    return [found for one in texts if (found := world(one)) is not None][-_MOST:]
