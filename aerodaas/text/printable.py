"""Text of a stranger's file, made safe to print on a terminal."""

from __future__ import annotations

import unicodedata

__all__ = ["printable"]


def printable(text: str) -> str:
    """Replace control and formatting characters, which could steer the terminal, by `?`."""
    return "".join(
        "?" if unicodedata.category(one).startswith("C") and one not in "\n\t" else one
        for one in text
    )
