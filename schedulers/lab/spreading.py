"""How the parts of a study, one for each seed and edge, are shared by the cores of a machine."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from typing import Any

__all__ = ["Spread", "batch_size", "over_processes"]

Spread = Callable[[Callable[[Any], Any], Sequence[Any]], Iterable[Any]]
"""An ordered `map`, such as `Pool.imap` of multiprocessing, or
`aerodaas.actors.cluster.ray_map.spread_over(address)` for a Ray cluster."""

_BATCHES = 16
"""Batches for each worker: enough that all end at about the same time."""


def batch_size(parts: int, workers: int) -> int:
    """How many of the parts go to a worker at once, so that few messages are sent."""
    return max(1, parts // (_BATCHES * workers))


@contextmanager
def over_processes(jobs: int | None, parts: int | None = None) -> Iterator[Spread]:
    """Give a map over `jobs` processes (None: one for each core), which end with the context.

    Of 1 job, and of 1 part where their number is known, it is the ordinary `map`.
    """
    workers = jobs or os.cpu_count() or 1
    if parts is not None:
        workers = min(workers, parts)
    if workers == 1:
        yield map
        return
    pool = ProcessPoolExecutor(workers)

    def spread(function: Callable[[Any], Any], parts: Sequence[Any]) -> Iterable[Any]:
        return pool.map(function, parts, chunksize=batch_size(len(parts), workers))

    try:
        yield spread
    finally:
        pool.shutdown(cancel_futures=True)
