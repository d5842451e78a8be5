"""Tour length and planning time of every trajectory scheduler, and the paper's Disaster Survey.

Example: python benchmarks/routes.py --json routes.json
"""

from __future__ import annotations

import math
import statistics
import time
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from _report import Report

from aerodaas.config.plugins import load_plugin
from aerodaas.messages.waypoints import Waypoint
from aerodaas.schedulers.trajectory.base import PlanningContext, TrajectoryScheduler
from aerodaas.schedulers.trajectory.optimal import OptimalScheduler
from aerodaas.schedulers.trajectory.travel import tour_length

SCHEDULERS = ("ordered", "nearest_neighbor", "deadline", "optimal")
AIMS = {10: 0.1, 50: 0.5, 200: 2.0}
"""Seconds in which the optimal scheduler should come within 1 % of the best known."""

Row = dict[str, Any]
_PACKAGES = ("pyvrp", "shapely")


def scatter(count: int, seed: int) -> list[Waypoint]:
    """Waypoints spread evenly at random over a square kilometre, 20 m up."""
    places = np.random.default_rng(seed).uniform(0.0, 1000.0, (count, 2))
    return [Waypoint(f"w{i}", x, y, 20.0, waypoint_type="local") for i, (x, y) in enumerate(places)]


def situation(position: tuple[float, float, float] = (0.0, 0.0, 20.0)) -> PlanningContext:
    """A drone at `position` whose home is the origin, at the same height."""
    return PlanningContext(0.0, np.array(position), np.array([0.0, 0.0, position[2]]), speed=5.0)


def measure(count: int, seeds: int, long_run: float) -> list[Row]:
    """Every scheduler over `seeds` instances of `count` waypoints, against a long search."""
    here = situation()
    instances = [scatter(count, seed) for seed in range(seeds)]
    known = [tour_length(OptimalScheduler(budget=long_run).plan(i, here), here) for i in instances]
    rows: list[Row] = []
    for name in SCHEDULERS:
        scheduler: TrajectoryScheduler = load_plugin("trajectory_schedulers", name)()
        scheduler.plan(instances[0][:3], here)
        lengths, times = [], []
        for instance in instances:
            began = time.perf_counter()
            plan = scheduler.plan(instance, here)
            times.append(time.perf_counter() - began)
            lengths.append(tour_length(plan, here))
        known = [min(pair) for pair in zip(known, lengths, strict=True)]
        rows.append({"waypoints": count, "scheduler": name, "lengths": lengths, "times": times})
    for row in rows:
        lengths, times = row.pop("lengths"), row.pop("times")
        gaps = [length / best - 1.0 for length, best in zip(lengths, known, strict=True)]
        row |= {
            "length_m": statistics.fmean(lengths),
            "above_best_known_percent": 100.0 * statistics.fmean(gaps),
            "worst_above_best_known_percent": 100.0 * max(gaps),
            "plan_s": statistics.fmean(times),
            "longest_plan_s": max(times),
        }
    return rows


def disaster_survey() -> list[Row]:
    """Four corners of 10 m x 10 m; three more on 10 m x 20 m arrive at the second corner.

    The paper gives no coordinates of the added waypoints; here they lie in the order in which a
    remote user might click them: far side, near side, far side.
    """
    height = 1.5
    first = [(0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0)]
    added = [(10.0, 30.0), (10.0, 12.0), (0.0, 30.0)]

    def waypoints(places: list[tuple[float, float]], prefix: str) -> list[Waypoint]:
        return [
            Waypoint(f"{prefix}{i}", x, y, height, waypoint_type="local")
            for i, (x, y) in enumerate(places, start=1)
        ]

    rows: list[Row] = []
    for name in ("ordered", "nearest_neighbor", "optimal"):
        scheduler: TrajectoryScheduler = load_plugin("trajectory_schedulers", name)()
        pending, position = waypoints(first, "wp"), np.array([0.0, 0.0, height])
        home, flown, visited = position.copy(), 0.0, list[str]()
        while pending:
            now = PlanningContext(0.0, position, home, speed=1.5)
            pending = list(scheduler.plan(pending, now))
            target = pending.pop(0)
            flown += float(np.linalg.norm(target.position - position))
            position = target.position
            visited.append(target.id)
            if target.id == "wp2":
                pending += waypoints(added, "remote")
        flown += float(np.linalg.norm(home - position))
        rows.append({"scheduler": name, "distance_m": flown, "order": " ".join(visited)})
    for row in rows:
        row["saved_m"] = rows[0]["distance_m"] - row["distance_m"]
    return rows


def report_routes(rows: list[Row]) -> Report:
    """The schedulers' tours as a table."""
    units = {"tour": "m", "above best": "%", "worst above": "%", "plan": "ms", "longest plan": "ms"}
    report = Report("routes: random waypoints on a square kilometre", units, packages=_PACKAGES)
    for row in rows:
        figures = {
            "tour": row["length_m"],
            "above best": row["above_best_known_percent"],
            "worst above": row["worst_above_best_known_percent"],
            "plan": 1e3 * row["plan_s"],
            "longest plan": 1e3 * row["longest_plan_s"],
        }
        report.row(f"{row['waypoints']} waypoints, {row['scheduler']}", figures)
    aims = ", ".join(f"{seconds:g} s for {count}" for count, seconds in AIMS.items())
    report.note(f"aim of the optimal scheduler: within 1 % of the best known in {aims}")
    return report


def report_survey(rows: list[Row]) -> Report:
    """The Disaster Survey as a table."""
    units = {"distance": "m", "saved": "m"}
    report = Report("routes: the paper's Disaster Survey", units, packages=_PACKAGES)
    for row in rows:
        report.row(row["scheduler"], {"distance": row["distance_m"], "saved": row["saved_m"]})
        report.note(f"{row['scheduler']}: {row['order']}")
    report.note("saved: against the order given; the paper's nearest neighbour saves 22 m")
    return report


def main(
    sizes: Annotated[list[int] | None, typer.Option("--size", help="Waypoints; repeat it.")] = None,
    seeds: Annotated[int, typer.Option(help="Random instances of each size.")] = 5,
    long_run: Annotated[
        float, typer.Option(help="Seconds of search for the best known tour of 200 waypoints.")
    ] = 20.0,
    json_path: Annotated[
        Path | None, typer.Option("--json", help="Write the figures; the survey's beside it.")
    ] = None,
) -> None:
    """Measure tour length against the best known and time to plan, for each scheduler.

    The best known tour comes from a long search, shorter for fewer waypoints. Random waypoints lie
    on a square kilometre; the drone starts and ends in its corner.
    """
    routes: list[Row] = []
    for size in sizes or list(AIMS):
        routes += measure(size, seeds, long_run * math.sqrt(size / 200))
    reports = {"": report_routes(routes), "-survey": report_survey(disaster_survey())}
    for suffix, report in reports.items():
        report.show()
        if json_path is not None:
            report.write(json_path.with_stem(f"{json_path.stem}{suffix}"))


if __name__ == "__main__":
    typer.run(main)
