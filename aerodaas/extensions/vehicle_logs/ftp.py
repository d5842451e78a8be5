"""Client of MAVLink's file transfer (FTP), without a link and without a clock.

What it does is a script: a generator that yields each `Turn`, the packets to be sent now and the
second until which to wait, and is sent what came, or None at that second, with the time of it.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass, replace
from itertools import islice
from typing import NamedTuple, TypeAlias, TypeVar

from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.errors import VehicleError

__all__ = ["FtpClient", "FtpEntry", "FtpPacket", "FtpRefusedError", "FtpScript", "Turn"]

_HEADER = struct.Struct("<HBBBBBxI")
"""Sequence, session, opcode, size, opcode of the request, end of a burst, offset."""
_DATA = 239
"""Most bytes of data in a packet."""
_PAYLOAD = _HEADER.size + _DATA
_LENGTH = struct.Struct("<I")

_TIMEOUT = 1.0
"""Seconds without anything new after which is asked again."""
_TRIES = 6
"""Times that is asked without anything new."""
_PAUSE = 1.0
"""Seconds to wait for others to end their transfer; ArduPilot ends one that rests for three."""
_READS = 4
"""Pieces asked for at once; ArduPilot queues five requests."""
_WINDOW = 1 << 18
"""Bytes that may come ahead of one that is missing: twice ArduPilot's burst."""
_MOST_ENTRIES = 10_000
"""Entries of a folder, more than an autopilot keeps logs."""
_SUMMED = 1e6
"""Bytes a second that an autopilot reads at least in six tries, to tell their checksum."""

_ACK, _NAK = mavlink.MAV_FTP_OPCODE_ACK, mavlink.MAV_FTP_OPCODE_NAK
_READ, _BURST = mavlink.MAV_FTP_OPCODE_READFILE, mavlink.MAV_FTP_OPCODE_BURSTREADFILE
_EOF = mavlink.MAV_FTP_ERR_EOF
_LOST = frozenset({mavlink.MAV_FTP_ERR_INVALIDSESSION, mavlink.MAV_FTP_ERR_FILENOTFOUND})
"""Answers to reading in a session that has ended, as after a restart."""
_BUSY = frozenset(
    {
        mavlink.MAV_FTP_ERR_FAIL,
        mavlink.MAV_FTP_ERR_INVALIDSESSION,
        mavlink.MAV_FTP_ERR_NOSESSIONSAVAILABLE,
    }
)
"""Answers to opening a file while another one is open."""
_REASONS = {
    mavlink.MAV_FTP_ERR_FAIL: "it failed",
    mavlink.MAV_FTP_ERR_INVALIDDATASIZE: "the request is too long for it",
    mavlink.MAV_FTP_ERR_INVALIDSESSION: "another program transfers files",
    mavlink.MAV_FTP_ERR_NOSESSIONSAVAILABLE: "another program transfers files",
    mavlink.MAV_FTP_ERR_EOF: "there is no more",
    mavlink.MAV_FTP_ERR_UNKNOWNCOMMAND: "it does not know how",
    mavlink.MAV_FTP_ERR_FILEPROTECTED: "it may not be read",
    mavlink.MAV_FTP_ERR_FILENOTFOUND: "there is none",
}


class FtpRefusedError(VehicleError):
    """The vehicle answered, and refused."""

    def __init__(self, deed: str, packet: FtpPacket) -> None:
        """Say that it refused `deed` by `packet`."""
        self.code = packet.content[0] if packet.content else 0
        """MAV_FTP_ERR."""
        reason = _REASONS.get(self.code, f"error {packet.content.hex(' ') or 'not told'}")
        super().__init__(f"the autopilot does not {deed}: {reason}")


class FtpEntry(NamedTuple):
    """One entry of a folder on the vehicle."""

    name: str
    """Never a way out of the folder."""
    size: int | None
    """Bytes; None: it is a folder."""


