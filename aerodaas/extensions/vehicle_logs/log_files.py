"""The autopilot's logs as files on its card, fetched by MAVLink FTP."""

from __future__ import annotations

import contextlib
import queue
import time
import zlib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TypeVar

from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.drivers.mavlink.wire.link import MavlinkLink, Message
from aerodaas.errors import VehicleError
from aerodaas.extensions.vehicle_logs.ftp import (
    FtpClient,
    FtpEntry,
    FtpPacket,
    FtpRefusedError,
    FtpScript,
)

__all__ = ["FileTransfer", "fetch_file", "find_file"]

_STEP = 1 << 15
"""Bytes between two calls of `progress`."""
_BLOCK = 1 << 20
_INVERTED = 0xFFFFFFFF

_T = TypeVar("_T")


class FileTransfer:
    """MAVLink FTP over a link, by blocking calls; not for use in the link's thread."""

    def __init__(self, link: MavlinkLink) -> None:
        """Send nothing yet."""
        self._link = link
        self._client = FtpClient()

    def entries(self, folder: str) -> list[FtpEntry]:
        """Files and folders of a folder; raises VehicleError."""
        return self._run(self._client.entries(folder))

    def read(self, path: str, size: int, sink: Callable[[bytes], object], begin: int = 0) -> None:
        """Give a file's bytes to `sink`, in order.

        Args:
            path: Path on the vehicle.
            size: Size of the file, bytes.
            sink: Called with the bytes.
            begin: First byte to read, from 0.

        Raises:
            VehicleError: As `FtpClient.read`.
        """
        try:
            self._run(self._client.read(path, size, sink, begin))
        finally:
            self._send(self._client.farewell())

    def size(self, path: str) -> int | None:
        """Bytes that a file has now, None if it is not there; raises VehicleError."""
        folder, _, name = path.rpartition("/")
        return next((one.size for one in self.entries(folder) if one.name == name), None)

    def checksum(self, path: str, size: int) -> int | None:
        """CRC-32 of a file by the vehicle's own reckoning, None if it tells none.

        Args:
            path: Path on the vehicle.
            size: Size of the file, bytes.

        Raises:
            VehicleError: As `FtpClient.checksum`.
        """
        return self._run(self._client.checksum(path, size))

    def _run(self, script: FtpScript[_T]) -> _T:
        self._client.now = time.monotonic()
        with self._link.listen("FILE_TRANSFER_PROTOCOL") as inbox:
            try:
                turn = next(script)
                while True:
                    for packet in turn.packets:
                        self._send(packet)
                    heard = _heard(inbox, turn.until)
                    turn = script.send((heard, time.monotonic()))
            except StopIteration as ended:
                value: _T = ended.value
                return value

    def _send(self, packet: FtpPacket) -> None:
        self._link.send(
            mavlink.MAVLink_file_transfer_protocol_message(0, *self._link.target, packet.pack())
        )


def find_file(transfer: FileTransfer, folders: Sequence[str], suffix: str, size: int) -> str | None:
    """Path of a file on the vehicle, which is told by its size alone.

    Args:
        transfer: MAVLink FTP with the vehicle.
        folders: Where it may lie; the first that is there counts, with the folders in it.
        suffix: End of its name, in small letters.
        size: Its bytes.

    Returns:
        None if no file has that size, as while it is written, or several have.

    Raises:
        VehicleError: If the vehicle does not answer.
    """
    for folder in folders:
        with contextlib.suppress(FtpRefusedError):
            found = [
                path
                for path, bytes_there in _files(transfer, folder)
                if bytes_there == size and path.lower().endswith(suffix)
            ]
            return found[0] if len(found) == 1 else None
    return None


def fetch_file(
    transfer: FileTransfer,
    path: str,
    size: int,
    file: Path,
    part: Path,
    progress: Callable[[int, int], None] = lambda _, __: None,
) -> None:
    """Fetch `path` from the vehicle into `file`, whole or not at all.

    A file that has grown meanwhile, as a log that is not ended does, has no checksum of these
    bytes.

    Args:
        transfer: MAVLink FTP with the vehicle.
        path: Path on the vehicle.
        size: Size of the file, bytes.
        file: Path on this machine.
        part: Holds what has come while it is not whole, and is where the next fetch goes on.
        progress: Called with the bytes fetched and of all bytes.

    Raises:
        VehicleError: If the vehicle stops sending, or its own checksum is another one.
        OSError: If the file or its part cannot be written.
    """
    held = part.stat().st_size if part.is_file() else 0
    for begin in dict.fromkeys((held if held <= size else 0, 0)):
        with part.open("r+b" if begin else "wb") as output:
            output.truncate(begin)
            output.seek(begin)
            try:
                transfer.read(path, size, _Sink(output.write, begin, size, progress), begin)
            except VehicleError as error:
                raise VehicleError(f"{error}; the next fetch goes on from {part}") from None
        told = transfer.checksum(path, size)
        # What was held may be of another vehicle, and without a checksum nobody would know.
        if told == _checksum(part) or (
            begin == 0 and (told is None or (transfer.size(path) or 0) > size)
        ):
            part.replace(file)
            return
    part.unlink()
    raise VehicleError(
        f"{path} has another checksum on the vehicle: it was damaged on the way, or is still being "
        "written; fetch it again"
    )


class _Sink:
    """Writes what comes, and tells the progress now and then."""

    def __init__(
        self,
        write: Callable[[bytes], object],
        done: int,
        size: int,
        progress: Callable[[int, int], None],
    ) -> None:
        self._write = write
        self._done, self._size = done, size
        self._told = done
        self._progress = progress
        progress(done, size)

    def __call__(self, content: bytes) -> None:
        self._write(content)
        self._done += len(content)
        if self._done - self._told >= _STEP or self._done == self._size:
            self._told = self._done
            self._progress(self._done, self._size)


def _files(transfer: FileTransfer, folder: str) -> Iterator[tuple[str, int]]:
    """Path and size of each file in a folder, and in the folders of it: PX4 has one a day."""
    for entry in transfer.entries(folder):
        path = f"{folder}/{entry.name}"
        if entry.size is not None:
            yield path, entry.size
            continue
        for inner in transfer.entries(path):
            if inner.size is not None:
                yield f"{path}/{inner.name}", inner.size


def _checksum(file: Path) -> int:
    """CRC-32 of a file as MAVLink has it: neither begun nor ended by an inversion."""
    crc = _INVERTED
    with file.open("rb") as content:
        while block := content.read(_BLOCK):
            crc = zlib.crc32(block, crc)
    return crc ^ _INVERTED


def _heard(inbox: queue.SimpleQueue[Message], until: float) -> FtpPacket | None:
    """The next answer before the second `until`."""
    while (left := until - time.monotonic()) > 0.0:
        try:
            packet = FtpPacket.unpack(bytes(inbox.get(timeout=left).payload))
        except queue.Empty:
            break
        if packet is not None:
            return packet
    return None
