"""HTTP clients: the machine's certificates, and answers of bounded size in bounded time."""

from __future__ import annotations

import logging
import math
import ssl
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from aerodaas.errors import ConfigError

if TYPE_CHECKING:
    import httpx

__all__ = ["http_client", "http_errors", "read_at_most"]

_KEPT_OPEN = 8
_SOCKET_SECONDS = 3.0
"""A connection with our own servers that was idle for longer is made anew: they close it soon."""
# httpx logs the whole address of each request, which may hold a secret.
logging.getLogger("httpx").setLevel(logging.WARNING)


def http_client(
    timeout: float,
    *,
    tls: ssl.SSLContext | None = None,
    connections: int | None = None,
    public: bool = False,
    socket: Path | None = None,
) -> httpx.Client:
    """Create an HTTP client, whose threads share its connections.

    Args:
        timeout: Seconds for each of connecting, sending, and waiting for the next bytes.
        tls: Certificates to trust; None for a client that speaks `http` only.
        connections: Largest number of connections; None for any number.
        public: Follow redirects and use the environment's proxies, for requests without secrets.
        socket: Unix socket of the one server that is asked, whatever host a request names.

    Raises:
        ConfigError: If the environment names a proxy of an unknown kind.
    """
    import httpx  # noqa: PLC0415 - slow to load

    # A context without certificates trusts nobody, and takes no time to make.
    verify = tls or ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    limits = httpx.Limits(
        max_connections=connections,
        max_keepalive_connections=connections or _KEPT_OPEN,
        keepalive_expiry=None if socket is None else _SOCKET_SECONDS,
    )
    transport = None
    if socket is not None:
        transport = httpx.HTTPTransport(verify=verify, limits=limits, uds=str(socket))
    try:
        return httpx.Client(
            # A compressed answer could unpack to any size.
            headers={"Accept-Encoding": "identity"},
            verify=verify,
            timeout=timeout,
            limits=limits,
            transport=transport,
            follow_redirects=public,
            trust_env=public,
        )
    except (ImportError, ValueError) as error:
        raise ConfigError(f"the environment's proxy cannot be used: {error}") from None


@contextmanager
def http_errors(form: Callable[[Exception], Exception]) -> Iterator[None]:
    """Raise what `form` makes of an error of a request, for hosts and ports of any form."""
    import httpx  # noqa: PLC0415 - slow to load

    try:
        yield
    except (httpx.HTTPError, httpx.InvalidURL, UnicodeError, OverflowError) as error:
        raise form(error) from None


def read_at_most(response: httpx.Response, size: int, until: float = math.inf) -> bytes:
    """Read a streamed answer as it was sent, and no further than a size.

    Args:
        response: The answer, which is closed by its owner.
        size: Largest number of bytes to return.
        until: Time of `time.monotonic` at which reading ends, seconds.

    Raises:
        httpx.HTTPError: If the answer breaks off; ReadTimeout also once `until` is over.
    """
    import httpx  # noqa: PLC0415 - slow to load

    content = bytearray()
    for chunk in response.iter_raw():
        content += chunk
        if len(content) >= size:
            break
        if time.monotonic() > until:
            raise httpx.ReadTimeout("timed out", request=response.request)
    return bytes(content[:size])
