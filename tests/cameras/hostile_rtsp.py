"""An RTSP server on loopback that does to its client what no camera does, and a child that looks.

    python hostile_rtsp.py BYTES SECONDS

opens each of them at once with so much memory, as a camera's process does, and prints what came of
it as JSON: the error by kind, and the bytes that it took at its most.
"""

from __future__ import annotations

import json
import resource
import socket
import struct
import sys
import threading
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from fractions import Fraction
from functools import cache
from itertools import count
from multiprocessing import get_context

import av
import numpy as np

from aerodaas.cameras.live import LiveSource
from aerodaas.config.secrets import SecretUrl
from aerodaas.errors import SourceError
from aerodaas.runtime.memory_limit import limit_memory

_OK = b"RTSP/1.0 200 OK\r\nCSeq: %s\r\nSession: 1\r\n"
_SDP = (
    b"v=0\r\no=- 0 0 IN IP4 127.0.0.1\r\ns=x\r\nt=0 0\r\nm=video 0 RTP/AVP 96\r\n"
    b"a=rtpmap:96 H264/90000\r\na=fmtp:96 packetization-mode=1\r\na=control:t\r\n"
)
_FRAGMENT = 0x7C, 28
"""First byte of a fragment of a NAL unit (RFC 6184), and its type."""
_TAKEN = 1400
"""Bytes of a unit that travel in one packet."""


class Server:
    """Serves `kind` to each that connects, until they hang up."""

    def __init__(self, kind: Callable[[socket.socket], None]) -> None:
        """Listen on a loopback port."""
        self._kind = kind
        self._socket = socket.create_server(("127.0.0.1", 0))
        threading.Thread(target=self._accept, daemon=True).start()

    @property
    def url(self) -> str:
        """Its address."""
        return f"rtsp://127.0.0.1:{self._socket.getsockname()[1]}/x"

    def _accept(self) -> None:
        while True:
            client, _ = self._socket.accept()
            threading.Thread(target=self._serve, args=(client,), daemon=True).start()

    def _serve(self, client: socket.socket) -> None:
        with client:
            try:
                self._kind(client)
            except OSError:
                return


def silent(client: socket.socket) -> None:
    """Answer nothing."""
    while client.recv(4096):
        pass


def headers(client: socket.socket) -> None:
    """Answer by lines without an end."""
    client.sendall(_OK % b"1")
    while True:
        client.sendall(b"X-Line: " + b"x" * 1000 + b"\r\n")


def body(client: socket.socket) -> None:
    """Announce a description of 2 GB, and send it."""
    _, number, _ = request(client)
    client.sendall(_OK % number + b"Public: DESCRIBE, SETUP, PLAY\r\n\r\n")
    _, number, _ = request(client)
    client.sendall(
        _OK % number + b"Content-Type: application/sdp\r\nContent-Length: 2000000000\r\n\r\n"
    )
    while True:
        client.sendall(b"a=x:" + b"y" * 60000 + b"\r\n")


def no_video(client: socket.socket) -> None:
    """Play, and send reports only."""
    play(client)
    while not threading.Event().wait(0.1):
        client.sendall(b"$\1\0\x08\x80\xc9\0\1\0\0\0\7")


def fragments(client: socket.socket) -> None:
    """Send one picture, and then fragments of the next one without an end."""
    play(client)
    packets = count()
    for unit in _picture(64, 48):
        client.sendall(rtp_packet(unit, next(packets)))
    first = 0x80
    while True:
        head = bytes([_FRAGMENT[0], first | 5])
        client.sendall(rtp_packet(head + b"\x55" * 60000, next(packets)))
        first = 0


def huge(client: socket.socket) -> None:
    """Send pictures of 134 million pixels, each of 100 kB."""
    play(client)
    packets = count()
    while True:
        for unit in huge_picture():
            for packet in fragmented(unit):
                client.sendall(rtp_packet(packet, next(packets)))


KINDS = (silent, headers, body, no_video, fragments, huge)


def request(client: socket.socket) -> tuple[bytes, bytes, bytes]:
    """The next request's verb and number, and all of it."""
    data = b""
    while b"\r\n\r\n" not in data:
        more = client.recv(4096)
        if not more:
            raise OSError("the client has hung up")
        data += more
    return data.split(b" ")[0], data.partition(b"CSeq: ")[2].split(b"\r\n")[0], data


