"""Waiting for what arrives on sockets and serial ports."""

from __future__ import annotations

import select
from collections.abc import Iterable

__all__ = ["wait_readable"]


def wait_readable(descriptors: Iterable[int], timeout: float) -> None:
    """Wait until one of some descriptors can be read or has failed, or the time is over.

    Any number of files may be open in this process: `select.select` takes none beyond the 1,024th.

    Args:
        descriptors: Those of open sockets and ports; a negative one stands for a closed one.
        timeout: Seconds, 0 or more.
    """
    waiting = select.poll()
    for descriptor in descriptors:
        if descriptor >= 0:
            waiting.register(descriptor, select.POLLIN)
    waiting.poll(1000.0 * timeout)
