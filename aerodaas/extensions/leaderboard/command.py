"""The work of `aerodaas lab leaderboard`: simulations, a table, and the files."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

import typer

from aerodaas.cli.lab.study import spread_of
from aerodaas.cli.lab.sweep import write_csv
from aerodaas.errors import ConfigError
from aerodaas.extensions.leaderboard.markdown import markdown_page
from aerodaas.extensions.leaderboard.origin import Origin
from aerodaas.extensions.leaderboard.page import html_page
from aerodaas.extensions.leaderboard.ranking import (
    FULL,
    QUICK,
    SET,
    Extent,
    Leaderboard,
    run_leaderboard,
)
from aerodaas.schedulers.analytics.registry import load_scheduler, scheduler_names
from aerodaas.schedulers.lab.metrics import Mean
from aerodaas.terminal.figures import Row, show_figures
from aerodaas.terminal.progress import show_progress

__all__ = ["leaderboard"]


def leaderboard(
    own: Sequence[str],
    *,
    full: bool,
    only: bool,
    jobs: int | None,
    address: str | None,
    out: Path,
    extent: Extent | None = None,
) -> None:
    """Rank the registered schedulers and `own`, print the table, and write the files into `out`.

    `only` leaves out the registered ones. `extent` replaces that of `full`. Raises ConfigError
    where nothing can be written, SchedulerError, UnknownIdError.
    """
    registered = [] if only else scheduler_names()
    names = list(dict.fromkeys([*registered, *own]))
    if not names:
        raise ConfigError("--only needs a --scheduler")
    ideas = {name: _idea(name) for name in names}
    extent = extent or (FULL if full else QUICK)
    spread, wanted = spread_of(address, names)
    # A folder that cannot be written to is told now, not after minutes.
    _writing(out, lambda: out.mkdir(parents=True, exist_ok=True))
    began, origin = perf_counter(), Origin.here()
    with show_progress() as progress:
        bar = progress.add_task("sample paths", total=None)
        board = run_leaderboard(
            wanted,
            extent=extent,
            jobs=jobs,
            spread=spread,
            progress=lambda done, total: progress.update(bar, completed=done, total=total),
        )
    origin = replace(origin, took=round(perf_counter() - began, 1))
    _show(board)
    files: dict[str, Callable[[Path], Any]] = {
        "leaderboard.html": lambda path: path.write_text(
            html_page(board, ideas, origin), encoding="utf-8"
        ),
        "leaderboard.md": lambda path: path.write_text(
            markdown_page(board, ideas, origin), encoding="utf-8"
        ),
        "leaderboard.csv": lambda path: write_csv(path, board.rows()),
        "leaderboard.json": lambda path: path.write_text(
            json.dumps({**board.as_json(), "origin": origin.as_json()}, indent=1) + "\n",
            encoding="utf-8",
        ),
    }
    for name, write in files.items():
        _writing(out, partial(write, out / name))
    typer.echo(f"in {out}: {', '.join(files)}")


def _idea(name: str) -> str:
    """The first line of a scheduler's docstring; raises what loading it does."""
    lines = (type(load_scheduler(name)).__doc__ or "").strip().splitlines()
    return lines[0] if lines else ""


def _writing(out: Path, write: Callable[[], Any]) -> None:
    try:
        write()
    except OSError as error:
        raise ConfigError(f"cannot write into {out}: {error.strerror}") from None


def _show(board: Leaderboard) -> None:
    rows = [
        Row(
            f"{one.rank:>2}  {one.scheduler}",
            [_percent(one.utility), _percent(one.completion), "yes" if one.is_behind else ""],
            bold=one.rank == 1,
        )
        for one in board.standings
    ]
    title = (
        f"set {SET}: means over the cases and {board.extent.seeds} seeds of "
        f"{board.extent.seconds} s with 95 % intervals"
    )
    columns = ("utility, % of bound", "in time %", "significantly behind the first")
    show_figures(title, "scheduler", columns, rows)


def _percent(mean: Mean) -> str:
    return f"{100 * mean.value:.1f} ±{100 * mean.margin:.1f}"
