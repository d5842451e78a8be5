"""Tables of figures are whole at every width, and a pipe has none."""

from __future__ import annotations

import io
import re

from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from aerodaas.terminal.figures import Row, show_figures

WORDS = st.from_regex(re.compile(r"[a-z0-9.±%/\[\]]{1,12}", re.ASCII), fullmatch=True)


@st.composite
def tables(draw: st.DrawFn) -> tuple[list[str], list[Row]]:
    """Columns and rows of one table."""
    columns = draw(st.lists(WORDS, min_size=1, max_size=12))
    cells = st.lists(WORDS, min_size=len(columns), max_size=len(columns))
    rows = st.lists(st.builds(Row, WORDS, cells, st.booleans()), min_size=1, max_size=5)
    return columns, draw(rows)


def printed(columns: list[str], rows: list[Row], width: int, *, terminal: bool) -> list[str]:
    """The lines of a table."""
    file = io.StringIO()
    console = Console(file=file, width=width, force_terminal=terminal, no_color=True)
    show_figures("title", "name", columns, rows, console=console)
    return re.sub(r"\x1b\[[0-9;]*m", "", file.getvalue()).splitlines()


@given(tables(), st.integers(40, 120))
def test_nothing_is_cut_and_the_width_is_kept(
    table: tuple[list[str], list[Row]], width: int
) -> None:
    """Each name stands before its own cells, all of them in order, within the terminal."""
    columns, rows = table
    lines = printed(columns, rows, width, terminal=True)
    assert max(map(len, lines)) <= width
    words = [line.split() for line in lines if line.strip()][1:]
    height = 2 + len(rows)
    headings: list[str] = []
    cells: list[list[str]] = [[] for _ in rows]
    for start in range(0, len(words), height):
        heading, _, *block = words[start : start + height]
        headings += heading[1:]
        for row, found, (name, *more) in zip(rows, cells, block, strict=True):
            assert name == row.name
            found.extend(more)
    assert headings == columns
    assert cells == [list(row.cells) for row in rows]


def test_a_dumb_terminal_cuts_nothing() -> None:
    """Its width is taken for 80 columns, and one name is wider."""
    file = io.StringIO()
    console = Console(file=file, force_terminal=True, _environ={"TERM": "dumb"})
    show_figures("title", "name", ["cell"], [Row("n" * 90, ["1"])], console=console)
    assert "n" * 90 in file.getvalue()


@given(tables())
def test_a_pipe_has_one_table(table: tuple[list[str], list[Row]]) -> None:
    """However wide: who reads it by a program finds each row on one line."""
    columns, rows = table
    words = [line.split() for line in printed(columns, rows, 10, terminal=False) if line.strip()]
    assert words[1] == ["name", *columns]
    assert words[3:] == [[row.name, *row.cells] for row in rows]
