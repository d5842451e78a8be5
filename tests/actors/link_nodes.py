"""Sends frames from an edge node to two analyses on a cloud node, and prints what that took.

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
from ray.cluster_utils import Cluster  # noqa: E402
from test_sites import Desk, Mean  # noqa: E402

from aerodaas.actors.cluster.ray_cluster import options_for  # noqa: E402
from aerodaas.actors.dispatch.executor import CloudExecutor  # noqa: E402
from aerodaas.actors.dispatch.remote_executor import Executor  # noqa: E402
from aerodaas.messages.envelope import Message  # noqa: E402
from aerodaas.messages.frames import Frame, Header  # noqa: E402
from aerodaas.runtime.dispatch.frame_codec import Codec  # noqa: E402
from aerodaas.runtime.placement import Placement  # noqa: E402

FRAMES = 12


def executor(*models: str) -> Executor:
    """A process on the cloud node with an analysis for each of the models."""
    remote: Any = ray.remote(CloudExecutor)
    options = options_for(Placement("cloud"), restarts=0)
    handle = remote.options(**options, max_concurrency=6).remote()
    works = ray.put({model: Mean() for model in models})
    made = Executor("cloud", handle, [works], frozenset(models), 4, Codec("none"))
    ray.get(made.prepare(), timeout=200)
    return made


def noise(message: Message[Frame]) -> Message[Frame]:
    """The message with a picture of its own."""
    random = np.random.default_rng(message.seq)
    item = Frame(Header(*message.header), random.integers(0, 255, (360, 640, 3), np.uint8))
    fields = (message.stream, message.seq, message.stamp, message.header, message.captured)
    return Message(*fields, message.spans, item)


def main() -> None:
    """Send, count, print."""
    small: dict[str, Any] = {"num_cpus": 1, "object_store_memory": 100 * 2**20}
    cluster = Cluster()
    cluster.add_node(resources={"edge": 1}, include_dashboard=False, **small)
    cluster.add_node(resources={"cloud": 1}, **small)
    ray.init(address=cluster.address, logging_level=logging.ERROR, log_to_driver=False)
    try:
        (cloud,) = [node for node in ray.nodes() if "cloud" in node["Resources"]]
        desk = Desk(executor("one", "two"))
        answered = 0
        for _ in range(FRAMES):
            message = noise(desk.frame())
            desk.send("one", message)
            desk.send("two", message)
            answered += sum(answer.message is not None for answer in desk.answers(2))
        desk.look_until(lambda: desk.sites.values()["cloud"]["latency_ms"] > 0)
        told = {
            "answered": answered,
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
