"""Plots of a report, and sections that extensions add to it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from aerodaas.config.extensions import added
from aerodaas.recording.reader import Recording

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Drawing", "Plot", "ReportSection", "extension_sections"]


class Plot(NamedTuple):
    """A rendered plot with its texts."""

    name: str
    """Name of its file, without suffix."""
    title: str
    description: str
    """Alternative text of the image."""
    png: bytes


@dataclass(frozen=True, slots=True)
class Drawing:
    """A plot that is not drawn yet."""

    name: str
    """Name of its file, without suffix."""
    title: str
    description: str
    """Alternative text of the image."""
    draw: Callable[[], Figure]


@dataclass(frozen=True, slots=True)
class ReportSection:
    """A section of the report's page, and its plots, which stand beside those of the flight."""

    title: str
    text: str
    """Its first line, which `aerodaas report` prints, too; code stands between backticks."""
    head: Sequence[str] = ()
    rows: Sequence[Sequence[object]] = ()
    """Table under `head`; none without rows."""
    note: str = ""
    """Below the table."""
    drawings: Sequence[Drawing] = ()
    """Drawn where the extra `plots` is installed."""


def extension_sections(recording: Recording) -> list[ReportSection]:
    """Sections that the installed extensions add to the report of a recording."""
    return [section for sections in added("report_sections") for section in sections(recording)]
