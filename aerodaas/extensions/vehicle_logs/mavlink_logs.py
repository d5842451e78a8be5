"""List and download of the autopilot's own logs, by LOG_REQUEST_DATA."""

from __future__ import annotations

import contextlib
import queue
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import datetime, timezone
from functools import partial
from pathlib import Path
from typing import Any

from aerodaas.drivers.mavlink.autopilots.ardupilot import ArduPilot
from aerodaas.drivers.mavlink.autopilots.autopilot import older_than
from aerodaas.drivers.mavlink.autopilots.px4 import PX4
from aerodaas.drivers.mavlink.vehicle import MavlinkVehicle
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.drivers.mavlink.wire.link import MavlinkLink
from aerodaas.errors import VehicleError
from aerodaas.extensions.vehicle_logs.dataflash import DATAFLASH_HEAD
from aerodaas.extensions.vehicle_logs.log_service import LogEntry
from aerodaas.extensions.vehicle_logs.ulog import ULOG_HEAD

__all__ = ["MavlinkLogs"]

_TIMEOUT = 1.0
"""Seconds of silence after which is asked again."""
_TRIES = 6
"""Times that is asked without anything new."""
_PACKET = 90
"""Bytes of a LOG_DATA."""
_WINDOW = 400 * _PACKET
"""Bytes asked for at once: half a second of a fast link, and few to ask for again."""
_LARGEST = 4 << 30
"""Bytes of a log that no card of an autopilot exceeds."""
_LAST = 0xFFFF
_FORM = "%Y%m%d-%H%M%S"

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class _LogFormat:
    """Logs of one family of autopilots."""

    suffix: str
    head: bytes
    """The first bytes of a file."""
    begin_until: tuple[int, int]
    """Version from which the time that the autopilot tells of a log is when it was last written;
    before, when it began."""


_FORMATS = {
    PX4.name: _LogFormat(".ulg", ULOG_HEAD, (1, 16)),
    ArduPilot.name: _LogFormat(".bin", DATAFLASH_HEAD, (0, 0)),
}


class MavlinkLogs:
    """Logs of the autopilot of a connected MAVLink vehicle, as `LogService`; on the ground only."""

    def __init__(self, vehicle: MavlinkVehicle) -> None:
        """Ask nothing yet."""
        self._vehicle = vehicle
        self._autopilot = vehicle.connection.autopilot.name
        self._format = _FORMATS[self._autopilot]

    def logs(self) -> list[LogEntry]:
        """The autopilot's logs, oldest first; blocks.

        Raises:
            VehicleError: If the vehicle flies, does not answer, or tells not all of its logs.
        """
        link = self._vehicle.grounded_link("list logs")
        ends = not older_than(self._vehicle.telemetry.software, *self._format.begin_until)
        found: dict[int, LogEntry] = {}
        total: int | None = None
        with link.listen("LOG_ENTRY") as inbox:
            for _ in range(_TRIES):
                link.send(mavlink.MAVLink_log_request_list_message(*link.target, 0, _LAST))
                for entry in _heard(inbox, _TIMEOUT):
                    total = entry.num_logs
                    if total:
                        told = entry.time_utc or None
                        times = (None, told) if ends else (told, None)
                        found[entry.id] = LogEntry(entry.id, entry.size, *times)
                    if len(found) >= entry.num_logs:
                        return [found[number] for number in sorted(found)]
        if total is None:
            raise VehicleError("the autopilot does not answer when asked for its logs")
        raise VehicleError(f"the autopilot told {len(found)} of its {total} logs only; try again")

    def fetch_log(
        self, log: LogEntry, folder: Path, progress: Progress = lambda _, __: None
    ) -> Path:
        """Fetch a log into a file of `folder`, whole or not at all; blocks.

        Packets that are lost are asked for again.

        Args:
            log: The log, as the vehicle lists it.
            folder: Made where it is missing.
            progress: Called with the bytes fetched and of all bytes.

        Returns:
            Path of the file.

        Raises:
            VehicleError: If the vehicle does not stand, or the log cannot be fetched.
        """
        grounded = partial(self._vehicle.grounded_link, "fetch logs")

        def told(done: int, size: int) -> None:
            grounded()
            progress(done, size)

        link, form = grounded(), self._format
        if not 0 < log.size <= _LARGEST:
            raise VehicleError(
                f"log {log.number} has {log.size} bytes, which is none to be fetched"
            )
        file = folder / f"log-{log.number}{_when(log)}{form.suffix}"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            _write(link, log, file, told)
            with file.open("rb") as written:
                head = written.read(len(form.head))
        except OSError as error:
            raise VehicleError(f"cannot write {file}: {error}") from None
        if head != form.head:
            raise VehicleError(
                f"{file} is on the vehicle as it was fetched, and is no log of {self._autopilot}: "
                "its card may be damaged"
            )
        return file


def _write(link: MavlinkLink, log: LogEntry, file: Path, progress: Progress) -> None:
    part = file.with_name(f"{file.name}.part")
    try:
        with part.open("wb") as output, link.listen("LOG_DATA") as inbox:
            for begin in range(0, log.size, _WINDOW):
                end = min(log.size, begin + _WINDOW)
                output.write(_fetch(link, inbox, log, begin, end))
                progress(end, log.size)
        part.replace(file)
    finally:
        part.unlink(missing_ok=True)
        # Some autopilots write no log, and send nothing else, before they are told.
        link.send(mavlink.MAVLink_log_request_end_message(*link.target))


def _fetch(
    link: MavlinkLink, inbox: queue.SimpleQueue[Any], log: LogEntry, begin: int, end: int
) -> bytes:
    """Bytes `begin` to `end` of a log."""
    content = bytearray(end - begin)
    missing = set(range(begin, end, _PACKET))
    tries = 0
    while missing:
        if tries == _TRIES:
            raise VehicleError(
                f"the autopilot stopped sending log {log.number} at byte {min(missing)} of "
                f"{log.size}; try again nearer to it, or by another link"
            )
        tries += 1
        first, last = min(missing), min(end, max(missing) + _PACKET)
        link.send(
            mavlink.MAVLink_log_request_data_message(*link.target, log.number, first, last - first)
        )
        for packet in _heard(inbox, _TIMEOUT):
            if packet.id != log.number or packet.ofs not in missing:
                continue
            wanted = min(_PACKET, end - packet.ofs)
            if packet.count < wanted:
                raise VehicleError(
                    f"log {log.number} ends at byte {packet.ofs + packet.count}, and was said to "
                    f"have {log.size}: list the logs again"
                )
            at = packet.ofs - begin
            content[at : at + wanted] = bytes(packet.data[:wanted])
            missing.discard(packet.ofs)
            tries = 0
            if not missing:
                break
    return bytes(content)


def _heard(inbox: queue.SimpleQueue[Any], timeout: float) -> Iterator[Any]:
    """Messages until none has come for `timeout` seconds, and for ten times that at most."""
    until = time.monotonic() + 10.0 * timeout
    with contextlib.suppress(queue.Empty):
        while time.monotonic() < until:
            yield inbox.get(timeout=timeout)


def _when(log: LogEntry) -> str:
    time = log.ended if log.began is None else log.began
    return "" if time is None else f"-{datetime.fromtimestamp(time, timezone.utc):{_FORM}}"
