"""Handshake with a cluster's head before Ray joins it: reachability, TLS settings and token.

Ray tries for minutes to join a head that cannot be reached, and reports no wrong token.
"""

from __future__ import annotations

import contextlib
import os
import socket
import ssl
import subprocess
import sys
from collections.abc import Iterator

from aerodaas.actors.cluster.authentication import (
    refusal,
    require_authentication,
    require_token,
)
from aerodaas.actors.cluster.ray_process import RAY
from aerodaas.errors import AeroDaaSError, ConfigError

__all__ = [
    "HTTP2_PREFACE",
    "greet",
    "hushed",
    "kept_address",
    "listener_of",
    "reach",
    "require_same_encryption",
]

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


_SECONDS = 5.0
_FILES = ("RAY_TLS_SERVER_CERT", "RAY_TLS_SERVER_KEY", "RAY_TLS_CA_CERT")
_ADVICE = "clusters/certificates.sh makes certificates, docs/cluster.md says where they belong"


def require_same_encryption(address: str, listener: tuple[str, int]) -> bool:
    """Check that both or neither of the cluster at `address` and this process use TLS.

    Args:
        address: The cluster's address as the user gave it.
        listener: Its host and port.

    Returns:
        Whether both use TLS.

    Raises:
        AeroDaaSError: Only one uses TLS, or one does not trust the other.
        ConfigError: This process's certificate files cannot be used.
    """
    if os.environ.get("RAY_USE_TLS", "0").lower() in {"1", "true"}:
        _shake_hands(address, listener, _our_context())
        return True
    if _speaks_tls(listener):
        raise AeroDaaSError(
            f"the cluster at {address} speaks TLS only: set RAY_USE_TLS=1 and {', '.join(_FILES)} "
            f"here; {_ADVICE}"
        )
    return False


def _our_context() -> ssl.SSLContext:
    missing = [name for name in _FILES if not os.environ.get(name)]
    if missing:
        raise ConfigError(f"RAY_USE_TLS needs {', '.join(missing)}, too; {_ADVICE}")
    certificate, key, authority = (os.environ[name] for name in _FILES)
    try:
        context = ssl.create_default_context(cafile=authority)
        context.load_cert_chain(certificate, key)
    except OSError as error:
        raise ConfigError(
            f"the files named by {', '.join(_FILES)} cannot be used: {error}; {_ADVICE}"
        ) from None
    context.set_alpn_protocols(["h2"])
    return context


def _shake_hands(address: str, listener: tuple[str, int], context: ssl.SSLContext) -> None:
    try:
        with (
            socket.create_connection(listener, timeout=_SECONDS) as link,
            context.wrap_socket(link, server_hostname=listener[0]) as secured,
        ):
            # Since TLS 1.3 the peer verifies our certificate only after the handshake.
            if not secured.recv(1):
                raise ConnectionAbortedError("it hung up")
    except ssl.SSLCertVerificationError as error:
        raise AeroDaaSError(
            f"the head at {address} shows a certificate that ours do not vouch for: "
            f"{error.verify_message}; {_ADVICE}"
        ) from None
    except OSError as error:
        told = "ALERT" in (getattr(error, "reason", None) or "")
        if told or isinstance(error, ConnectionAbortedError):
            raise AeroDaaSError(
                f"the cluster at {address} refuses our certificate ({error}): it must be signed by "
                f"the cluster's own authority; {_ADVICE}"
            ) from None
        raise AeroDaaSError(
            f"the cluster at {address} does not speak TLS ({error}): start its nodes with "
            "RAY_USE_TLS=1, too, or unset it here"
        ) from None


def _speaks_tls(listener: tuple[str, int]) -> bool:
    context = ssl.create_default_context()
    context.check_hostname = False
    context.verify_mode = ssl.CERT_NONE  # no data is sent
    context.set_alpn_protocols(["h2"])
    try:
        with (
            socket.create_connection(listener, timeout=_SECONDS) as link,
            context.wrap_socket(link),
        ):
            return True
    except OSError:
        return False
