"""`aerodaas report` and `view`: what a recording shows."""

from __future__ import annotations

import contextlib
import threading
from pathlib import Path
from typing import Annotated

import typer

from aerodaas.text.printable import printable

__all__ = ["report", "view"]

Recorded = Annotated[Path, typer.Argument(help="The .mcap file of a run.", show_default=False)]


def report(
    recording: Recorded,
    other: Annotated[
        Path | None, typer.Argument(help="Another one, set beside it.", show_default=False)
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder for the report. Default: the recording's own.")
    ] = None,
) -> None:
    """Write a recording's report: one HTML page, its plots as PNG, and the figures as JSON.

    Of two recordings, one page `compare.html` sets them side by side.

        aerodaas report runs/farm_survey-20260101-120000/flight.mcap
        aerodaas report dems/flight.mcap edf/flight.mcap --out .
    """
    folder = out or recording.parent
    if other is not None:
        from aerodaas.recording.report.comparison import (  # noqa: PLC0415 - as below
            write_comparison,
        )

        typer.echo(write_comparison(recording, other, folder / "compare.html"))
        return
    from aerodaas.recording.report.report import (  # noqa: PLC0415 - matplotlib is slow to load
        write_report,
    )

    files = write_report(recording, folder)
    lines = [str(files.summary), *(f"  {section.text}" for section in files.sections)]
    typer.echo(printable("\n".join(lines)) + f"\n{files.page}")


def view(
    recording: Recorded,
    beside: Annotated[
        Path | None, typer.Argument(help="Another one, played beside it.", show_default=False)
    ] = None,
    *,
    at: Annotated[
        float | None, typer.Option(min=0, help="Mission seconds at which it opens.")
    ] = None,
    address: Annotated[
        str,
        typer.Option(
            help="Where the page is served; beyond this machine its token goes unencrypted."
        ),
    ] = "127.0.0.1:8361",
) -> None:
    """Play a recording in a browser: map, video, state and charts, by one timeline.

    Two of them side by side, at the same mission time. Ctrl-C ends it.

        aerodaas view runs/farm_survey-20260101-120000/flight.mcap
        aerodaas view flight.mcap --at 63.5
        aerodaas view dems/flight.mcap edf/flight.mcap
    """
    from aerodaas.config.extras import require_extra  # noqa: PLC0415 - only here

    require_extra("remote", "aerodaas view")
    from aerodaas.recording.reader import Recording  # noqa: PLC0415 - as above
    from aerodaas.runtime.checks import check_served  # noqa: PLC0415 - slow to load
    from aerodaas.service.own.recordings import RecordingServer  # noqa: PLC0415 - slow to load

    check_served("--address", address)
    with contextlib.ExitStack() as opened:
        paths = [recording] if beside is None else [recording, beside]
        recordings = [opened.enter_context(Recording.open(path)) for path in paths]
        server = RecordingServer(address, recordings, typer.echo)
        opened.pop_all()  # the server closes them
    typer.echo(f"console: open {server.address_of(at)}")
    try:
        threading.Event().wait()
    except KeyboardInterrupt:
        typer.echo("closed")
    finally:
        server.close()
