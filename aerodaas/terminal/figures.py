"""Tables of figures, which are never cut short, however narrow the terminal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rich.box import SIMPLE_HEAD
from rich.console import Console, ConsoleDimensions
from rich.measure import Measurement
from rich.table import Table
from rich.text import Text

__all__ = ["Row", "show_figures"]

_WIDEST = 10_000
"""Columns of characters that no table of ours has."""


@dataclass(frozen=True)
class Row:
    """One row: what it is about, and a cell for each column."""

    name: str
    cells: Sequence[str]
    bold: bool = False


def show_figures(
    title: str,
    heading: str,
    columns: Sequence[str],
    rows: Sequence[Row],
    *,
    console: Console | None = None,
) -> None:
    """Print a table; on a terminal too narrow for it, as several with the names before each.

    Where no terminal reads, such as in a pipe, no width has to be kept.

    Args:
        title: Above the table.
        heading: Of the names' column.
        columns: Headings of the others.
        rows: With as many cells as there are columns.
        console: Where to print instead of standard output; made wider if one column asks for it.
    """
    console = console or Console(highlight=False)
    width = console.width if console.is_terminal else _WIDEST
    console.print(title, style="italic", soft_wrap=True, markup=False)
    part: list[int] = []
    for number in range(len(columns)):
        if part and _width(_table(heading, columns, rows, [*part, number])) > width:
            _print(console, _table(heading, columns, rows, part))
            part = []
        part.append(number)
    _print(console, _table(heading, columns, rows, part))


def _table(heading: str, columns: Sequence[str], rows: Sequence[Row], part: Sequence[int]) -> Table:
    table = Table(box=SIMPLE_HEAD, padding=(0, 1), pad_edge=False)
    # Texts, for labels and reasons are others' words, which may have brackets.
    table.add_column(Text(heading), no_wrap=True)
    for number in part:
        table.add_column(Text(columns[number]), justify="right", no_wrap=True)
    for row in rows:
        cells = (row.cells[number] for number in part)
        table.add_row(*map(Text, (row.name, *cells)), style="bold" if row.bold else "")
    return table


def _width(table: Table) -> int:
    wide = Console(width=_WIDEST)
    return Measurement.get(wide, wide.options, table).maximum


def _print(console: Console, table: Table) -> None:
    # With the height, for of a dumb terminal the width alone is not taken.
    console.size = ConsoleDimensions(max(console.width, _width(table)), console.height)
    console.print(table)
