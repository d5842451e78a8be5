"""One edge's share of the scale benchmark: some drones, their frames, and what became of them."""

from __future__ import annotations

import json
import sys
import tempfile
import time
from pathlib import Path

from _cluster_apps import Work, environment, flying, hover

_WARM_UP = 5.0


def main() -> None:
    """Fly as told on the command line (JSON) and print the counts of outcomes as JSON."""
    told = json.loads(sys.argv[1])
    task = {"benefit": 10, "cloud_cost": 1, "deadline": told["deadline"] * 1000}
    task |= {"edge_time": told["work"] * 1000 + 10, "cloud_time": told["work"] * 1000 + 120}
    drones = int(told["drones"])
    tasks = {f"work{number}": task for number in range(drones)}
    content = environment(drones, told["rate"], (160, 90), cloud=told["cloud"], tasks=tasks)
    content["schedulers"]["analytics"] = "ec_edf"
    with (
        tempfile.TemporaryDirectory() as name,
        flying(content, Path(name), told["address"]) as env,
    ):
        edge = env.get_compute_resource_by_id("edge")
        for number in range(drones):
            drone = env.get_robot_by_id(f"drone{number}")
            frames = drone.get_sensor_by_id(f"camera{number}").get_data_stream()
            work = Work(told["work"], scheduled=True, name=f"work{number}")
            work.isolated = drones <= told["isolated"]
            work.deploy(edge).analyse(frames)
            hover(env, f"drone{number}")
        run = env.launch()
        time.sleep(_WARM_UP)
        before = dict(run.poll().reports["dispatcher"].values["outcomes"])
        time.sleep(told["seconds"])
        time.sleep(1.0)  # reports are gathered twice a second
        after = dict(run.poll().reports["dispatcher"].values["outcomes"])
    print(json.dumps({key: count - before.get(key, 0) for key, count in after.items()}))


if __name__ == "__main__":
    main()
