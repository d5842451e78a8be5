"""Figures of runs with different seeds: rows of a table, their means, and files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from aerodaas.cli.flying.seeds.runs import SeededRun
from aerodaas.schedulers.lab.metrics import mean_of
from aerodaas.terminal.figures import Row, show_figures

__all__ = ["rows", "show"]

_OUTCOME, _FAILED = "outcome", "failed"
_ENDS = ("done", "late", "timeout", "failed", "drop", "dropped")
"""How a task ends; `drop` is a decision that is its end as well."""


def rows(runs: Sequence[SeededRun]) -> list[dict[str, Any]]:
    """One row for each run: seed, outcome, figures; the same columns for all.

    Of several robots, flight times and heights are the largest, distances and waypoints sums.
    What the application counts comes last: detections by label, and of an analytics scheduler
    the tasks in time, of those begun the ones in the cloud, and utility. A figure that a run has
    not is None.
    """
    found = [{"seed": run.seed, _OUTCOME: _outcome(run), **_figures(run)} for run in runs]
    columns = dict.fromkeys(name for row in found for name in row)
    return [{name: row.get(name) for name in columns} for row in found]


def show(runs: Sequence[SeededRun], title: str) -> None:
    """Print the runs' table, and below it the means with 95 % intervals."""
    found = rows(runs)
    names = [name for name in found[0] if name != "seed"]
    table = [
        Row(str(row["seed"]), [_cell(row[name]) for name in names], bold=bool(run.failure))
        for row, run in zip(found, runs, strict=True)
    ]
    flown = [row for row, run in zip(found, runs, strict=True) if not run.failure]
    if len(flown) > 1:
        table.append(Row("mean", [_mean([row[name] for row in flown]) for name in names]))
    show_figures(title, "seed", names, table)


def _outcome(run: SeededRun) -> str:
    if run.failure:
        return f"{_FAILED}: {run.failure.splitlines()[0]}"
    if run.summary is None:
        return "ended, not recorded"
    robots = run.summary["robots"]
    outcomes = {robot["outcome"] for robot in robots.values()}
    if len(outcomes) == 1:
        return str(outcomes.pop())
    return "; ".join(f"{name} {robot['outcome']}" for name, robot in robots.items())


def _figures(run: SeededRun) -> dict[str, float]:
    summary = run.summary
    if summary is None:
        return {}
    robots = list(summary["robots"].values())
    figures: dict[str, float] = {}
    if robots:
        figures["flight s"] = max(robot["duration_s"] for robot in robots)
        figures["distance m"] = sum(robot["distance_m"] for robot in robots)
        figures["waypoints"] = sum(robot["waypoints_visited"] for robot in robots)
        figures["given up"] = sum(robot["waypoints_given_up"] for robot in robots)
        used = [robot["battery_used"] for robot in robots if robot["battery_used"] is not None]
        figures.update({"battery used %": round(100 * max(used), 2)} if used else {})
    figures["alerts"] = len(summary["alerts"])
    figures.update({f"{label} seen": count for label, count in summary["detections"].items()})
    figures.update(_tasks(summary["decisions"]))
    figures.update({f"{name} utility": value for name, value in summary["utility"].items()})
    return figures


def _tasks(decisions: Mapping[str, int]) -> dict[str, float]:
    """Shares of an analytics scheduler's tasks, from the counts of its decisions and outcomes."""
    ended = sum(decisions.get(action, 0) for action in _ENDS)
    begun = sum(decisions.get(action, 0) for action in ("edge", "cloud"))
    figures = {}
    if ended:
        figures["in time %"] = round(100 * decisions.get("done", 0) / ended, 2)
    if begun:
        figures["in the cloud %"] = round(100 * decisions.get("cloud", 0) / begun, 2)
    return figures


def _cell(value: object) -> str:
    if value is None:
        return ""
    return f"{value:.1f}" if isinstance(value, float) else str(value)


def _mean(values: Sequence[object]) -> str:
    numbers = [float(value) for value in values if isinstance(value, int | float)]
    if len(numbers) < len(values):
        return ""
    mean = mean_of(numbers)
    return f"{mean.value:.1f} ±{mean.margin:.1f}"
