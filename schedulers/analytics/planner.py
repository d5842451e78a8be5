"""Look-ahead for a serial executor: the most valuable sequence of jobs over the next seconds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import erf, inf
from operator import itemgetter
from typing import Any

from aerodaas.schedulers.analytics.estimates import CERTAIN, SQRT_HALF, TimeEstimate

__all__ = ["Job", "JobQueue", "plan"]


@dataclass(slots=True)
class Job:
    """Something the executor could run.

    Its figures are better floats than integers, which Python compares with floats several times
    slower than floats with each other.
    """

    what: Any
    """A task, or the source of one that is forecast."""
    release: float
    deadline: float
    benefit: float
    loss: float
    """Cost of running it: its own cost, and its value elsewhere."""


@dataclass(slots=True)
class JobQueue:
    """Jobs of one model in order of release; one is only taken after those before it."""

    time: TimeEstimate
    jobs: list[Job]


_Step = tuple[float, JobQueue, Job]
"""When a job starts, and its lane."""
_State = tuple[float, float, int, "_State | None", _Step | None]
"""Merit, time when the executor is free, the lanes' positions; the state before, the step from it.

A lane's position, the number of its jobs taken or passed over, is one digit of an integer: such
keys are much cheaper to make and to compare than tuples, and they are made most of the time.
"""
_Place = tuple[int, int, JobQueue, list[Job], float, float]
"""Place in bits of a lane's digit, 1 in that place, its jobs, mean and deviation of their time."""

_merit = itemgetter(0)
_IDLE_SHARE = 0.5
"""Share of the price that idle time costs where no job is known: some will arrive."""
_NEVER = Job(None, inf, inf, 0.0, 0.0)
"""The last job of each lane: it is never released."""


def plan(
    lanes: Sequence[JobQueue], start: float, until: float, price: float, *, width: int, gap: float
) -> list[_Step]:
    """Choose jobs and their starts, by beam search.

    A state's merit is the expected gains so far less `price` per nanosecond passed, so that plans
    of different ends compare (the average-reward criterion, Howard, 1960). Takes at most width x
    lanes x steps evaluations of a gain.

    Args:
        lanes: The jobs to choose from, a queue for each kind.
        start: Time from which to plan, nanoseconds.
        until: Time at about which the plan ends, nanoseconds.
        price: Utility that a nanosecond is worth.
        width: States that survive each step.
        gap: Longest idle time that is considered, nanoseconds.
    """
    digits = max((len(lane.jobs) for lane in lanes), default=0).bit_length()
    places: list[_Place] = []
    for number, lane in enumerate(lanes):
        shift, time = number * digits, lane.time
        places.append((shift, 1 << shift, lane, [*lane.jobs, _NEVER], time.mean, time.sigma))
    search = _Search(places, (1 << digits) - 1, float(until), price, gap)
    beam: list[_State] = [(0.0, float(start), 0, None, None)]
    while beam:
        grown: dict[int, _State] = {}
        for state in beam:
            search.grow(state, grown)
        beam = sorted(grown.values(), key=_merit, reverse=True)[:width]
    return _steps_to(max(search.ended, key=_merit))


class _Search:
    """State that all branches of a search share, and the plans that are complete."""

    def __init__(
        self, places: list[_Place], mask: int, until: float, price: float, gap: float
    ) -> None:
        self.ended: list[_State] = []
        self._common = (places, mask, until, price, gap)

    def grow(self, state: _State, grown: dict[int, _State]) -> None:  # noqa: C901 - written out
        """Add what each lane's next job makes of `state`; it ends where none gains anything.

        Half of the time of all decisions is spent here, so it calls no function of ours: the
        chance to be in time is that of `estimates.chance`.
        """
        places, mask, until, price, gap = self._common
        merit, free, taken, _, _ = state
        is_last = True
        for shift, one, lane, jobs, mean, sigma in places:
            position = taken >> shift & mask
            after = taken + one
            job = jobs[position]
            while job.deadline < free + mean - sigma:
                position += 1
                after += one
                job = jobs[position]
            release = job.release
            if release <= free:
                begin = free
            elif release - free <= gap:
                begin = release
            else:
                continue
            z = (job.deadline - begin - mean) / sigma
            if z > CERTAIN:
                gain = job.benefit - job.loss
            elif z < -CERTAIN:
                continue
            else:
                gain = job.benefit * (0.5 + 0.5 * erf(z * SQRT_HALF)) - job.loss
            if gain <= 0:
                continue
            is_last = False
            end = begin + mean
            earned = merit + gain - price * (end - free)
            if end >= until:
                self.ended.append((earned, end, after, state, (begin, lane, job)))
                continue
            # Of two ways to the same merit, the one that is done earlier leaves more room.
            rival = grown.get(after)
            if rival is None or rival[0] < earned or (rival[0] == earned and rival[1] > end):
                grown[after] = (earned, end, after, state, (begin, lane, job))
        if is_last:
            earned = merit - price * _IDLE_SHARE * (until - free)
            self.ended.append((earned, until, taken, state, None))


def _steps_to(state: _State) -> list[_Step]:
    steps: list[_Step] = []
    last: _State | None = state
    while last is not None:
        _, _, _, last, step = last
        if step is not None:
            steps.append(step)
    steps.reverse()
    return steps
