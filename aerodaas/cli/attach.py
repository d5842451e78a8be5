"""`aerodaas attach`: an autopilot's own log into the recording of its flight."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from aerodaas.config.printable import printable

__all__ = ["attach"]


def attach(
    recording: Annotated[
        Path, typer.Argument(help="The .mcap file of the run.", show_default=False)
    ],
    log: Annotated[
        Path,
        typer.Argument(help="The log: .bin of ArduPilot or .ulg of PX4.", show_default=False),
    ],
    robot: Annotated[
        str | None,
        typer.Option(help="Whose log it is. Default: the only robot with an autopilot."),
    ] = None,
) -> None:
    """Attach an autopilot's own log to the recording of its flight, its clock laid over.

    `aerodaas report` draws its main topics then. `aerodaas logs ROBOT --attach RECORDING` fetches
    the log from the vehicle first.

    aerodaas attach runs/survey-20260101-120000/flight.mcap 00000012.BIN
    """
    from aerodaas.recording.vehicle_log.attachment import (  # noqa: PLC0415 - slow to load
        attach_log,
    )

    typer.echo(printable(str(attach_log(recording, log, robot))))
