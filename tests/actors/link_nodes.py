"""Sends frames from an edge node to two processes of a cloud node, and prints what arrived.

A program of its own, for a process has one Ray: `python link_nodes.py`.
"""

from __future__ import annotations

import json
import logging
import os
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests"), str(Path(__file__).parent)]
os.environ["PYTHONPATH"] = os.pathsep.join(sys.path[:3])
os.environ["RAY_USAGE_STATS_ENABLED"] = "0"

import numpy as np  # noqa: E402 - workers import from where this process does
import ray  # noqa: E402
import ray.experimental  # noqa: E402
from ray.cluster_utils import Cluster  # noqa: E402
from test_sites import Desk, Mean  # noqa: E402

from aerodaas.actors._cloud import Executor  # noqa: E402
from aerodaas.actors.cluster import Place, options_for  # noqa: E402
from aerodaas.actors.executor import CloudExecutor  # noqa: E402
from aerodaas.data import Frame, Header  # noqa: E402
from aerodaas.status import Message  # noqa: E402

FRAMES = 12


def executors(*models: str) -> list[Executor]:
    """Processes of their own on the cloud node, as analyses with their own packages have."""
    remote: Any = ray.remote(CloudExecutor)
    options = options_for(Place("cloud"), restarts=0)
    made, ready = [], []
    for model in models:
        handle = remote.options(**options, max_concurrency=6).remote()
        works = ray.put({model: Mean()})
        ready.append(handle.prepare.remote(works))
        made.append(Executor("cloud", handle, [works], frozenset({model}), 4, "none"))
    ray.get(ready, timeout=200)
    return made


def noise(message: Message[Frame]) -> Message[Frame]:
    """The message with a picture that no store shares with another's."""
    random = np.random.default_rng(message.seq)
    item = Frame(Header(*message.header), random.integers(0, 255, (360, 640, 3), np.uint8))
    fields = (message.stream, message.seq, message.stamp, message.header, message.captured)
    return Message(*fields, message.hops, item)


def copies(desk: Desk) -> list[list[str]]:
    """Nodes that hold each of the newest frames, as Ray tells."""
    references = [parcel.content for parcel in desk.sites._parcels["cloud"]._parcels.values()]
    located = ray.experimental.get_object_locations(references, timeout_ms=10_000)
    return [sorted(where["node_ids"]) for where in located.values()]


def main() -> None:
    """Send, count, print."""
    small: dict[str, Any] = {"num_cpus": 1, "object_store_memory": 100 * 2**20}
    cluster = Cluster()
    cluster.add_node(resources={"edge": 1}, include_dashboard=False, **small)
    cluster.add_node(resources={"cloud": 1}, **small)
    ray.init(address=cluster.address, logging_level=logging.ERROR, log_to_driver=False)
    try:
        (cloud,) = [node for node in ray.nodes() if "cloud" in node["Resources"]]
        desk = Desk(*executors("one", "two"))
        for _ in range(FRAMES):
            message = noise(desk.frame())
            desk.send("one", message)
            desk.send("two", message)
            desk.answers(2)
        desk.look_until(lambda: desk.sites.values()["cloud"]["latency_ms"] > 0)
        told = {
            "copies": copies(desk),
            "nodes": sorted(node["NodeID"] for node in ray.nodes()),
            "sites": desk.sites.values(),
            "here": ray.get_runtime_context().get_node_id() != cloud["NodeID"],
        }
        desk.sites.finish(1.0)
    finally:
        ray.shutdown()
        cluster.shutdown()
    print(json.dumps(told))  # noqa: T201 - what the test reads


if __name__ == "__main__":
    main()
