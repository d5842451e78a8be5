"""How many drones an edge carries until one frame in a hundred is late.

Each edge flies its own application: that is how edges are added, for nothing but the cloud is
shared between them. Every frame is one task of the dispatcher; it is late if its result comes
after the deadline or not at all. Analyses take time but no processor, as on an accelerator, so
that the framework is what fills up. All nodes share this machine's cores; root is needed.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Annotated, Any

import typer
from _report import Report

from tools.namespaces import EdgeCloud, Shape
from tools.namespaces.ray_node import environment

_APP = Path(__file__).with_name("_scale_app.py")
_LATE = 0.01
UNITS = {"drones": "per edge", "frames": "per s", "late": "%"}


def fly(cluster: EdgeCloud, words: dict[str, Any], edges: int) -> Counter[str]:
    """Fly so many drones on each edge at once; returns what became of all their frames."""
    machines = [cluster.edge] + [cluster.far[f"edge{n}"].machine for n in range(2, edges + 1)]
    command = [sys.executable, str(_APP), json.dumps({**words, "address": cluster.address})]
    env = environment()
    env["PYTHONPATH"] = os.pathsep.join([str(_APP.parent), env["PYTHONPATH"]])
    # The first edge is this machine: its application runs here, the others' on theirs.
    running = [
        subprocess.Popen(  # noqa: S603 - our own words
            command if machine is cluster.edge else machine.words(*command),
            env=env,
            stdout=subprocess.PIPE,
            text=True,
        )
        for machine in machines
    ]
    total: Counter[str] = Counter()
    for process in running:
        said, _ = process.communicate()
        if process.returncode != 0:
            raise SystemExit(f"a flight failed with exit code {process.returncode}")
        # Ray may write its own lines after the application's.
        (told,) = (line for line in said.splitlines() if line.startswith("{"))
        total.update(json.loads(told))
    return total


def climb(
    cluster: EdgeCloud, words: dict[str, Any], edges: int, most: int
) -> tuple[int, float, float]:
    """Add drones until more than one frame in a hundred is late.

    Returns the last number of drones per edge that was well, its frames per second and share.
    """
    well = (0, 0.0, 0.0)
    for drones in range(1, most + 1):
        counts = fly(cluster, {**words, "drones": drones}, edges)
        frames = sum(counts.values())
        late = 1.0 - counts["done"] / max(1, frames)
        print(f"{edges} edge(s), {words['rate']:g}/s, {drones} drone(s): {100 * late:.2f} % late")
        if late > _LATE:
            break
        well = (drones, frames / words["seconds"], late)
    return well


def main(
    *,
    rates: Annotated[str, typer.Option(help="Frames per second, by comma.")] = "5,15",
    seconds: Annotated[float, typer.Option(min=2, help="Measured for each number.")] = 10.0,
    work: Annotated[float, typer.Option(help="Seconds of an analysis.")] = 0.02,
    deadline: Annotated[float, typer.Option(help="Seconds from frame to result.")] = 0.3,
    most: Annotated[int, typer.Option(min=1, help="Drones per edge at which to stop.")] = 12,
    json_path: Annotated[Path | None, typer.Option("--json", help="Write the figures.")] = None,
) -> None:
    """Add drones to 1 edge, and to 2 edges with 1 cloud, until frames are late.

    sudo python benchmarks/scale.py --rates 5,15 --seconds 10 --json scale.json
    """
    report = Report("drones until 1 % of frames are late", UNITS, packages=("ray",))
    common = {"seconds": seconds, "work": work, "deadline": deadline, "isolated": 4}
    for edges, clouds in ((1, 0), (2, 1)):
        for text in rates.split(","):
            with EdgeCloud(clouds, edges=edges, shape=Shape(0.04, 100e6)) as cluster:
                words = {**common, "rate": float(text), "cloud": clouds > 0}
                drones, frames, late = climb(cluster, words, edges, most)
            name = f"{edges} edge{'s' * (edges > 1)}" + f", {clouds} cloud" * (clouds > 0)
            figures = {"drones": drones, "frames": frames, "late": 100 * late}
            report.row(f"{name}, {text} frames/s", figures)
    report.note(f"an analysis takes {work * 1000:g} ms, a result is late after {deadline:g} s")
    report.show()
    if json_path is not None:
        report.write(json_path)


if __name__ == "__main__":
    typer.run(main)
