"""The jobs of one connection: ended together, and what failed in them is logged."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Sequence
from typing import Any

from fastapi import WebSocketDisconnect

__all__ = ["end_jobs"]

_log = logging.getLogger(__name__)


async def end_jobs(
    what: str, sending: Sequence[asyncio.Task[Any]], reading: Sequence[asyncio.Task[Any]] = ()
) -> None:
    """Cancel the jobs of a connection, and wait for their end.

    Args:
        what: The connection, for the log.
        sending: Jobs that fail by mistakes of ours alone, which are logged; but for what is raised
            when the other side has gone.
        reading: Jobs that fail by what the other side sends, which is its own business.
    """
    for job in (*sending, *reading):
        job.cancel()
    await asyncio.gather(*reading, return_exceptions=True)
    for found in await asyncio.gather(*sending, return_exceptions=True):
        # A server raises RuntimeError for what is sent on a connection that has ended.
        gone = isinstance(found, WebSocketDisconnect | RuntimeError)
        if isinstance(found, Exception) and not gone:
            _log.error("%s has failed", what, exc_info=found)
