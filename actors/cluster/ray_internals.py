"""The uses of Ray's internals for which it has no public interface; all of them are optional.

Where a release of Ray has changed one of them, nothing fails, but a message gets worse:

- `cluster_metadata`: Ray reports a wrong token only after half a minute of log lines, and another
  version of itself with a traceback. Without it, that is what the user sees.
- `take_up_token`: Ray takes up the user's token only for a cluster that it starts itself. Without
  it, RAY_AUTH_MODE=token has to be set by hand.
- `silence_nodes`: Ray prints its nodes' messages about dead processes, which the run reports by
  name. Neither `log_to_driver` nor another option covers them.
"""

from __future__ import annotations

import contextlib
import importlib
import json
import logging
from collections.abc import Iterator
from typing import Any

__all__ = ["cluster_metadata", "silence_nodes", "take_up_token"]

_CHANGED = (ImportError, AttributeError, TypeError)
"""Errors of a use of internals that have changed."""
_PRINTS = "print_to_stdstream"


def cluster_metadata(address: str, timeout: float) -> dict[str, Any]:
    """Versions of the cluster whose head is at `address`; empty if unknown.

    Raises Ray's own errors if the head refuses our token or is no head.
    """
    try:
        client = importlib.import_module("ray._raylet").GcsClient(address=address)
        found = client.internal_kv_get(b"CLUSTER_METADATA", b"cluster", timeout=timeout)
    except _CHANGED:
        return {}
    return dict(json.loads(found)) if found else {}


def take_up_token() -> None:
    """Enable the user's token for joining a cluster."""
    name = "ray._private.authentication.authentication_token_setup"
    with contextlib.suppress(*_CHANGED):
        tokens = importlib.import_module(name)
        with _level(logging.getLogger(name), logging.ERROR):
            tokens.maybe_enable_token_auth_if_token_available(warn_if_disabled=False)


def silence_nodes() -> None:
    """Stop Ray from printing its nodes' messages about dead processes."""
    with contextlib.suppress(*_CHANGED):
        worker = importlib.import_module("ray._private.worker")
        if hasattr(worker, _PRINTS):
            setattr(worker, _PRINTS, lambda *_, **__: None)


@contextlib.contextmanager
def _level(logger: logging.Logger, level: int) -> Iterator[None]:
    before = logger.level
    logger.setLevel(level)
    try:
        yield
    finally:
        logger.setLevel(before)
