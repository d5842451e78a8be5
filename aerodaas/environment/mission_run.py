"""What an environment asks of a flight, whether its own runtime flies it or a provider."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import Protocol

from aerodaas.config.model import EnvironmentConfig
from aerodaas.config.options import RunOptions
from aerodaas.mission.commands import Answer, Command

__all__ = ["MissionRun", "recording_folder", "recording_path"]

_RECORDING = "flight.mcap"


class MissionRun(Protocol):
    """One flight of an application, from its graph to its recording."""

    on_end: list[Callable[[], None]]
    """Called once the flight has ended and its recording is closed."""

    @property
    def over(self) -> bool:
        """True once every mission has ended."""
        ...

    def start(self) -> None:
        """Start, and return once the drones fly; raises the project's errors."""
        ...

    def command(self, robot: str, command: Command) -> Answer:
        """Send a robot's mission a command.

        Args:
            robot: Id of the robot.
            command: The command, carried out as a whole.

        Returns:
            The robot's answer.

        Raises:
            MissionError: Once the run is over.
        """
        ...

    def wait(self) -> None:
        """Return when the flight has ended; raises the error that it ended with."""
        ...


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
