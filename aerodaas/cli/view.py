"""`aerodaas view`: a recording played in a browser."""

from __future__ import annotations

import threading
from typing import Annotated

import typer

from aerodaas.cli.report import Recorded

__all__ = ["view"]


def view(
    recording: Recorded,
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

    Ctrl-C ends it.

        aerodaas view runs/farm_survey-20260101-120000/flight.mcap
        aerodaas view flight.mcap --at 63.5
    """
    from aerodaas.config.extras import require_extra  # noqa: PLC0415 - only here

    require_extra("remote", "aerodaas view")
    from aerodaas.actors.run.checks import check_served  # noqa: PLC0415 - slow to load
    from aerodaas.console.viewer import RecordingServer  # noqa: PLC0415 - slow to load
    from aerodaas.recording.reader import Recording  # noqa: PLC0415 - as above

    check_served("--address", address)
    opened = Recording.open(recording)
    try:
        server = RecordingServer(address, opened, typer.echo)
    except BaseException:
        opened.close()
        raise
    moment = "" if at is None else f"&t={at:g}"
    typer.echo(f"console: open {server.address(viewer=True)}{moment}")
    try:
        threading.Event().wait()
    except KeyboardInterrupt:
        typer.echo("closed")
    finally:
        server.close()
