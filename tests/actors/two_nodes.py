"""Flies an application over an edge and two clouds, three Ray nodes of this machine, and prints.

A program of its own, for a process has one Ray: `python two_nodes.py FOLDER`.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Any, ClassVar

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests"), str(Path(__file__).parent)]
os.environ["PYTHONPATH"] = os.pathsep.join(sys.path[:3])
os.environ["RAY_USAGE_STATS_ENABLED"] = "0"

import ray  # noqa: E402 - workers import from where this process does
from flying import FLAT, Flyer, hop, robot  # noqa: E402
from ray.cluster_utils import Cluster  # noqa: E402

from aerodaas import Analytics, Environment, Frame  # noqa: E402
from aerodaas.actors.run.flight import Flight  # noqa: E402
from aerodaas.analytics.base import Context  # noqa: E402
from aerodaas.errors import AeroDaaSError  # noqa: E402

CAMERA = {"id": "cam", "type": "camera", "rate": 5, "settings": {"width": 64, "height": 36}}
PLACES = {
    "edge": {"kind": "edge"},
    "cloud": {"kind": "cloud"},
    "second": {"kind": "cloud", "node": "cloud-b"},
    "beside": {"kind": "edge", "node": "edge-b"},
}


class Bright(Analytics[float]):
    """The mean of a picture."""

    accepts: ClassVar[tuple[type, ...]] = (Frame,)
    produces: ClassVar[type] = float

    def __init__(self, name: str) -> None:
        self.name = name

    def process(self, item: Frame, context: Context) -> float:  # noqa: ARG002
        """Take the mean."""
        return float(item.image.mean())


def content(**changes: Any) -> dict[str, Any]:  # noqa: ANN401
    """An environment over all four nodes."""
    compute = [{"id": name, **place} for name, place in PLACES.items()]
    return {**FLAT, "robots": [robot(sensors=[CAMERA])], "compute": compute, **changes}


def deployed(env: Environment) -> None:
    """One analysis at each place."""
    drone = env.get_robot_by_id("drone")
    drone.navigate(hop((2, 0)))
    camera = drone.get_sensor_by_id("cam").get_data_stream()
    for name in PLACES:
        Bright(f"at_{name}").deploy(env.get_compute_resource_by_id(name)).analyse(camera)


def main() -> None:
    """Fly, and print where everything was and what came of it."""
    flyer = Flyer(Path(sys.argv[1]))
    small: dict[str, Any] = {"num_cpus": 1, "object_store_memory": 80 * 2**20}
    cluster = Cluster()
    cluster.add_node(resources={"edge": 1}, node_name="edge-a", include_dashboard=False, **small)
    for name in ("edge-b", "cloud-a"):
        cluster.add_node(resources={name[:-2]: 1}, node_name=name, **small)
    accelerated = {"cloud": 1, "accelerator_type:T4": 1}
    cluster.add_node(resources=accelerated, num_gpus=2, node_name="cloud-b", **small)
    told: dict[str, Any] = {"expected": list(PLACES)}
    try:
        run = flyer.fly(deployed, content(), speed=1.0, address=cluster.address)
        assert isinstance(run._flight, Flight)
        names = {node["NodeID"]: node["NodeName"] for node in ray.nodes()}
        told["places"] = {who: names[i.node_id] for who, i in run._flight.infos().items()}
        told["hardware"] = {
            name: run._environment.get_compute_resource_by_id(name).get_compute_properties()
            for name in PLACES
        }
        told["sent"] = {
            stream: count.count
            for report in run.reports().values()
            for stream, count in report.sent.items()
            if "/at_" in stream or stream.endswith("/cam")
        }
        told["refusals"] = []
        for wrong in ({"kind": "cloud", "node": "cloud-z"}, {"kind": "edge", "node": "cloud-a"}):
            PLACES["second"] = wrong
            (flyer.folder / "flight" / "flight.mcap").unlink(missing_ok=True)
            try:
                flyer.fly(deployed, content(), speed=1.0, address=cluster.address)
            except AeroDaaSError as error:
                told["refusals"].append(str(error))
        told["left"] = ray.util.list_named_actors(all_namespaces=True)
    finally:
        ray.shutdown()
        cluster.shutdown()
    print(json.dumps(told))  # noqa: T201 - what the test reads


if __name__ == "__main__":
    main()