@dataclass(frozen=True, slots=True)
class FtpPacket:
    """The payload of one FILE_TRANSFER_PROTOCOL."""

    opcode: int
    sequence: int = 0
    session: int = 0
    size: int = 0
    """Bytes of `content`, or those asked for."""
    request: int = 0
    """Opcode of what is answered."""
    complete: bool = False
    """Whether it ends a burst."""
    offset: int = 0
    content: bytes = b""

    def pack(self) -> bytes:
        """Its 251 bytes."""
        header = _HEADER.pack(
            *(self.sequence, self.session, self.opcode, self.size),
            *(self.request, self.complete, self.offset),
        )
        return (header + self.content).ljust(_PAYLOAD, b"\0")

    @classmethod
    def unpack(cls, payload: bytes) -> FtpPacket | None:
        """Read an answer; None if it is none."""
        if len(payload) < _HEADER.size:
            return None
        sequence, session, opcode, size, request, complete, offset = _HEADER.unpack_from(payload)
        content = payload[_HEADER.size : _HEADER.size + size]
        if opcode not in {_ACK, _NAK} or len(content) < size:
            return None
        return cls(opcode, sequence, session, size, request, bool(complete), offset, content)


class Turn(NamedTuple):
    """Packets that a script sends next, and how long it waits for the answer."""

    packets: tuple[FtpPacket, ...]
    """To be sent now."""
    until: float
    """The second at which it goes on though nothing has come."""


_T = TypeVar("_T")
FtpScript: TypeAlias = Generator[Turn, tuple[FtpPacket | None, float], _T]
"""A script that ends with a value, or with VehicleError."""


class _SessionLostError(Exception):
    """The file is no longer open."""


