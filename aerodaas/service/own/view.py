"""The console of a flight where an application asked for it: an address, and a page in a cell."""

from __future__ import annotations

import html
from dataclasses import dataclass, field

__all__ = ["ConsoleView"]

_HEIGHT = 640
"""Pixels of the page in a notebook."""


@dataclass(frozen=True)
class ConsoleView:
    """Where the console of a flight is."""

    url: str = field(repr=False)
    """For a browser on this machine, with the token; it ends with the flight."""

    def __str__(self) -> str:
        """The address."""
        return self.url

    def _repr_html_(self) -> str:
        """The page itself."""
        address = html.escape(self.url, quote=True)
        return (
            f'<iframe src="{address}" width="100%" height="{_HEIGHT}" style="border:0"></iframe>'
            f'<a href="{address}" target="_blank" rel="noopener">open it in a tab</a>'
        )
