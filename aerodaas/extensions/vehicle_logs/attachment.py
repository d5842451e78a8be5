"""Vehicles' logs as attachments of a recording."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

from aerodaas.clock import NANOSECONDS
from aerodaas.errors import AeroDaaSError, RecordingError
from aerodaas.extensions.vehicle_logs.alignment import (
    Alignment,
    RecordedClock,
    align,
    recorded_clocks,
    robot_of,
)
from aerodaas.extensions.vehicle_logs.attaching import attach_file
from aerodaas.extensions.vehicle_logs.log import VehicleLog
from aerodaas.extensions.vehicle_logs.reading import MAX_LOG, read_vehicle_log
from aerodaas.recording.reader import Recording
from aerodaas.text.printable import printable

__all__ = ["AttachedLog", "attach_log", "attached_logs", "flight_of"]

_FOLDER = "vehicle_logs"
_MEDIA = {"ArduPilot": "application/x-dataflash", "PX4": "application/x-ulog"}


@dataclass(frozen=True, slots=True)
class AttachedLog:
    """A vehicle's log that is attached to a recording."""

    robot: str
    file: str
    """Name of the file that was attached."""
    log: VehicleLog | None
    alignment: Alignment | None
    """Neither is known of one that cannot be read."""
    trouble: str = ""
    """Why it cannot be shown; empty if it can."""

    def __str__(self) -> str:
        if self.log is None or self.alignment is None:
            return f"{self.file} of {self.robot} is not shown: {self.trouble}"
        damage = f"; {self.log.damage}" if self.log.damage else ""
        return f"{self.file} of {self.robot} ({self.log.autopilot}) {self.alignment}{damage}"


def attach_log(recording: Path, file: Path, robot: str | None = None) -> AttachedLog:
    """Attach a vehicle's log to the recording of its flight, which is replaced whole or not at all.

    Args:
        recording: The MCAP file.
        file: The log: DataFlash of ArduPilot or ULog of PX4.
        robot: Whose log it is; None for the only robot with an autopilot's clock.

    Returns:
        The log, and how it lies over the recording.

    Raises:
        RecordingError: If either cannot be read, they are not of the same flight, the log is
            attached already, or the disk is full; the recording is then as it was.
        ConfigError: If the log is a ULog, and the extra `logs` is missing.
        UnknownIdError: If the recording has no such robot.
    """
    with Recording.open(recording) as opened:
        clocks = recorded_clocks(opened)
        try:
            robot = robot_of(clocks, robot)
        except RecordingError as error:
            raise RecordingError(f"{recording}: {error}") from None
        epoch = opened.epoch_ns
    log, alignment = _laid_over(file, str(file), clocks[robot])
    begin = max(0, epoch + round(alignment.begin * NANOSECONDS))
    name = f"{_FOLDER}/{robot}/{printable(file.name)}"
    attach_file(recording, file, name, _MEDIA[log.autopilot], begin)
    return AttachedLog(robot, file.name, log, alignment)


def attached_logs(recording: Recording) -> list[AttachedLog]:
    """Read the vehicles' logs that are attached to a recording, laid over its clock."""
    names = [name for name in recording.attachments if name.startswith(f"{_FOLDER}/")]
    if not names:
        return []
    clocks = recorded_clocks(recording)
    return [_attached(recording, name, clocks) for name in names]


def flight_of(recording: Path, robot: str) -> tuple[float, float]:
    """When a robot flew in a recording: from arming to disarming, seconds since the Unix epoch.

    Args:
        recording: Path of the recording.
        robot: Id of the robot.

    Raises:
        RecordingError: If the recording cannot be read, or has no clock of the robot's autopilot.
        UnknownIdError: If the recording has no such robot.
    """
    with Recording.open(recording) as opened:
        clocks = recorded_clocks(opened)
        begin, end = clocks[robot_of(clocks, robot)].flown
        began = opened.epoch_ns / NANOSECONDS
    return began + begin, began + end


def _attached(recording: Recording, name: str, clocks: dict[str, RecordedClock]) -> AttachedLog:
    _, _, rest = name.partition("/")
    robot, _, file = rest.partition("/")
    try:
        recorded = clocks[robot_of(clocks, robot)]
        with tempfile.TemporaryDirectory(prefix="aerodaas-log-") as folder:
            copy = Path(folder) / "log"
            recording.extract(name, copy, MAX_LOG)
            log, alignment = _laid_over(copy, file, recorded)
    except (AeroDaaSError, OSError) as error:
        return AttachedLog(robot, file, None, None, str(error))
    return AttachedLog(robot, file, log, alignment)


def _laid_over(file: Path, name: str, recorded: RecordedClock) -> tuple[VehicleLog, Alignment]:
    log = read_vehicle_log(file, name)
    try:
        return log, align(log, recorded)
    except RecordingError as error:
        raise RecordingError(f"{name} {error}") from None
