"""Files of an emulated autopilot, and the server of MAVLink FTP that reads them."""

from __future__ import annotations

import errno
import struct
from collections.abc import Callable
from typing import Any, NamedTuple

from aerodaas.drivers.mavlink.wire.dialect import mavlink

__all__ = ["FileServer"]

_HEADER = struct.Struct("<HBBBBBBI")
_DATA = 239
_BURST = 100
"""Packets of a burst: the sockets of loopback hold no more."""
_PAGE = 4
"""Entries of a listing in one packet."""
_POLYNOMIAL = 0xEDB88320
_SEQUENCES = 0x10000
_SESSION = 3
"""The server's to choose, as PX4's does; ArduPilot's takes the client's."""


class _Request(NamedTuple):
    """What a client asks for."""

    sequence: int
    session: int
    opcode: int
    size: int
    offset: int
    path: str

    @classmethod
    def unpack(cls, payload: bytes) -> _Request:
        """Read a payload."""
        sequence, session, opcode, size, _, _, _, offset = _HEADER.unpack_from(payload)
        path = payload[_HEADER.size : _HEADER.size + size].split(b"\0")[0].decode()
        return cls(sequence, session, opcode, size, offset, path)

    def reply(
        self, content: bytes, count: int = 0, *, at: int = 0, complete: bool = False
    ) -> bytes:
        """The answer, `count` packets after the first."""
        return self._packed(mavlink.MAV_FTP_OPCODE_ACK, content, count, at, complete=complete)

    def open(self, size: int) -> bytes:
        """The answer that names the session and the file's size."""
        return self._replace(session=_SESSION).reply(struct.pack("<I", size))

    def refuse(self, *code: int, count: int = 0) -> bytes:
        """The refusal, `count` packets after the first."""
        return self._packed(mavlink.MAV_FTP_OPCODE_NAK, bytes(code), count)

    def _packed(
        self, kind: int, content: bytes, count: int, at: int = 0, *, complete: bool = False
    ) -> bytes:
        number = (self.sequence + 1 + count) % _SEQUENCES
        header = _HEADER.pack(
            *(number, self.session, kind, len(content), self.opcode, complete, 0, at)
        )
        return (header + content).ljust(_HEADER.size + _DATA, b"\0")


class FileServer:
    """Files by their path, one session at a time; the answers of both families alike."""

    def __init__(self) -> None:
        self.files: dict[str, bytes] = {}
        self._open: bytes | None = None
        self._replied: tuple[bytes, list[bytes]] = (b"", [])
        self._answerers: dict[int, Callable[[_Request], list[bytes]]] = {
            mavlink.MAV_FTP_OPCODE_TERMINATESESSION: self._terminated,
            mavlink.MAV_FTP_OPCODE_RESETSESSION: self._terminated,
            mavlink.MAV_FTP_OPCODE_LISTDIRECTORY: self._listed,
            mavlink.MAV_FTP_OPCODE_OPENFILERO: self._opened,
            mavlink.MAV_FTP_OPCODE_CALCFILECRC: self._summed,
            mavlink.MAV_FTP_OPCODE_READFILE: self._read,
            mavlink.MAV_FTP_OPCODE_BURSTREADFILE: self._burst,
        }

    def handle(self, message: Any) -> list[Any]:  # noqa: ANN401 - pymavlink has no types
        """The answers to a FILE_TRANSFER_PROTOCOL."""
        peer = (message.get_srcSystem(), message.get_srcComponent())
        return [
            mavlink.MAVLink_file_transfer_protocol_message(0, *peer, answer)
            for answer in self.answer(bytes(message.payload))
        ]

    def restart(self) -> None:
        """Forget what was open."""
        self._open, self._replied = None, (b"", [])

    def answer(self, payload: bytes) -> list[bytes]:
        """The payloads that answer to one; to a repeated one, those of before."""
        if payload != self._replied[0]:
            request = _Request.unpack(payload)
            answerer = self._answerers.get(request.opcode)
            unknown = [request.refuse(mavlink.MAV_FTP_ERR_UNKNOWNCOMMAND)]
            self._replied = payload, unknown if answerer is None else answerer(request)
        return self._replied[1]

    def _terminated(self, request: _Request) -> list[bytes]:
        self._open = None
        return [request.reply(b"")]

    def _listed(self, request: _Request) -> list[bytes]:
        told = self.listing(request.path.rstrip("/") + "/")
        if not told:
            return [request.refuse(mavlink.MAV_FTP_ERR_FAILERRNO, errno.ENOENT)]
        page = b"\0".join(told[request.offset : request.offset + _PAGE])
        if not page:
            return [request.refuse(mavlink.MAV_FTP_ERR_EOF)]
        return [request.reply(page + b"\0", at=request.offset)]

    def _opened(self, request: _Request) -> list[bytes]:
        if self._open is not None:
            return [request.refuse(mavlink.MAV_FTP_ERR_NOSESSIONSAVAILABLE)]
        if request.path not in self.files:
            return [request.refuse(mavlink.MAV_FTP_ERR_FILENOTFOUND)]
        self._open = self.files[request.path]
        return [request.open(self.size(request.path))]

    def _summed(self, request: _Request) -> list[bytes]:
        if request.path not in self.files:
            return [request.refuse(mavlink.MAV_FTP_ERR_FILENOTFOUND)]
        return [request.reply(struct.pack("<I", self.checksum(request.path)))]

    def _read(self, request: _Request) -> list[bytes]:
        if self._open is None or request.session != _SESSION:
            return [request.refuse(mavlink.MAV_FTP_ERR_INVALIDSESSION)]
        content = self._open[request.offset : request.offset + request.size]
        if not content:
            return [request.refuse(mavlink.MAV_FTP_ERR_EOF)]
        return [request.reply(content, at=request.offset)]

    def _burst(self, request: _Request) -> list[bytes]:
        if self._open is None or request.session != _SESSION:
            return [request.refuse(mavlink.MAV_FTP_ERR_INVALIDSESSION)]
        end = min(request.offset + _BURST * request.size, len(self._open))
        starts = range(request.offset, end, request.size)
        sent = [
            request.reply(
                self._open[at : min(at + request.size, end)],
                count,
                at=at,
                complete=at + request.size >= end,
            )
            for count, at in enumerate(starts)
        ]
        if end == len(self._open):
            sent.append(request.refuse(mavlink.MAV_FTP_ERR_EOF, count=len(sent)))
        return sent

    def size(self, name: str) -> int:
        """Bytes that it is said to have."""
        return len(self.files[name])

    def checksum(self, name: str) -> int:
        """Its CRC-32, bit by bit as the autopilots define it."""
        crc = 0
        for byte in self.files[name]:
            crc ^= byte
            for _ in range(8):
                crc = (crc >> 1) ^ (_POLYNOMIAL if crc & 1 else 0)
        return crc

    def listing(self, folder: str) -> list[bytes]:
        """Entries of a folder, among them one that cannot be told; empty if there is none."""
        inside = sorted(path[len(folder) :] for path in self.files if path.startswith(folder))
        folders = dict.fromkeys(path.split("/")[0] for path in inside if "/" in path)
        files = [path for path in inside if "/" not in path]
        told = [b"S", *(f"D{name}".encode() for name in folders)]
        told += [f"F{path}\t{self.size(folder + path)}".encode() for path in files]
        return told if inside else []
