"""Where a flight is recorded."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

from aerodaas.config.model import EnvironmentConfig
from aerodaas.config.options import RunOptions

__all__ = ["recording_folder", "recording_path"]

_RECORDING = "flight.mcap"


def recording_path(options: RunOptions, config: EnvironmentConfig, number: int) -> Path | None:
    """Path of the recording of one flight of an environment.

    Args:
        options: Options of the run, whose `record` goes before the environment's path.
        config: Environment that flies.
        number: Number of its flight, from 1; a later flight's number ends the file's name.

    Returns:
        The path, or None if the flight is not recorded.
    """
    if not config.recording.enabled:
        return None
    wanted = options.record or (Path(config.recording.path) if config.recording.path else None)
    if wanted is None:
        wanted = recording_folder(options.application.stem if options.application else config.name)
    path = wanted if wanted.suffix == ".mcap" else wanted / _RECORDING
    # One environment may fly several times.
    return path if number == 1 else path.with_stem(f"{path.stem}-{number}")


def recording_folder(name: str) -> Path:
    """Folder for what is recorded from now on under `name`, where none is asked for."""
    now = datetime.now().astimezone()
    return Path("runs") / f"{name}-{now:%Y%m%d-%H%M%S}"
