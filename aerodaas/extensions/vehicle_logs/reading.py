"""Reading a vehicle's log, by what its first bytes say that it is."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from aerodaas.errors import RecordingError
from aerodaas.extensions.vehicle_logs.dataflash import DATAFLASH_HEAD, read_dataflash
from aerodaas.extensions.vehicle_logs.log import Series, Topic, VehicleLog
from aerodaas.extensions.vehicle_logs.ulog import ULOG_HEAD, read_ulog

__all__ = ["MAX_LOG", "read_vehicle_log"]

MAX_LOG = 1 << 30
"""Bytes of a vehicle's own log, attached or in a file; an hour of them takes 20 to 500 million."""

_FARTHEST = 1e8
"""More than any figure of a vehicle, in metres, volts or degrees."""


def read_vehicle_log(file: Path, name: str = "") -> VehicleLog:
    """Read the main topics of a log of ArduPilot (DataFlash) or PX4 (ULog).

    Args:
        file: The log.
        name: What errors call it; its path by default.

    Raises:
        RecordingError: If it cannot be read, is empty, too large, of no autopilot or broken from
            its beginning.
        ConfigError: If it is a ULog, and the extra `logs` is missing.
    """
    name = name or str(file)
    try:
        size = file.stat().st_size
        with file.open("rb") as opened:
            head = opened.read(len(ULOG_HEAD))
    except OSError as error:
        raise RecordingError(f"cannot read the log {name}: {error.strerror}") from None
    if not head:
        raise RecordingError(f"{name} is empty: the vehicle wrote no log; fetch another one")
    if size > MAX_LOG:
        raise RecordingError(
            f"{name} has {size} bytes, more than the {MAX_LOG} of a log that is read; have "
            "the vehicle log less, or each flight in a log of its own"
        )
    try:
        # What is damaged may be any number.
        with np.errstate(invalid="ignore", over="ignore"):
            if head.startswith(DATAFLASH_HEAD):
                return _sane(read_dataflash(file.read_bytes()))
            if head.startswith(ULOG_HEAD):
                return _sane(read_ulog(file))
    except RecordingError as error:
        raise RecordingError(f"{name} {error}") from None
    raise RecordingError(
        f"{name} is no log of an autopilot: neither DataFlash (.bin of ArduPilot, not the .tlog of "
        "a ground station) nor ULog (.ulg of PX4)"
    )


def _sane(log: VehicleLog) -> VehicleLog:
    """`log`, without figures that no vehicle has: a plot would show nothing beside them.

    Raises RecordingError if its times are no numbers.
    """
    if not np.isfinite(log.span).all():
        raise RecordingError("holds times that are no numbers: it is damaged; fetch it again")
    topics: dict[Topic, Series] = {}
    for topic, series in log.topics.items():
        columns = {
            name: np.where(np.abs(values) <= _FARTHEST, values, np.nan)
            for name, values in series.columns.items()
        }
        topics[topic] = Series(series.time, columns)
    return replace(log, topics=topics)
