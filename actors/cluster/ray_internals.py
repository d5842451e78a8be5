"""The uses of Ray's internals for which it has no public interface; all of them are optional.

Where a release of Ray has changed one of them, nothing fails, but a message gets worse:

- `cluster_metadata`: Ray reports a wrong token only after half a minute of log lines, and another
  version of itself with a traceback. Without it, that is what the user sees.
- `forbid_start`: a call of Ray's without a Ray starts one, which listens on all interfaces. Without
  it, an application that has left its cluster may do so once more.
- `reread_variables`: Ray reads its environment variables once, when it is imported. Without it,
  RAY_AUTH_MODE=token has to be set before an application starts.
- `silence_nodes`: Ray prints its nodes' messages about dead processes, which the run reports by
  name. Neither `log_to_driver` nor another option covers them.
"""

from __future__ import annotations

import contextlib
import importlib
import json
from typing import Any

__all__ = ["cluster_metadata", "forbid_start", "reread_variables", "silence_nodes"]

_CHANGED = (ImportError, AttributeError, TypeError)
"""Errors of a use of internals that have changed."""
_PRINTS = "print_to_stdstream"
_STARTS = "enable_auto_connect"


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


def forbid_start() -> None:
    """Have calls without a Ray fail, instead of starting one, from now on in this process."""
    with contextlib.suppress(*_CHANGED):
        hook = importlib.import_module("ray._private.auto_init_hook")
        if hasattr(hook, _STARTS):
            setattr(hook, _STARTS, False)


def reread_variables() -> None:
    """Make Ray in this process read its environment variables again."""
    with contextlib.suppress(*_CHANGED):
        importlib.import_module("ray._raylet").Config.initialize("")


def silence_nodes() -> None:
    """Stop Ray from printing its nodes' messages about dead processes."""
    with contextlib.suppress(*_CHANGED):
        worker = importlib.import_module("ray._private.worker")
        if hasattr(worker, _PRINTS):
            setattr(worker, _PRINTS, lambda *_, **__: None)
