"""Transports: UDP, TCP and serial, none of which blocks for long."""

from __future__ import annotations

import contextlib
import errno
import ipaddress
import os
import socket
import termios
import time
import tty
from collections.abc import Callable
from functools import partial
from typing import Protocol

from aerodaas.drivers.pin import Peer
from aerodaas.errors import ConfigError, VehicleError

__all__ = ["Transport", "is_exposed", "open_transport"]

_LARGEST = 65535
_LARGEST_PORT = 65535
_LARGEST_BAUD = 9_999_999
_AT_ONCE = 256
"""Most datagrams received in one turn."""
_RETRY = 1.0
"""Seconds between attempts to reach a TCP server or a serial device again."""


class Transport(Protocol):
    """One transport."""

    def fileno(self) -> int:
        """File descriptor to wait for; -1 while the wire is cut."""
        ...

    def receive(self) -> list[tuple[bytes, Peer]]:
        """Received bytes by sender; never blocks."""
        ...

    def send(self, packet: bytes, peers: tuple[Peer, ...]) -> None:
        """Send a packet; drops unsendable ones.

        Args:
            packet: The packet's bytes.
            peers: Addresses to send to, if the wire has several.
        """
        ...

    def close(self) -> None:
        """Close the wire."""
        ...


def open_transport(url: str, name: str) -> Transport:
    """Open a transport of MAVLink.

    Args:
        url: udpin:HOST:PORT, udpout:HOST:PORT, tcp:HOST:PORT or serial:DEVICE:BAUD.
        name: Id of the robot, for errors.

    Raises:
        ConfigError: If the address is invalid.
        VehicleError: If the address cannot be opened.
    """
    kind, _, rest = url.partition(":")
    host, _, number = rest.rpartition(":")
    largest = _LARGEST_BAUD if kind == "serial" else _LARGEST_PORT
    known = kind in {"udpin", "udpout", "tcp", "serial"}
    if not (known and host and number.isdecimal() and len(number) <= len(str(largest))):
        raise ConfigError(
            f"{name}: {url!r} is no address; write udpin:HOST:PORT, udpout:HOST:PORT, "
            "tcp:HOST:PORT or serial:DEVICE:BAUD"
        )
    if int(number) > largest:
        raise ConfigError(f"{name}: {url!r}: {number} is too large, {largest} is the largest")
    try:
        if kind == "serial":
            return _Serial(host, int(number))
        if kind == "tcp":
            return _Tcp(host, int(number))
        return _Udp(host, int(number), listens=kind == "udpin")
    except (OSError, ValueError) as error:
        raise VehicleError(f"{name}: {_explain(error, url, number)}") from None


def is_exposed(url: str) -> bool:
    """Whether `url` is on a network, where others can send: neither loopback nor a serial line."""
    kind, _, rest = url.partition(":")
    if kind == "serial":
        return False
    host = rest.rpartition(":")[0]
    try:
        found = {str(one[4][0]) for one in socket.getaddrinfo(host, None)}
    except OSError:
        return True
    return not all(ipaddress.ip_address(one).is_loopback for one in found)


def _explain(error: Exception, url: str, number: str) -> str:
    code = error.errno if isinstance(error, OSError) else None
    reasons = {
        errno.EADDRINUSE: (
            f"port {number} is taken by another program; `ss -ulnp sport = :{number}` shows by "
            "which (a ground station? have one of the two forward to the other)"
        ),
        errno.ECONNREFUSED: "no program listens there; is the autopilot or its simulation running?",
        errno.EACCES: "no permission (for a serial device: `sudo usermod -aG dialout $USER`)",
        errno.EPERM: "no permission",
        errno.ENOENT: "no such device; `ls /dev/serial/by-id` lists them",
        errno.EADDRNOTAVAIL: "that is no address of this host; `ip address` lists them",
    }
    text = reasons.get(code or 0) or (str(error) or type(error).__name__)
    return f"cannot open {url}: {text}"


