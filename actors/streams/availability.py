"""Whether streams between processes of this node can use shared memory."""

from __future__ import annotations

import functools
import sys

from aerodaas.actors.streams.rendezvous import streams_folder
from aerodaas.actors.streams.slots import SlotPool
from aerodaas.actors.streams.wire import queue, waiting_bytes
from aerodaas.errors import AeroDaaSError

__all__ = ["shared_memory_available", "shared_memory_obstacle"]


def shared_memory_available() -> bool:
    """Return whether this process can use streams in shared memory."""
    return not shared_memory_obstacle()


@functools.cache
def shared_memory_obstacle() -> str:
    """Return why this process cannot use streams in shared memory; empty if it can."""
    if sys.platform != "linux":
        return "streams in shared memory need Linux"
    try:
        streams_folder()
        SlotPool().close()
        near, far = queue()
        near.send(b"counted")
        counted = waiting_bytes(far) == len(b"counted")
        near.close()
        far.close()
    except AeroDaaSError as error:
        return str(error)
    except OSError as error:
        return f"this system grants no shared memory: {error.strerror}"
    return "" if counted else "this system does not count what waits in a Unix socket"
