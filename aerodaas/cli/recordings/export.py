"""`aerodaas export`: a recording for other programs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated

import typer

from aerodaas.cli.deferred import deferred_group
from aerodaas.cli.recordings.report import Recorded
from aerodaas.config.extensions import Command, extensions
from aerodaas.recording.reader import Recording
from aerodaas.text.printable import printable

__all__ = ["Folder", "app", "csv", "export", "formats", "parquet", "topics"]

Folder = Annotated[
    Path | None, typer.Option("--out", help="Folder for the files. Default: the recording's own.")
]
_Topics = Annotated[
    list[str], typer.Argument(metavar="TOPIC…", help="Channels, as `topics` lists them.")
]
_CORE = (
    Command("topics", "aerodaas.cli.recordings.export:topics", "List the channels of a recording."),
    Command("csv", "aerodaas.cli.recordings.export:csv", "Write channels as CSV."),
    Command("parquet", "aerodaas.cli.recordings.export:parquet", "Write channels as Parquet."),
)


def formats() -> tuple[Command, ...]:
    """Every format: the core's, then those of extensions."""
    return (*_CORE, *(one for extension in extensions().values() for one in extension.exports))


app = typer.Typer(
    cls=deferred_group(formats),
    # Typer takes an application without a command for a mistake.
    callback=lambda: None,
    no_args_is_help=True,
    rich_markup_mode="markdown",
    help="""Write parts of a recording for other programs.

    aerodaas export topics flight.mcap
    aerodaas export csv flight.mcap /tello/state /decisions/decision
    aerodaas export mp4 flight.mcap
""",
)


def export(
    recording: Path, out: Path | None, write: Callable[[Recording, Path], Sequence[Path | str]]
) -> None:
    """Write files from a recording, and print what was written.

    Args:
        recording: The recording's file.
        out: Folder for the files; None for the recording's own.
        write: Writes the files of the recording into the folder; returns their paths, or lines to
            print.

    Raises:
        RecordingError: If the recording cannot be read, or a file cannot be written.
    """
    with Recording.open(recording) as opened:
        lines = [str(line) for line in write(opened, out or recording.parent)]
        if opened.damaged:
            lines.append(f"skipped {opened.damaged} broken messages or chunks")
    typer.echo("\n".join(lines))


def topics(recording: Recorded) -> None:
    """List the channels of a recording.

    aerodaas export topics flight.mcap
    """
    export(recording, None, lambda opened, _: _channels(opened))


def csv(recording: Recorded, topic: _Topics, out: Folder = None) -> None:
    """Write channels as CSV.

    aerodaas export csv flight.mcap /tello/state /decisions/decision
    """
    from aerodaas.recording.tables import write_csv  # noqa: PLC0415 - slow to load

    export(recording, out, lambda opened, to: [write_csv(opened, one, to) for one in topic])


def parquet(recording: Recorded, topic: _Topics, out: Folder = None) -> None:
    """Write channels as Parquet.

    aerodaas export parquet flight.mcap /tello/state
    """
    from aerodaas.recording.tables import write_parquet  # noqa: PLC0415 - slow to load

    export(recording, out, lambda opened, to: [write_parquet(opened, one, to) for one in topic])


def _channels(recording: Recording) -> list[str]:
    found = sorted(recording.topics.values(), key=lambda topic: topic.name)
    return [printable(f"{topic.count:>9}  {topic.name}  {topic.schema}") for topic in found]
