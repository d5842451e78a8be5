"""Cells of a table that spreadsheets do not compute."""

from __future__ import annotations

__all__ = ["harmless"]

_FORMULAS = ("=", "+", "-", "@", "\t", "\r")
"""Beginnings of formulas, by OWASP's "CSV Injection"."""


def harmless(cell: object) -> object:
    """A cell; a text that a spreadsheet would compute is led by an apostrophe (OWASP)."""
    return f"'{cell}" if isinstance(cell, str) and cell.startswith(_FORMULAS) else cell