def play(client: socket.socket, accepts: Callable[[bytes], bool] = bool) -> None:
    """Answer as a camera does that `accepts` a transport or not, until it is to play."""
    verb = b""
    while verb != b"PLAY":
        verb, number, whole = request(client)
        if verb == b"SETUP" and not accepts(whole):
            client.sendall(b"RTSP/1.0 461 Unsupported transport\r\nCSeq: %s\r\n\r\n" % number)
            continue
        more = {
            b"OPTIONS": b"Public: DESCRIBE, SETUP, PLAY\r\n\r\n",
            b"DESCRIBE": b"Content-Type: application/sdp\r\nContent-Length: %d\r\n\r\n" % len(_SDP)
            + _SDP,
            b"SETUP": b"Transport: RTP/AVP/TCP;unicast;interleaved=0-1\r\n\r\n",
        }
        client.sendall(_OK % number + more.get(verb, b"\r\n"))


def rtp_packet(
    payload: bytes, number: int, time: int | None = None, *, last: bool = False
) -> bytes:
    """An interleaved RTP packet, the `last` one of its picture or not, at `time` in 1/90,000 s."""
    time = 3000 * number if time is None else time
    kind = 96 | last << 7
    head = struct.pack(">BBHII", 0x80, kind, number & 0xFFFF, time & 0xFFFFFFFF, 7)
    return b"$\0" + struct.pack(">H", len(head) + len(payload)) + head + payload


def fragmented(unit: bytes) -> list[bytes]:
    """Payloads by which a NAL unit travels."""
    if len(unit) <= _TAKEN:
        return [unit]
    head, rest = unit[0], unit[1:]
    parts = [rest[place : place + _TAKEN] for place in range(0, len(rest), _TAKEN)]
    marks = [0x80, *[0] * (len(parts) - 2), 0x40]
    kind = head & 0xE0 | _FRAGMENT[1]
    return [
        bytes([kind, mark | head & 0x1F]) + part for mark, part in zip(marks, parts, strict=True)
    ]


def _picture(width: int, height: int) -> list[bytes]:
    """NAL units of one grey picture."""
    encoder = av.CodecContext.create("libx264", "w")
    encoder.width, encoder.height, encoder.pix_fmt = width, height, "yuv420p"
    encoder.time_base, encoder.thread_count = Fraction(1, 30), 1
    encoder.options = {
        "preset": "ultrafast",
        "tune": "zerolatency",
        "x264-params": "repeat-headers=1:sliced-threads=0:slices=1",
    }
    frame = av.VideoFrame.from_ndarray(np.full((height * 3 // 2, width), 99, np.uint8), "yuv420p")
    content = b"".join(bytes(packet) for packet in encoder.encode(frame))
    return [unit.rstrip(b"\0") for unit in content.split(b"\0\0\1") if unit.strip(b"\0")]


@cache
def huge_picture() -> list[bytes]:
    """NAL units of a picture of 134 million pixels; encoded elsewhere, as that takes memory."""
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        return pool.submit(_picture, 16384, 8192).result()


def _look(server: Server, seconds: float) -> str:
    """Look for a picture for so long; wait for the source's own thread in the end."""
    source = LiveSource(SecretUrl(server.url), timeout=seconds)
    try:
        source.open()
    except SourceError as error:
        return type(error).__name__
    finally:
        source.close()
        thread = source._thread
        if thread is not None:
            thread.join()
    return ""


def main(most: int, seconds: float) -> None:
    """Look at all of them at once."""
    huge_picture()
    servers = [Server(kind) for kind in KINDS]
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    limit_memory(most)
    with ThreadPoolExecutor(len(servers)) as pool:
        errors = list(pool.map(lambda one: _look(one, seconds), servers))
    took = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    found = {kind.__name__: error for kind, error in zip(KINDS, errors, strict=True)}
    sys.stdout.write(json.dumps({"errors": found, "bytes": 1024 * took}) + "\n")


if __name__ == "__main__":
    main(int(sys.argv[1]), float(sys.argv[2]))