class FtpClient:
    """One client of a vehicle's file transfer, with one script at a time; seconds of any clock."""

    def __init__(self) -> None:
        """Have nothing open."""
        self.now = 0.0
        """The present second, to be set before a script begins; from then on the script sets it."""
        self._sequence = 0
        self._session = 0

    def entries(self, folder: str) -> FtpScript[list[FtpEntry]]:
        """Script: the files and folders of `folder`, in the vehicle's own order.

        Raises VehicleError if there is no such folder (FtpRefusedError), or no answer.
        """
        found: list[FtpEntry] = []
        offset = 0
        while offset < _MOST_ENTRIES:
            reply = yield from self._ask(
                mavlink.MAV_FTP_OPCODE_LISTDIRECTORY, content=_bytes(folder), offset=offset
            )
            told = [entry for entry in reply.content.split(b"\0") if entry]
            if reply.opcode == _NAK and reply.content[:1] != bytes([_EOF]):
                raise FtpRefusedError(f"list {folder}", reply)
            if reply.opcode == _NAK or not told:
                return found
            offset += len(told)
            found += filter(None, map(_entry, told))
        raise VehicleError(f"the autopilot tells of more than {_MOST_ENTRIES} files in {folder}")

    def read(
        self, path: str, size: int, sink: Callable[[bytes], object], begin: int = 0
    ) -> FtpScript[None]:
        """Script: give a file's bytes to `sink`, in their order.

        Lost packets are asked for again, and the file is opened again where the vehicle has closed
        it.

        Args:
            path: Path on the vehicle.
            size: Size of the file, bytes.
            sink: Called with the bytes.
            begin: First byte to read, from 0.

        Raises:
            VehicleError: If the file has another size, or the vehicle stops sending.
        """
        yield from self._open(path, size)
        pieces = _Pieces(begin, size, sink)
        tries, singly = 0, False
        while not pieces.whole:
            if tries == _TRIES:
                raise VehicleError(
                    f"the autopilot stopped sending {path} at byte {pieces.at} of {size}; try "
                    "again nearer to it, or by another link"
                )
            tries += 1
            try:
                grew, ended = yield from self._gather(path, pieces, self._wanted(pieces, singly))
            except _SessionLostError:
                yield from self._open(path, size)
                continue
            # Where a burst ends early, its last packets were overtaken, or the file is shorter.
            tries, singly = 0 if grew else tries, ended

    def checksum(self, path: str, size: int) -> FtpScript[int | None]:
        """Script: the CRC-32 of a file; None where the vehicle tells none.

        Polynomial of IEEE 802.3, reflected, from zero and not inverted, as both autopilots have it.

        Args:
            path: Path on the vehicle.
            size: Size of the file, bytes, by which the time-out is reckoned.

        Raises:
            VehicleError: If the vehicle refuses or does not answer.
        """
        reply = yield from self._ask(
            mavlink.MAV_FTP_OPCODE_CALCFILECRC,
            content=_bytes(path),
            reckoning=size / _SUMMED / _TRIES,
        )
        if reply.opcode == _ACK and len(reply.content) >= _LENGTH.size:
            return int(_LENGTH.unpack_from(reply.content)[0])
        refusal = FtpRefusedError(f"tell the checksum of {path}", reply)
        if refusal.code == mavlink.MAV_FTP_ERR_UNKNOWNCOMMAND:
            return None
        raise refusal

    def farewell(self) -> FtpPacket:
        """Packet that ends the session; its answer need not be awaited."""
        return self._request(mavlink.MAV_FTP_OPCODE_TERMINATESESSION)

    def _open(self, path: str, size: int) -> FtpScript[None]:
        for again in range(_TRIES):
            reply = yield from self._ask(mavlink.MAV_FTP_OPCODE_OPENFILERO, content=_bytes(path))
            if reply.opcode == _ACK and len(reply.content) >= _LENGTH.size:
                self._session = reply.session
                (told,) = _LENGTH.unpack_from(reply.content)
                if told != size:
                    raise VehicleError(
                        f"{path} has {told} bytes, and was said to have {size}: it is still being "
                        "written; list the logs again"
                    )
                return
            refusal = FtpRefusedError(f"open {path}", reply)
            if refusal.code not in _BUSY or again == _TRIES - 1:
                raise refusal
            if again == _TRIES - 2:
                # Nobody has ended it in all this time: it may be what a cut link has left behind.
                yield from self._ask(mavlink.MAV_FTP_OPCODE_RESETSESSION)
            else:
                yield from self._rest(self.now + _PAUSE)

    def _wanted(self, pieces: _Pieces, singly: bool) -> tuple[FtpPacket, ...]:  # noqa: FBT001
        """Requests for what is missing before what has come, or else for all that follows."""
        gaps = list(islice(pieces.gaps(), _READS))
        if singly and not gaps:
            gaps = [(pieces.at, min(_DATA, pieces.size - pieces.at))]
        if gaps:
            return tuple(self._request(_READ, offset=at, size=size) for at, size in gaps)
        return (self._request(_BURST, offset=pieces.at, size=_DATA),)

    def _gather(
        self, path: str, pieces: _Pieces, requests: tuple[FtpPacket, ...]
    ) -> FtpScript[tuple[bool, bool]]:
        """Whether the requests brought anything new, and whether the file was said to end."""
        waiting = {_answer(one) for one in requests if one.opcode == _READ}
        bursts, grew = not waiting, False
        until = self.now + _TIMEOUT
        while (waiting or bursts) and not pieces.whole:
            packet = yield from self._exchange(until, *requests)
            requests = ()
            if packet is None:
                break
            if packet.opcode == _NAK:
                if packet.request == _READ and packet.sequence in waiting:
                    self._require_open(path, pieces.size, packet)
                elif packet.request == _BURST and bursts:
                    self._require_open(path, None, packet)
                    return grew, True
            elif packet.request in {_READ, _BURST} and packet.session == self._session:
                if pieces.add(packet.offset, packet.content):
                    grew, until = True, self.now + _TIMEOUT
                waiting.discard(packet.sequence)
                bursts = bursts and not (packet.request == _BURST and packet.complete)
        return grew, False

    @staticmethod
    def _require_open(path: str, size: int | None, packet: FtpPacket) -> None:
        """Raise for a refusal to read, unless it is the end of a file whose `size` is not given."""
        refusal = FtpRefusedError(f"send {path}", packet)
        if refusal.code in _LOST:
            raise _SessionLostError
        if refusal.code != _EOF:
            raise refusal
        if size is not None:
            raise VehicleError(
                f"{path} ends before byte {size}, and was said to have {size}: list the logs again"
            )

    def _ask(
        self, opcode: int, *, content: bytes = b"", offset: int = 0, reckoning: float = 0.0
    ) -> FtpScript[FtpPacket]:
        """The answer to a request that takes `reckoning` seconds; it is repeated until it comes."""
        request = self._request(opcode, size=len(content), offset=offset)
        request = replace(request, content=content)
        for _ in range(_TRIES):
            until = self.now + _TIMEOUT + reckoning
            packet = yield from self._exchange(until, request)
            while packet is not None:
                if packet.sequence == _answer(request) and packet.request == opcode:
                    return packet
                packet = yield from self._exchange(until)
        raise VehicleError("the autopilot does not answer when asked for its files")

    def _rest(self, until: float) -> FtpScript[None]:
        while (yield from self._exchange(until)) is not None:
            pass

    def _exchange(self, until: float, *packets: FtpPacket) -> FtpScript[FtpPacket | None]:
        packet, self.now = yield Turn(packets, until)
        return packet

    def _request(self, opcode: int, *, size: int = 0, offset: int = 0) -> FtpPacket:
        # Each has its own number: to a repeated one, the last answer is repeated.
        self._sequence = (self._sequence + 1) % 0x10000
        return FtpPacket(opcode, self._sequence, self._session, size, offset=offset)


