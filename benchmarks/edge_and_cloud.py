"""Situation Awareness over an edge and a cloud: what an analytics scheduler does to a flight.

In simulated time, on an edge of a quarter of this machine's speed: its two networks take 100 and
140 ms there, and five frames a second leave 200 ms for both. In the cloud they take the 25 and
35 ms that they take here, 70 ms for the way there and back, and 42 ms for 53 kB of JPEG at
10 Mbit/s. These times are assumed; those of one execution are drawn around them. Benefits and
deadlines are the application's. Results come as late as they would, and the drone flies by them.

python benchmarks/edge_and_cloud.py
python benchmarks/edge_and_cloud.py --scheduler dems --network outage --seeds 5
"""

from __future__ import annotations

import json as json_format
import shutil
import statistics
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from _report import machine_line
from missions.catalogue import MISSIONS
from missions.evidence import Evidence
from missions.flying import fly
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from aerodaas.recording.reader import Recording

_MISSION = MISSIONS["situation_awareness"]
_TIMES = {"vip_detection": (100, 137), "body_pose": (140, 147)}
"""Milliseconds on the edge and in the cloud."""
_SCHEDULERS = ("edf", "ec_edf", "dems", "margin")
_NETWORKS = ("steady", "trapezium:400", "outage")
_COMMANDS = "/tello/vip_follow/navigation"
_SETTLED, _DISTANCE, _WITHIN = 10.0, 2.0, 0.5
"""Seconds until it has come up; metres of the mission's own criterion."""


@dataclass(frozen=True, slots=True)
class Row:
    """One flight."""

    scheduler: str
    network: str
    seed: int
    tasks: int
    in_time: float
    """Share of the tasks whose result came by its deadline."""
    in_cloud: float
    """Share of those results that came from the cloud."""
    age: tuple[float, float]
    """Milliseconds from a frame's capture to its command, median and 99th percentile."""
    held: float
    """Share of the following at 2 m +/- 0.5 m."""
    nearest: float
    """Metres."""
    fall_told: float
    """Seconds from the fall to the alert; NaN without one."""
    missed: tuple[str, ...]
    """Criteria of the paper's applications that it missed."""


def main(
    scheduler: Annotated[list[str] | None, typer.Option(help="A scheduler; repeat it.")] = None,
    network: Annotated[list[str] | None, typer.Option(help="A network; repeat it.")] = None,
    seeds: Annotated[int, typer.Option(help="Flights of each pair.", min=1)] = 1,
    first: Annotated[int, typer.Option(help="The first seed.", min=0)] = 0,
    json: Annotated[Path | None, typer.Option(help="Write the figures to this file.")] = None,
) -> None:
    """Fly with each scheduler over each network, and show what became of tasks and flight."""
    pairs = [(one, way) for way in network or _NETWORKS for one in scheduler or _SCHEDULERS]
    rows = []
    with Progress(transient=True) as progress:
        task = progress.add_task("flying", total=len(pairs) * seeds)
        for name, way in pairs:
            for seed in range(first, first + seeds):
                progress.update(task, description=f"{name}, {way}, seed {seed}")
                rows.append(_flown(name, way, seed))
                progress.advance(task)
    _show(rows)
    if json is not None:
        json.write_text(json_format.dumps([asdict(row) for row in rows], indent=2) + "\n")


def _flown(scheduler: str, network: str, seed: int) -> Row:
    settings: dict[str, object] = {
        "simulation.execution_times": "lognormal:0.2",
        "simulation.network": network,
        "simulation.network_period": 250,
    }
    for name, (edge, cloud) in _TIMES.items():
        settings[f"schedulers.tasks.{name}.edge_time"] = edge
        settings[f"schedulers.tasks.{name}.cloud_time"] = cloud
    folder = Path(tempfile.mkdtemp(prefix="edge-and-cloud-"))
    try:
        flown = fly(_MISSION, seed, folder, settings=settings, options=("--scheduler", scheduler))
        if flown.code:
            typer.echo(flown.output, err=True)
            raise typer.Exit(1)
        return _row(scheduler, network, seed, flown.recording)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _row(scheduler: str, network: str, seed: int, path: Path) -> Row:
    evidence = Evidence.read(path)
    with Recording.open(path) as recording:
        decisions = [r.value for r in recording.records(schemas=["aerodaas.Decision"])]
        ages = [(r.stamp - r.captured) / 1e6 for r in recording.records(topics=[_COMMANDS])]
    ends = [one for one in decisions if one.action not in {"edge", "cloud", "retry"}]
    done = [one.reason.partition(":")[0] for one in ends if one.action == "done"]
    away = evidence.to_thing("vip")
    steady = evidence.during("following", settled=_SETTLED)
    fall = evidence.gesture("vip", "fallen").start
    told = [at - fall for at, _, text in evidence.flight.alerts if "fallen" in text and at >= fall]
    return Row(
        scheduler,
        network,
        seed,
        len(ends),
        len(done) / len(ends),
        done.count("cloud") / len(done) if done else 0.0,
        (float(np.median(ages)), float(np.percentile(ages, 99))),
        float((np.abs(away[steady] - _DISTANCE) <= _WITHIN).mean()) if steady.any() else 0.0,
        float(away[evidence.during("following")].min()),
        min(told, default=float("nan")),
        tuple(check.what for check in _MISSION.judge(path) if not check.holds),
    )


def _show(rows: list[Row]) -> None:
    table = Table(title="Situation Awareness, 5 frames a second", caption=machine_line())
    columns = ("network", "scheduler", "in time %", "of these in the cloud %", "command's age ms")
    for name in (*columns, "at 2 ± 0.5 m %", "nearest m", "fall told s", "met criteria"):
        table.add_column(name, justify="left" if name in columns[:2] else "right")
    for scheduler, network in dict.fromkeys((row.scheduler, row.network) for row in rows):
        mine = [row for row in rows if (row.scheduler, row.network) == (scheduler, network)]
        middle = statistics.median
        table.add_row(
            network,
            scheduler,
            f"{100 * middle(row.in_time for row in mine):.0f}",
            f"{100 * middle(row.in_cloud for row in mine):.0f}",
            f"{middle(row.age[0] for row in mine):.0f}, {middle(row.age[1] for row in mine):.0f}",
            f"{100 * middle(row.held for row in mine):.1f}",
            f"{min(row.nearest for row in mine):.2f}",
            f"{middle(row.fall_told for row in mine):.1f}",
            f"{sum(not row.missed for row in mine)} of {len(mine)}",
        )
    Console(width=max(140, Console().width), highlight=False).print(table)


if __name__ == "__main__":
    typer.run(main)
