"""Parallel map of independent simulations over a Ray cluster, for scheduler experiments."""

from __future__ import annotations

import sys
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import ray
from ray import cloudpickle
from ray.exceptions import RayTaskError

from aerodaas.actors.cluster import ray_cluster as cluster
from aerodaas.schedulers.analytics.base import AnalyticsScheduler
from aerodaas.schedulers.analytics.registry import load_scheduler
from aerodaas.schedulers.lab.run import Spread, batch_size

__all__ = ["shipped", "spread_over"]

_WAITING_PER_CORE = 4
"""Batches submitted ahead of the answers, per core, so that no core waits."""


def spread_over(address: str) -> Spread:
    """Return an ordered `map` over the cores of the Ray cluster at `address`.

    Parts travel in batches; one whose node dies is computed again on another one. What a part
    raises is raised here. The project must be installed on every node. Raises AeroDaaSError if
    the cluster cannot be reached.
    """
    cluster.join(address)

    def spread(function: Callable[[Any], Any], parts: Sequence[Any]) -> Iterator[Any]:
        work: Any = ray.remote(num_cpus=1)(_work)
        shared = ray.put(function)
        cores = max(1, int(ray.cluster_resources().get("CPU", 1)))
        size = batch_size(len(parts), cores)
        under_way: deque[Any] = deque()
        for begin in range(0, len(parts), size):
            under_way.append(work.remote(shared, parts[begin : begin + size]))
            if len(under_way) >= _WAITING_PER_CORE * cores:
                yield from _answers(under_way.popleft())
        while under_way:
            yield from _answers(under_way.popleft())

    return spread


def shipped(wanted: str) -> str | type[AnalyticsScheduler]:
    """A scheduler as another machine can load it: a class from a file is pickled by value."""
    if ".py:" not in wanted:
        return wanted
    found = type(load_scheduler(wanted))
    cloudpickle.register_pickle_by_value(sys.modules[found.__module__])
    return found


def _work(function: Callable[[Any], Any], parts: Sequence[Any]) -> list[Any]:
    return [function(part) for part in parts]


def _answers(batch: Any) -> Any:  # noqa: ANN401 - Ray's references and what comes of them
    try:
        return ray.get(batch)
    except RayTaskError as error:
        # Without the other process' traceback, which Ray puts before the message.
        raise error.cause from None
