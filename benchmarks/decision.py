"""How long one decision of an analytics scheduler takes, by the number of tasks waiting.

python benchmarks/decision.py --json decision.json
"""

from __future__ import annotations

import time
from pathlib import Path
from statistics import fmean, quantiles
from typing import Annotated

import typer
from _report import Report

from aerodaas.clock import NANOSECONDS
from aerodaas.schedulers.analytics.base import (
    MILLISECOND,
    AnalyticsScheduler,
    Profile,
    Resources,
    Result,
    RunOnEdge,
    Task,
    TaskOutcome,
    TaskPlace,
)
from aerodaas.schedulers.analytics.published.profiles import PUBLISHED
from aerodaas.schedulers.analytics.registry import load_scheduler, scheduler_names

UNITS = {
    "mean": "us",
    "arrival": "us",
    "arrival p99": "us",
    "idle": "us",
    "idle p99": "us",
    "timer": "us",
    "finish": "us",
}
FAR = 3600 * NANOSECONDS
"""Relative deadline of the tasks that fill the queue, so that none of them leaves."""


def main(
    scheduler: Annotated[str, typer.Option(help="Comma-separated; default all.")] = "",
    waiting: Annotated[str, typer.Option(help="Tasks waiting, comma-separated.")] = "10,100,1000",
    rounds: Annotated[int, typer.Option(help="Decisions of each kind.", min=10)] = 300,
    json: Annotated[Path | None, typer.Option(help="File for the figures.")] = None,
) -> None:
    """Microseconds per event at 10, 100 and 1,000 queued tasks.

    Each round, one task arrives, one execution ends on the edge, the idle edge is offered, and a
    timer comes; the queue is refilled, so that its length stays. The mean is over all four.
    """
    report = Report("decision", UNITS)
    for name in scheduler.split(",") if scheduler else scheduler_names():
        for count in waiting.split(","):
            report.row(f"{name} {count}", _measure(load_scheduler(name), int(count), rounds))
    report.note("CPU time, so that other work on the machine does not count.")
    report.note("The published system's whole overhead with DEMS: 10,000 us per frame.")
    report.show()
    if json is not None:
        report.write(json)


def _measure(scheduler: AnalyticsScheduler, count: int, rounds: int) -> dict[str, float]:
    """Drive the scheduler by hand, with tasks of the six models whose deadlines are far."""
    profiles = [_patient(profile) for profile in PUBLISHED.values()]
    spent: dict[str, list[float]] = {"arrival": [], "idle": [], "timer": [], "finish": []}
    now = number = 0
    undecided: dict[int, Task] = {}
    running: Task | None = None

    def tell(kind: str, *arguments: object) -> None:
        nonlocal running
        began = time.thread_time_ns()
        decisions = list(getattr(scheduler, _METHODS[kind])(*arguments, now))
        spent[kind].append((time.thread_time_ns() - began) / 1000)
        for decision in decisions:
            task = getattr(decision, "task", None)
            if task is not None:
                undecided.pop(task.id, None)
            if isinstance(decision, RunOnEdge):
                running = decision.task

    def arrive() -> None:
        nonlocal now, number
        now += MILLISECOND
        profile = profiles[number % len(profiles)]
        task = Task(number, profile, now, now + profile.deadline, f"drone{number % 4}")
        undecided[number] = task
        number += 1
        tell("arrival", task)

    scheduler.start(Resources(), now)
    for _ in range(count):
        arrive()
    for _ in range(rounds):
        for _ in range(max(1, min(_REFILL, count - len(undecided)))):
            arrive()
        now += 100 * MILLISECOND
        if running is not None:
            ended, running = running, None
            started = now - ended.profile.edge_time
            tell("finish", Result(ended, TaskOutcome.DONE, TaskPlace.EDGE, started, now))
        tell("idle")
        tell("timer")
    nothing = [0.0, 0.0]
    every = [one for kind in spent.values() for one in kind[-rounds:]]
    return {
        "mean": fmean(every),
        **{kind: fmean(found[-rounds:] or nothing) for kind, found in spent.items()},
        "arrival p99": quantiles(spent["arrival"][-rounds:], n=100)[-1],
        "idle p99": quantiles(spent["idle"][-rounds:], n=100)[-1],
    }


_REFILL = 4
"""Tasks that may arrive in one round: schedulers that decide at once keep none waiting."""
_METHODS = {
    "arrival": "task_arrived",
    "idle": "executor_idle",
    "timer": "timer",
    "finish": "task_finished",
}


def _patient(p: Profile) -> Profile:
    return Profile(
        *(p.model, p.benefit, FAR, p.edge_time, p.cloud_time, p.edge_cost, p.cloud_cost, p.qoe)
    )


if __name__ == "__main__":
    typer.run(main)
