"""Handshake with a cluster's head before Ray joins it: reachability, encryption and token.

Ray tries for minutes to join a head that cannot be reached, and reports no wrong token.
"""

from __future__ import annotations

import contextlib
import os
import socket
import subprocess
import sys
from collections.abc import Iterator

from aerodaas.actors.cluster.authentication import (
    refusal,
    require_authentication,
    require_token,
)
from aerodaas.actors.cluster.encryption import require_same_encryption
from aerodaas.actors.cluster.ray_process import RAY
from aerodaas.errors import AeroDaaSError

__all__ = ["HTTP2_PREFACE", "greet", "hushed", "kept_address", "listener_of", "reach"]

_PROBE_SECONDS = 5.0
_REFUSED = "InvalidAuthToken"
"""Ray's name, on standard error, of the answer to a wrong token."""
HTTP2_PREFACE = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + bytes((0, 0, 0, 4, 0, 0, 0, 0, 0))
"""First bytes of an HTTP/2 client, with empty settings (RFC 9113, section 3.4)."""
_SETTINGS_FRAME = 4
_LOOPBACK = "[::ffff:127.0.0.1]"
"""127.0.0.1, written as an IPv6 address."""


def reach(address: str) -> None:
    """Check that the head of a cluster at `address` is reachable and speaks as we do.

    Both ends use TLS and trust each other, or neither does; this user has a token. Raises
    AeroDaaSError with the remedy.
    """
    authenticated = require_authentication()
    listener = listener_of(address)
    if listener is None:
        return
    try:
        socket.create_connection(listener, timeout=_PROBE_SECONDS).close()
    except (OSError, OverflowError) as error:
        raise AeroDaaSError(
            f"no Ray cluster answers at {address}: {error}; check address and port (6379 unless "
            "`ray start --port` said otherwise), the firewall, and that the head runs"
        ) from None
    if address.startswith("ray://"):
        return
    if not require_same_encryption(address, listener) and not _speaks_http2(listener):
        raise AeroDaaSError(f"what listens at {address} is not the head of a Ray cluster")
    if authenticated:
        require_token(address)


def greet(address: str) -> None:
    """Check also, by `ray status`, that the cluster at `address` accepts our token.

    Raises AeroDaaSError with the remedy.
    """
    reach(address)
    with subprocess.Popen(  # noqa: S603 - fixed program, and an address that has answered
        [sys.executable, "-c", RAY, "status", f"--address={kept_address(address)}"],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    ) as asking:
        assert asking.stderr is not None  # noqa: S101 - asked for
        last = ""
        for line in asking.stderr:
            if _REFUSED in line:
                asking.kill()
                raise refusal(address)
            last = line.strip() or last
    if asking.returncode:
        raise AeroDaaSError(f"the head of the cluster at {address} does not answer: {last}")


def kept_address(address: str) -> str:
    """`address` in a form that Ray keeps.

    Ray replaces a loopback address by the machine's in its network, where a head that listens on
    loopback only does not answer.
    """
    host, _, port = address.rpartition(":")
    return f"{_LOOPBACK}:{port}" if host in {"127.0.0.1", "localhost"} else address


def listener_of(address: str) -> tuple[str, int] | None:
    """Host and port of a cluster's address; None for "auto" and other forms specific to Ray."""
    host, _, port = address.removeprefix("ray://").rpartition(":")
    return (host.strip("[]"), int(port)) if host and port.isdigit() else None


def _speaks_http2(listener: tuple[str, int]) -> bool:
    """Whether a server of HTTP/2, as the head is, listens at this host and port without TLS."""
    with contextlib.suppress(OSError), socket.create_connection(listener, _PROBE_SECONDS) as link:
        link.sendall(HTTP2_PREFACE)
        frame = link.recv(9, socket.MSG_WAITALL)
        return len(frame) == 9 and frame[3] == _SETTINGS_FRAME  # noqa: PLR2004 - its header
    return False


@contextlib.contextmanager
def hushed() -> Iterator[None]:
    """Discard standard error: Ray's C++ part prints errors there that it also raises."""
    kept = os.dup(2)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    try:
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)
