"""Handshake with a cluster's head before Ray joins it: reachability, token and versions.

Ray reports a wrong token only after half a minute of repeated log lines, and other versions of
itself with a traceback; a query of its head reports both at once.
"""

from __future__ import annotations

import contextlib
import os
import platform
import socket
from collections.abc import Iterator
from typing import Any

import ray
from ray.exceptions import RayError, RpcError

from aerodaas.actors.cluster.authentication import (
    refusal,
    require_authentication,
    require_token,
)
from aerodaas.actors.cluster.encryption import require_same_encryption
from aerodaas.actors.cluster.ray_internals import cluster_metadata
from aerodaas.types.errors import AeroDaaSError

__all__ = ["greet", "hushed", "listener_of"]

_PROBE_SECONDS = 5.0


def greet(address: str) -> None:
    """Check that a cluster at `address` is reachable, accepts our token and runs our versions.

    Also checks that both ends use TLS and trust each other, or neither does. Raises
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
    require_same_encryption(address, listener)
    if authenticated:
        require_token(address)
    _compare(address, _metadata(address))


def listener_of(address: str) -> tuple[str, int] | None:
    """Host and port of a cluster's address; None for "auto" and other forms specific to Ray."""
    host, _, port = address.removeprefix("ray://").rpartition(":")
    return (host.strip("[]"), int(port)) if host and port.isdigit() else None


def _metadata(address: str) -> dict[str, Any]:
    """Cluster metadata from the head; raises AeroDaaSError if refused or not a Ray head."""
    try:
        with hushed():
            return cluster_metadata(address, _PROBE_SECONDS)
    except (RayError, RpcError) as error:
        reason = str(error).strip().splitlines()[0]
        if "token" in reason.lower():
            raise refusal(address) from None
        raise AeroDaaSError(
            f"what listens at {address} is not the head of a Ray cluster: {reason}"
        ) from None


def _compare(address: str, head: dict[str, Any]) -> None:
    """Raise AeroDaaSError if the head's Ray release or Python minor version differs from ours.

    Ray's wire protocol changes with each release, Python's pickles with each minor one.
    """
    ours = {"ray_version": ray.__version__, "python_version": platform.python_version()}
    names = {"ray_version": "Ray", "python_version": "Python"}
    for key, mine in ours.items():
        theirs = str(head.get(key, mine))
        if theirs != mine and (key == "ray_version" or _minor(theirs) != _minor(mine)):
            raise AeroDaaSError(
                f"the head at {address} runs {names[key]} {theirs}, this machine {mine}; "
                + (
                    f"install the same on both: pip install 'ray=={theirs}'"
                    if key == "ray_version"
                    else f"use Python {_minor(theirs)} here"
                )
            )


def _minor(version: str) -> str:
    return ".".join(version.split(".")[:2])


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
