"""Look-ahead for a serial executor: the most valuable sequence of jobs over the next seconds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from heapq import nlargest
from operator import itemgetter
from typing import Any

from aerodaas.schedulers.analytics.estimates import Belief, chance

__all__ = ["Job", "Lane", "plan"]


@dataclass(slots=True)
class Job:
    """Something the executor could run."""

    what: Any
    """A task, or the source of one that is forecast."""
    release: float
    deadline: float
    benefit: float
    loss: float
    """What running it costs: its own cost, and what it would be worth elsewhere."""


@dataclass(slots=True)
class Lane:
    """Jobs of one model in order of release; one is only taken after those before it."""

    time: Belief
    jobs: list[Job]


def plan(
    lanes: Sequence[Lane], start: float, until: float, price: float, *, width: int, gap: float
) -> list[tuple[float, Lane, Job]]:
    """Choose jobs and their starts from `start` to about `until`, by beam search.

    A state is the executor's free time and each lane's next job; its merit the expected gains so
    far less `price` per nanosecond passed, so that plans of different ends compare (the average-
    reward criterion, Howard, 1960). `width` states survive each step, and no idle time above
    `gap` is considered. Takes at most width x lanes x steps evaluations of a gain.
    """
    beam: list[tuple[float, float, tuple[int, ...], Any]] = [(0.0, start, (0,) * len(lanes), None)]
    best_merit, best = -1e300, None
    while beam:
        grown: dict[tuple[int, ...], tuple[float, float, tuple[int, ...], Any]] = {}
        for merit, free, taken, chain in beam:
            ended = True
            for number, lane in enumerate(lanes):
                jobs = lane.jobs
                index = taken[number]
                mean = lane.time.mean
                sigma = lane.time.sigma
                count = len(jobs)
                while index < count and jobs[index].deadline < free + mean - sigma:
                    index += 1
                if index == count:
                    continue
                job = jobs[index]
                begin = job.release if job.release > free else free
                if begin - free > gap:
                    continue
                room = job.deadline - begin
                sure = room - mean > 4 * sigma
                gain = (job.benefit if sure else job.benefit * chance(lane.time, room)) - job.loss
                if gain <= 0:
                    continue
                ended = False
                end = begin + mean
                value = merit + gain - price * (end - free)
                if end >= until:
                    if value > best_merit:
                        best_merit, best = value, (chain, begin, lane, job)
                    continue
                key = (*taken[:number], index + 1, *taken[number + 1 :])
                known = grown.get(key)
                if known is None or known[0] < value:
                    grown[key] = (value, end, key, (chain, begin, lane, job))
            if ended and chain is not None:
                value = merit - price * (until - free) * 0.5
                if value > best_merit:
                    best_merit, best = value, chain
        beam = nlargest(width, grown.values(), key=itemgetter(0))
    steps: list[tuple[float, Lane, Job]] = []
    while best is not None:
        best, begin, lane, job = best
        steps.append((begin, lane, job))
    steps.reverse()
    return steps
