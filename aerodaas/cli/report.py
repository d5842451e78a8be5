"""`aerodaas report` and `aerodaas compare`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from aerodaas.config.printable import printable

__all__ = ["compare", "report"]

Recorded = Annotated[Path, typer.Argument(help="The .mcap file of a run.", show_default=False)]


def report(
    recording: Recorded,
    out: Annotated[
        Path | None, typer.Option(help="Folder for the report. Default: the recording's own.")
    ] = None,
) -> None:
    """Write a recording's report: one HTML page, its plots as PNG, and the figures as JSON.

    aerodaas report runs/farm_survey-20260101-120000/flight.mcap
    """
    from aerodaas.recording.report.report import (  # noqa: PLC0415 - matplotlib is slow to load
        write_report,
    )

    files = write_report(recording, out or recording.parent)
    lines = [str(files.summary), *(f"  {log}" for log in files.logs)]
    typer.echo(printable("\n".join(lines)) + f"\n{files.page}")


def compare(
    first: Recorded,
    second: Recorded,
    out: Annotated[Path, typer.Option(help="The page to write.")] = Path("compare.html"),
) -> None:
    """Set two recordings side by side in one HTML page.

    aerodaas compare runs/a/flight.mcap runs/b/flight.mcap --out a-b.html
    """
    from aerodaas.recording.report.comparison import write_comparison  # noqa: PLC0415 - as above

    typer.echo(write_comparison(first, second, out))
