"""`aerodaas lab leaderboard`: simulations, a table, a page and a CSV."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from datetime import datetime, timezone
from pathlib import Path
from time import perf_counter
from typing import Annotated

import typer

import aerodaas
from aerodaas.cli.lab.options import Jobs, write_csv, writing_into
from aerodaas.errors import ConfigError
from aerodaas.extensions.leaderboard.ranking import (
    CASES,
    FULL,
    QUICK,
    SET,
    Extent,
    Leaderboard,
    run_leaderboard,
)
from aerodaas.recording.provenance import package_versions, processor_name, revision_of
from aerodaas.recording.report.page.document import render_page
from aerodaas.schedulers.analytics.registry import load_scheduler, scheduler_names
from aerodaas.schedulers.lab.metrics import Mean
from aerodaas.terminal.figures import Row, show_figures
from aerodaas.terminal.progress import show_progress

__all__ = ["html_page", "leaderboard", "rank"]


def leaderboard(
    *,
    scheduler: Annotated[
        list[str] | None,
        typer.Option(
            "--scheduler",
            "-s",
            help="Your own, beside all registered ones: `file.py:Class` or `module:Class`, "
            "comma-separated, or given several times.",
        ),
    ] = None,
    only: Annotated[
        bool, typer.Option("--only", help="Rank those of --scheduler alone, which is faster.")
    ] = False,
    full: Annotated[
        bool, typer.Option("--full", help="30 seeds of 300 s instead of 10 seeds of 60 s.")
    ] = False,
    jobs: Jobs = None,
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for the page.")] = Path(
        "leaderboard"
    ),
) -> None:
    """Rank all schedulers, and yours, on one fixed set of workloads, networks and seeds.

    By utility, as a share of what a clairvoyant could reach at most, and by tasks in time; with
    95 % intervals and a test against the first. Writes a page, `leaderboard.html`, and the figures
    as CSV.

        aerodaas lab leaderboard
        aerodaas lab leaderboard -s mine.py:Mine -o board
        aerodaas lab leaderboard -s dems,margin,mine.py:Mine --only --full
    """
    own = [name.strip() for name in ",".join(scheduler or []).split(",") if name.strip()]
    registered = [] if only else scheduler_names()
    names = list(dict.fromkeys([*registered, *own]))
    rank(names, FULL if full else QUICK, jobs=jobs, out=out)


def rank(names: Sequence[str], extent: Extent, *, jobs: int | None, out: Path) -> None:
    """Rank schedulers, print the table, and write the files.

    Args:
        names: The schedulers.
        extent: Seeds and seconds of each case.
        jobs: Processes; None for one per core.
        out: Folder of the files.

    Raises:
        ConfigError: Without a scheduler, or where nothing can be written.
        SchedulerError: As `run_leaderboard`.
        UnknownIdError: For a scheduler that there is not.
    """
    if not names:
        raise ConfigError("--only needs a --scheduler")
    ideas = {name: _idea(name) for name in names}
    # A folder that cannot be written to is told now, not after minutes.
    with writing_into(out):
        out.mkdir(parents=True, exist_ok=True)
    began = perf_counter()
    with show_progress() as progress:
        bar = progress.add_task("sample paths", total=None)
        board = run_leaderboard(
            names,
            extent=extent,
            jobs=jobs,
            progress=lambda done, total: progress.update(bar, completed=done, total=total),
        )
    page, table = out / "leaderboard.html", out / "leaderboard.csv"
    text = html_page(board, ideas, _origin(perf_counter() - began))
    _show(board)
    with writing_into(out):
        page.write_text(text, encoding="utf-8")
        write_csv(table, board.rows())
    typer.echo(f"in {out}: {page.name}, {table.name}")


def html_page(board: Leaderboard, ideas: Mapping[str, str], origin: str) -> str:
    """The leaderboard as one self-contained HTML page.

    Args:
        board: The standings.
        ideas: A line about each scheduler.
        origin: Where the figures come from, in one line.
    """
    return render_page(
        Path(__file__).with_name("leaderboard.html"),
        title="Leaderboard of analytics schedulers",
        origin=origin,
        board=board,
        ideas=ideas,
        set_name=SET,
        cases=CASES,
        case_rows=[
            (case.name, case.workload, case.network, case.times, case.cloud_slots, case.about)
            for case in CASES
        ],
        best={
            case.name: max(one.cases[case.name][0].value for one in board.standings)
            for case in CASES
        },
        share=lambda value: min(max(value, 0.0), 1.0),
    )


def _origin(took: float) -> str:
    """Day, versions, revision and machine of this run, which took some seconds."""
    known = package_versions()
    versions = ", ".join(f"{name} {known[name]}" for name in ("aerodaas", "python", "numpy"))
    revision = revision_of(Path(aerodaas.__file__).parent)
    changed = " with changes" if revision.endswith("+") else ""
    source = f", revision {revision[:12]}{changed}" if revision else ""
    day = datetime.now(timezone.utc).date().isoformat()
    return f"{day}: {versions}{source}; {os.cpu_count()} cores, {processor_name()}; {took:.0f} s"


def _idea(name: str) -> str:
    """The first line of a scheduler's docstring; raises what loading it does."""
    lines = (type(load_scheduler(name)).__doc__ or "").strip().splitlines()
    return lines[0] if lines else ""


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
