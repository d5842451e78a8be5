"""`aerodaas lab leaderboard`: its options."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from aerodaas.cli.lab.command_line import Address, Jobs

__all__ = ["leaderboard"]


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
    address: Address = None,
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for the page.")] = Path(
        "leaderboard"
    ),
) -> None:
    """Rank all schedulers, and yours, on one fixed set of workloads, networks and seeds.

    By utility, as a share of what a clairvoyant could reach at most, and by tasks in time; with
    95 % intervals and a test against the first. Writes a page, `leaderboard.html`, and the same
    as Markdown, CSV and JSON.

        aerodaas lab leaderboard
        aerodaas lab leaderboard -s mine.py:Mine -o board
        aerodaas lab leaderboard -s dems,margin,mine.py:Mine --only --full
    """
    from aerodaas.extensions.leaderboard.command import leaderboard as rank  # noqa: PLC0415 - slow to load

    names = [name.strip() for name in ",".join(scheduler or []).split(",") if name.strip()]
    rank(names, full=full, only=only, jobs=jobs, address=address, out=out)
