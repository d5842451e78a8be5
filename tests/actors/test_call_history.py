"""The head of a cluster keeps nothing of the calls that an application makes by the hour."""

from __future__ import annotations

import time
from typing import Any

import psutil
import pytest
import ray

_CALLS = 10_000
"""What an application that polls a drone ten times a second makes in 17 minutes."""
_MOST_GROWTH = 8_000_000
"""Bytes; with Ray's history of calls it is 30 million."""


class _Drone:
    def report(self) -> None:
        """Answer a poll."""


def _head() -> psutil.Process:
    """The process of the cluster's head, by the port that it listens on."""
    port = int(ray.get_runtime_context().gcs_address.rpartition(":")[2])
    heads = [
        process
        for process in psutil.process_iter(["name"])
        if process.info["name"] == "gcs_server"
        and any(one.laddr and one.laddr.port == port for one in process.net_connections("tcp"))
    ]
    assert len(heads) == 1
    return heads[0]


@pytest.mark.slow
def test_the_head_does_not_grow_with_each_call(runtime: None) -> None:  # noqa: ARG001 - needs Ray
    """Its memory is the same after 10,000 calls of an actor without task events, as ours are."""
    remote: Any = ray.remote
    actor_class = remote(num_cpus=0, enable_task_events=False)(_Drone)
    drone = actor_class.remote()
    ray.get([drone.report.remote() for _ in range(1000)])
    head = _head()
    before = head.memory_info().rss
    for _ in range(_CALLS // 1000):
        ray.get([drone.report.remote() for _ in range(1000)])
    time.sleep(2.5)  # what it would keep is sent once a second
    grown = head.memory_info().rss - before
    ray.kill(drone)
    assert grown < _MOST_GROWTH