class _Pieces:
    """Puts pieces of a file into their order, and knows which are missing."""

    def __init__(self, begin: int, size: int, sink: Callable[[bytes], object]) -> None:
        self.at = begin
        """All bytes before this one are there."""
        self.size = size
        self._sink = sink
        self._ahead: dict[int, bytes] = {}

    @property
    def whole(self) -> bool:
        return self.at >= self.size

    def add(self, offset: int, content: bytes) -> bool:
        """Add a piece; returns whether it has anything new."""
        content = content[: max(0, self.size - offset)]
        known = len(self._ahead.get(offset, b""))
        ends = offset + len(content)
        if ends <= self.at or len(content) <= known or ends > self.at + _WINDOW:
            return False
        self._ahead[offset] = content
        if offset <= self.at:
            self._drain()
        return True

    def _drain(self) -> None:
        for offset in sorted(self._ahead):
            if offset > self.at:
                break
            piece = self._ahead.pop(offset)[self.at - offset :]
            self._sink(piece)
            self.at += len(piece)

    def gaps(self) -> Iterator[tuple[int, int]]:
        """Begin and bytes of what is missing before what has come, in pieces of one packet."""
        at = self.at
        for offset in sorted(self._ahead):
            while at < offset:
                step = min(_DATA, offset - at)
                yield at, step
                at += step
            at = max(at, offset + len(self._ahead[offset]))


def _answer(request: FtpPacket) -> int:
    """The sequence of an answer to it."""
    return (request.sequence + 1) % 0x10000


def _bytes(path: str) -> bytes:
    encoded = path.encode()
    if len(encoded) > _DATA:
        raise VehicleError(f"no file's path is as long as {path!r}")
    return encoded


def _entry(told: bytes) -> FtpEntry | None:
    """One entry of a listing; None for what cannot be read, and for ways out of the folder."""
    kind, (name, _, size) = told[:1], told[1:].decode("utf-8", "replace").partition("\t")
    if not name.strip(".") or "/" in name or "\\" in name:
        return None
    if kind == b"D":
        return FtpEntry(name, None)
    # Python also takes digits of other scripts, underscores and signs for numbers.
    if kind == b"F" and size.isascii() and size.isdigit():
        return FtpEntry(name, int(size))
    return None
