"""`aerodaas replay`: a recorded flight through an application's graph once more."""

from __future__ import annotations

import json
import time
from itertools import islice
from pathlib import Path
from typing import Annotated

import typer

from aerodaas.cli.flying.application import run_application, speed_option
from aerodaas.cli.recordings.report import Recorded
from aerodaas.cli.shipped import find_application
from aerodaas.config.options import RunOptions
from aerodaas.errors import MissionError
from aerodaas.text.printable import printable

__all__ = ["replay"]

_LOSSY = {"jpeg", "h264"}


def replay(
    context: typer.Context,
    recording: Recorded,
    app: Annotated[Path, typer.Option(help="The application: a Python file.")],
    scheduler: Annotated[
        str | None, typer.Option(help="Analytics scheduler instead of the application's own.")
    ] = None,
    model: Annotated[
        Path | None, typer.Option(help="ONNX model for every detector, instead of its own.")
    ] = None,
    env: Annotated[
        Path | None,
        typer.Option(
            help="Environment file for what no recording may bring: plug-ins, packages, "
            "endpoints, nodes."
        ),
    ] = None,
    speed: Annotated[str, typer.Option(help="Mission seconds per wall second, or `max`.")] = "max",
    out: Annotated[
        Path | None, typer.Option(help="Folder for the new recording. Default: one in runs/.")
    ] = None,
    address: Annotated[str | None, typer.Option(help="Ray cluster to join.")] = None,
    view: Annotated[bool, typer.Option(help="Show the live view.")] = False,  # noqa: FBT002
) -> None:
    """Feed a recording's sensors through an application, and say how its decisions differ.

    No vehicle is touched. Of the recorded environment only geometry, ids, rates and calibration
    are taken. Words after `--` are the application's own.

        aerodaas replay flight.mcap --app farm_survey
        aerodaas replay flight.mcap --app follow.py --model other.onnx
        aerodaas replay flight.mcap --app follow.py --scheduler gems
    """
    from aerodaas.environment.recording_paths import recording_folder  # noqa: PLC0415 - slow to load
    from aerodaas.recording.pictures import shots  # noqa: PLC0415
    from aerodaas.recording.reader import Recording  # noqa: PLC0415
    from aerodaas.recording.recorded_environment import (  # noqa: PLC0415
        left_out,
        recorded_content,
    )
    from aerodaas.recording.report.difference import difference  # noqa: PLC0415 - slow to load

    with Recording.open(recording) as opened:
        missing = left_out(recorded_content(opened))
        duration = opened.duration
        lossy = any(shot.format in _LOSSY for shot in islice(shots(opened), 1))
    if missing:
        typer.echo(
            f"not taken from the recording: {printable(', '.join(missing))}; "
            + (f"{env} says what is taken instead" if env else "give them with --env FILE")
        )
    app = find_application(app)
    folder = out or recording_folder(f"replay-{app.stem}")
    factor, simulated_time = speed_option(speed)
    options = RunOptions(
        environment=env,
        replay=recording.resolve(),
        scheduler=scheduler,
        model=model.resolve() if model else None,
        speed=factor,
        simulated_time=simulated_time,
        record=folder,
        address=address,
        view=view,
        application=app.resolve(),
    )
    began = time.monotonic()
    try:
        run_application(app, context.args, options)
    except MissionError as error:
        # As it may have in flight; what was decided until then is worth comparing all the same.
        typer.echo(f"the replayed mission ended badly: {error}")
    took = time.monotonic() - began
    found = difference(recording, folder / "flight.mcap")
    (folder / "difference.json").write_text(json.dumps(found.as_dict(), indent=2) + "\n")
    if not found.agrees and lossy:
        typer.echo("the pictures were recorded with loss, so that a detector sees a little else;")
        typer.echo('record with "images": "png" for a replay that is exact')
    typer.echo(
        f"replayed {duration:.1f} s in {took:.1f} s, start included; compared:\n"
        + printable(str(found))
    )
