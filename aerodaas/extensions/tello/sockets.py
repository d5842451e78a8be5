"""UDP sockets of one Tello on this host, with errors that name the remedy."""

from __future__ import annotations

import errno
import os
import socket

from aerodaas.errors import AeroDaaSError

__all__ = ["bound_socket", "datagrams"]

_LARGEST = 65535
_AT_ONCE = 256
"""Most datagrams received in one turn."""


def bound_socket(
    place: str,
    port: int,
    *,
    address: str = "",
    interface: str = "",
    receive_buffer: int | None = None,
    raises: type[AeroDaaSError],
) -> socket.socket:
    """Open a non-blocking UDP socket of this host.

    Args:
        place: What needs it, for errors.
        port: 0 for any.
        address: Of this host; empty for all.
        interface: Network interface; empty for any.
        receive_buffer: Bytes; None for the system's default.
        raises: Class of the error where it cannot be opened.
    """
    opened = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        opened.settimeout(0.0)
        if receive_buffer is not None:
            opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_buffer)
        if interface:
            opened.setsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, interface.encode())
        opened.bind((address, port))
    except OSError as error:
        opened.close()
        raise raises(f"{place}: {_explain(error, address, port, interface)}") from None
    return opened


def _explain(error: OSError, address: str, port: int, interface: str) -> str:
    if error.errno == errno.EADDRINUSE:
        return (
            f"UDP port {port} is taken by another program or another Tello of this host; "
            f"`ss -ulnp sport = :{port}` shows by whom (docs/tello.md: several Tellos)"
        )
    if error.errno == errno.EADDRNOTAVAIL:
        return f"{address} is no address of this host; `ip address` lists them"
    if error.errno == errno.ENODEV:
        return f"no network interface is called {interface!r}; `ip link` lists them"
    if error.errno in {errno.EPERM, errno.EACCES}:
        return f"not allowed to use UDP port {port} {interface}: {os.strerror(error.errno)}"
    return f"cannot open UDP port {port}: {error.strerror or error}"


def datagrams(source: socket.socket) -> list[tuple[bytes, str, int]]:
    """Received datagrams: content, sender's address, sender's port; never blocks."""
    arrived = []
    for _ in range(_AT_ONCE):
        try:
            content, (address, port) = source.recvfrom(_LARGEST)
        except BlockingIOError:
            break
        except ConnectionError:
            # The system reports here that an earlier datagram reached no socket.
            continue
        arrived.append((content, address, port))
    return arrived
