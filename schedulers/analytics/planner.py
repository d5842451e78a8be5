"""Look-ahead for a serial executor: the most valuable sequence of jobs over the next seconds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from operator import itemgetter
from typing import Any

from aerodaas.schedulers.analytics.estimates import TimeEstimate, chance

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
    """Cost of running it: its own cost, and its value elsewhere."""


@dataclass(slots=True)
class Lane:
    """Jobs of one model in order of release; one is only taken after those before it."""

    time: TimeEstimate
    jobs: list[Job]


_Chain = tuple[Any, float, Lane, Job] | None
"""The chain before, a start, a lane and a job."""
_State = tuple[float, float, int, _Chain]
"""Merit, time when the executor is free, the lanes' positions, the plan.

A lane's position, the number of its jobs taken or passed over, is one digit of an integer: such
keys are much cheaper to make and to compare than tuples, and they are made most of the time.
"""

_merit = itemgetter(0)
_IDLE_SHARE = 0.5
"""Share of the price that idle time costs where no job is known: some will arrive."""


def plan(
    lanes: Sequence[Lane], start: float, until: float, price: float, *, width: int, gap: float
) -> list[tuple[float, Lane, Job]]:
    """Choose jobs and their starts from `start` to about `until`, by beam search.

    A state's merit is the expected gains so far less `price` per nanosecond passed, so that
    plans of different ends compare (the average-reward criterion, Howard, 1960). `width` states
    survive each step, and no idle time above `gap` is considered. Takes at most
    width x lanes x steps evaluations of a gain.
    """
    beam: list[_State] = [(0.0, start, 0, None)]
    longest = max((len(lane.jobs) for lane in lanes), default=0)
    digits = longest.bit_length()
    places = [(number * digits, lane) for number, lane in enumerate(lanes)]
    mask = (1 << digits) - 1
    best_merit = -inf
    best: _Chain = None
    while beam:
        grown: dict[int, _State] = {}
        for state in beam:
            successors = _successors(state, places, mask, price, gap)
            for successor in successors:
                merit, free, taken, chain = successor
                if free >= until:
                    if merit > best_merit:
                        best_merit, best = merit, chain
                    continue
                # Of two ways to the same merit, the one that is done earlier leaves more room.
                rival = grown.get(taken)
                if rival is None or rival[0] < merit or (rival[0] == merit and rival[1] > free):
                    grown[taken] = successor
            if not successors:
                merit = state[0] - price * _IDLE_SHARE * (until - state[1])
                if merit > best_merit:
                    best_merit, best = merit, state[3]
        beam = sorted(grown.values(), key=_merit, reverse=True)[:width]
    steps: list[tuple[float, Lane, Job]] = []
    while best is not None:
        best, begin, lane, job = best
        steps.append((begin, lane, job))
    steps.reverse()
    return steps


def _successors(
    state: _State, places: Sequence[tuple[int, Lane]], mask: int, price: float, gap: float
) -> list[_State]:
    """What each lane's next job makes of `state`; a lane's place is that of its digit, in bits."""
    merit, free, taken, chain = state
    found: list[_State] = []
    for shift, lane in places:
        jobs, belief = lane.jobs, lane.time
        mean = belief.mean
        position = index = taken >> shift & mask
        hopeless = free + mean - belief.sigma
        for job in jobs[position:] if position else jobs:
            index += 1
            if job.deadline < hopeless:
                continue
            release = job.release
            begin = max(free, release)
            if begin - free <= gap:
                gain = job.benefit * chance(belief, job.deadline - begin) - job.loss
                if gain > 0:
                    end = begin + mean
                    after = taken + (index - position << shift)
                    found.append(
                        (merit + gain - price * (end - free), end, after, (chain, begin, lane, job))
                    )
            break
    return found
