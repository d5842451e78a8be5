"""Parallel map of independent simulations over a Ray cluster, for scheduler experiments."""

from __future__ import annotations

import sys
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import ray
from ray import cloudpickle

from aerodaas.actors.cluster import ray_cluster as cluster
from aerodaas.schedulers.analytics.base import AnalyticsScheduler
from aerodaas.schedulers.analytics.registry import load_scheduler

__all__ = ["shipped", "spread_over"]

_WAITING_PER_CORE = 4
"""Parts submitted ahead of the answers, per core, so that no core waits."""


def spread_over(address: str) -> Callable[[Callable[[Any], Any], Iterable[Any]], Iterator[Any]]:
    """Return an ordered `map` over the cores of the Ray cluster at `address`.

    A part whose node dies is computed again on another one. The project must be installed on
    every node. Raises AeroDaaSError if the cluster cannot be reached.
    """
    cluster.join(address)

    def spread(function: Callable[[Any], Any], parts: Iterable[Any]) -> Iterator[Any]:
        work: Any = ray.remote(num_cpus=1)(_work)
        shared = ray.put(function)
        ahead = _WAITING_PER_CORE * max(1, int(ray.cluster_resources().get("CPU", 1)))
        under_way: deque[Any] = deque()
        for part in parts:
            under_way.append(work.remote(shared, part))
            if len(under_way) >= ahead:
                yield ray.get(under_way.popleft())
        while under_way:
            yield ray.get(under_way.popleft())

    return spread


def shipped(wanted: str) -> str | type[AnalyticsScheduler]:
    """A scheduler as another machine can load it: a class from a file is pickled by value."""
    if ".py:" not in wanted:
        return wanted
    found = type(load_scheduler(wanted))
    cloudpickle.register_pickle_by_value(sys.modules[found.__module__])
    return found


def _work(function: Callable[[Any], Any], part: Any) -> Any:  # noqa: ANN401
    return function(part)
