"""Handshake with a cluster's head: its version and token, before Ray tries to join it.

Ray answers a wrong token after half a minute of repeated log lines, and other versions of itself
with a traceback; its head tells both at once to who asks.
"""

from __future__ import annotations

import contextlib
import json
import logging
import os
import platform
import socket
from collections.abc import Iterator
from typing import Any

import ray
from ray._raylet import GcsClient  # type: ignore[attr-defined]  # compiled
from ray.exceptions import RayError, RpcError

from aerodaas.actors.cluster.encryption import require_same_encryption
from aerodaas.types.errors import AeroDaaSError

__all__ = ["greet", "hushed", "listener_of", "take_up_token"]

_PROBE_SECONDS = 5.0
_TOKEN_ADVICE = (
    "copy the head's token (`ray get-auth-token` there) to ~/.ray/auth_token here, or set "  # noqa: S105 - advice
    "RAY_AUTH_TOKEN_PATH to its file, and set RAY_AUTH_MODE=token"
)


def greet(address: str) -> None:
    """Make sure that a cluster listens at `address`, takes our token and runs our versions.

    And that either both ends speak TLS, and trust each other, or neither does.

    Raises AeroDaaSError that says what to mend.
    """
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
    take_up_token()
    _compare(address, _metadata(address))


def listener_of(address: str) -> tuple[str, int] | None:
    """Host and port of a cluster's address; None for "auto" and other forms of Ray's."""
    host, _, port = address.removeprefix("ray://").rpartition(":")
    return (host.strip("[]"), int(port)) if host and port.isdigit() else None


def take_up_token() -> None:
    """Ray uses the user's token for a cluster that it starts, but not for one that it joins."""
    try:
        from ray._private.authentication import (  # noqa: PLC0415 - since Ray 2.59
            authentication_token_setup as tokens,
        )

        logger = logging.getLogger(tokens.__name__)
        with _level(logger, logging.ERROR):
            tokens.maybe_enable_token_auth_if_token_available(warn_if_disabled=False)
    except (ImportError, AttributeError, TypeError):
        return


def _metadata(address: str) -> dict[str, Any]:
    """The head's metadata."""
    try:
        with hushed():
            client = GcsClient(address=address)
            told = client.internal_kv_get(b"CLUSTER_METADATA", b"cluster", timeout=_PROBE_SECONDS)
    except (RayError, RpcError) as error:
        reason = str(error).strip().splitlines()[0]
        if "token" in reason.lower():
            raise AeroDaaSError(
                f"the cluster at {address} refuses our token: {_TOKEN_ADVICE}"
            ) from None
        raise AeroDaaSError(
            f"what listens at {address} is not the head of a Ray cluster: {reason}"
        ) from None
    return dict(json.loads(told)) if told else {}


def _compare(address: str, head: dict[str, Any]) -> None:
    """Ray's wire protocol changes with each release, Python's pickles with each minor one."""
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
def _level(logger: logging.Logger, level: int) -> Iterator[None]:
    before = logger.level
    logger.setLevel(level)
    try:
        yield
    finally:
        logger.setLevel(before)


@contextlib.contextmanager
def hushed() -> Iterator[None]:
    """Silence Ray's C++ part, which prints errors that are raised a moment later."""
    kept = os.dup(2)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    try:
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)