class _Udp:
    def __init__(self, host: str, port: int, *, listens: bool) -> None:
        self._listens = listens
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.settimeout(0.0)
            if listens:
                self._socket.bind((host, port))
            else:
                # The system filters packets of other senders.
                self._socket.connect((host, port))
        except BaseException:
            self._socket.close()
            raise

    def fileno(self) -> int:
        return self._socket.fileno()

    def receive(self) -> list[tuple[bytes, Peer]]:
        arrived: list[tuple[bytes, Peer]] = []
        for _ in range(_AT_ONCE):
            try:
                content, sender = self._socket.recvfrom(_LARGEST)
            except ConnectionError:
                # The system reports here that an earlier datagram reached no socket.
                continue
            except OSError:
                break
            arrived.append((content, sender))
        return arrived

    def send(self, packet: bytes, peers: tuple[Peer, ...]) -> None:
        if not self._listens:
            with contextlib.suppress(OSError):
                self._socket.send(packet)
            return
        for peer in peers:
            if peer is not None:
                with contextlib.suppress(OSError):
                    self._socket.sendto(packet, peer)

    def close(self) -> None:
        self._socket.close()


class _Packets:
    """Whole packets into a stream of bytes that may be full: half of one would spoil the next."""

    def __init__(self) -> None:
        self._rest = b""
        """Of a packet whose beginning has been sent."""

    def clear(self) -> None:
        """Begin anew, on a new stream."""
        self._rest = b""

    def send(self, packet: bytes, write: Callable[[bytes], int]) -> None:
        """Send the rest of the packet before, then this one; it is dropped if there is no room.

        `write` returns how many bytes were taken, and raises OSError for none.
        """
        for waiting in (self._rest, packet):
            if not waiting:
                continue
            try:
                taken = write(waiting)
            except OSError:
                return
            self._rest = waiting[taken:] if taken else self._rest
            if taken < len(waiting):
                return


class _Tcp:
    def __init__(self, host: str, port: int) -> None:
        self._packets = _Packets()
        self._server: tuple[str, int] = (host, port)
        self._socket: socket.socket | None = self._connected()
        self._tried_at = time.monotonic()

    def _connected(self) -> socket.socket:
        opened = socket.create_connection(self._server, timeout=_RETRY)
        opened.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        opened.settimeout(0.0)
        self._packets.clear()
        # A name may resolve to another host later; it is not the vehicle's.
        self._server = opened.getpeername()[:2]
        return opened

    def fileno(self) -> int:
        return -1 if self._socket is None else self._socket.fileno()

    def receive(self) -> list[tuple[bytes, Peer]]:
        if self._socket is None:
            self._reconnect()
            return []
        try:
            content = self._socket.recv(_LARGEST)
        except BlockingIOError:
            return []
        except OSError:
            content = b""
        if content:
            return [(content, None)]
        self._drop()
        return []

    def _reconnect(self) -> None:
        now = time.monotonic()
        if now - self._tried_at >= _RETRY:
            self._tried_at = now
            with contextlib.suppress(OSError):
                self._socket = self._connected()

    def _drop(self) -> None:
        if self._socket is not None:
            self._socket.close()
        self._socket = None

    def send(self, packet: bytes, peers: tuple[Peer, ...]) -> None:
        del peers
        if self._socket is not None:
            self._packets.send(packet, self._socket.send)

    def close(self) -> None:
        self._drop()


class _Serial:
    def __init__(self, device: str, baud: int) -> None:
        self._device = device
        self._packets = _Packets()
        speed = getattr(termios, f"B{baud}", None)
        if speed is None:
            raise OSError(errno.EINVAL, f"{baud} is no speed of a serial line, such as 57600")
        self._speed: int = speed
        self._file = self._opened()
        self._tried_at = time.monotonic()

    def _opened(self) -> int:
        file = os.open(self._device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            tty.setraw(file)
            attributes = termios.tcgetattr(file)
            attributes[4] = attributes[5] = self._speed
            termios.tcsetattr(file, termios.TCSANOW, attributes)
        except termios.error as error:
            os.close(file)
            raise OSError(*error.args) from None
        self._packets.clear()
        return file

    def fileno(self) -> int:
        return self._file

    def receive(self) -> list[tuple[bytes, Peer]]:
        if self._file < 0:
            now = time.monotonic()
            if now - self._tried_at >= _RETRY:
                self._tried_at = now
                with contextlib.suppress(OSError):
                    self._file = self._opened()
            return []
        try:
            content = os.read(self._file, _LARGEST)
        except BlockingIOError:
            return []
        except OSError:
            content = b""
        if content:
            return [(content, None)]
        self.close()
        return []

    def send(self, packet: bytes, peers: tuple[Peer, ...]) -> None:
        del peers
        if self._file >= 0:
            self._packets.send(packet, partial(os.write, self._file))

    def close(self) -> None:
        file, self._file = self._file, -1
        if file >= 0:
            os.close(file)
