"""How the lab's edges spread over processes, and over nodes of a Ray cluster on one machine.

python benchmarks/lab_spread.py --edges 1000 --json lab_spread.json
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from statistics import median
from typing import Annotated, Any

import aerodaas.actors  # noqa: F401 - sets what Ray reads as it is imported

# isort: split
import psutil
import ray
import typer
from _report import Report
from ray.cluster_utils import Cluster

from aerodaas.actors.cluster.ray_map import spread_over
from aerodaas.clock import NANOSECONDS
from aerodaas.schedulers.lab import LabResult, Workload, run_lab
from aerodaas.schedulers.lab.run import Spread, over_processes

UNITS = {"time": "s", "speed-up": "times", "CPU": "s", "edges": ""}
_STORE = 80 * 2**20
"""Bytes of a Ray node's object store."""


def main(
    edges: Annotated[int, typer.Option(min=1, help="Edges, of 3 drones each.")] = 200,
    scheduler: Annotated[str, typer.Option(help="Name of a scheduler.")] = "dems",
    duration: Annotated[float, typer.Option(help="Simulated seconds.")] = 30.0,
    workers: Annotated[int, typer.Option(min=2, help="Workers that share them.")] = 2,
    rounds: Annotated[int, typer.Option(min=1, help="Rounds, one and several in turn.")] = 3,
    nodes: Annotated[bool, typer.Option(help="Measure Ray nodes, too.")] = True,  # noqa: FBT002
    json: Annotated[Path | None, typer.Option(help="File for the figures.")] = None,
) -> None:
    """One worker against several, in turn, each of them warm; results must be the same.

    The speed-up is the median over the rounds of the time of one by that of several. CPU is that
    of the workers: where it stays, more of them cost nothing but themselves.
    """
    load = Workload.named("3D-A", round(duration * NANOSECONDS)).on_edges(edges)
    report = Report("lab_spread", UNITS, packages=["aerodaas", "ray"])
    results: list[LabResult] = []
    for kind, places in (("processes", _processes), ("Ray nodes", _ray_nodes)):
        if kind == "Ray nodes" and not nodes:
            continue
        found: dict[int, list[tuple[float, float]]] = {1: [], workers: []}
        for _ in range(rounds):
            for count, taken in found.items():
                with places(count) as spread:
                    run_lab(load.on_edges(8 * count), [scheduler], [0], bound=False, spread=spread)
                    began, worked = time.perf_counter(), _worked()
                    results.append(run_lab(load, [scheduler], [0], bound=False, spread=spread))
                    taken.append((time.perf_counter() - began, _worked() - worked))
        alone = [wall for wall, _ in found[1]]
        for count, taken in found.items():
            walls, cpu = zip(*taken, strict=True)
            gain = median(one / wall for one, wall in zip(alone, walls, strict=True))
            figures = (median(walls), gain, median(cpu), edges)
            report.row(f"{count} {kind}", dict(zip(UNITS, figures, strict=True)))
    if any(one != results[0] for one in results):
        raise SystemExit("results differ by the number of workers")
    report.note(f"{scheduler}, {duration:g} s of {3 * edges} drones; all results are the same")
    report.show()
    if json is not None:
        report.write(json)


@contextmanager
def _processes(count: int) -> Iterator[Spread]:
    with over_processes(count) as spread:
        yield spread


@contextmanager
def _ray_nodes(count: int) -> Iterator[Spread]:
    """Nodes of one core each."""
    node: dict[str, Any] = {"num_cpus": 1, "object_store_memory": _STORE}
    cluster = Cluster()
    try:
        for _ in range(count):
            cluster.add_node(include_dashboard=False, **node)
        yield spread_over(str(cluster.address))
    finally:
        ray.shutdown()
        cluster.shutdown()


def _worked() -> float:
    """CPU seconds of this process and of the workers that live, its own and Ray's."""
    here, seconds = psutil.Process(), 0.0
    for process in (here, *here.children(recursive=True)):
        with suppress(psutil.NoSuchProcess):
            times = process.cpu_times()
            seconds += times.user + times.system
    return seconds


if __name__ == "__main__":
    typer.run(main)
