"""Check of matching TLS settings before Ray connects, which fails only after minutes."""

from __future__ import annotations

import os
import socket
import ssl

from aerodaas.errors import AeroDaaSError, ConfigError

__all__ = ["require_same_encryption"]

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
