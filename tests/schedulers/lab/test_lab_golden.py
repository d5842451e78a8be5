"""Every scheduler decides as it always did: a faster lab changes no result."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pytest

from aerodaas.clock import NANOSECONDS
from aerodaas.schedulers.analytics.base import Resources
from aerodaas.schedulers.analytics.registry import load_scheduler, scheduler_names
from aerodaas.schedulers.lab.network import ExecutionTimes, Network
from aerodaas.schedulers.lab.sample import SamplePath
from aerodaas.schedulers.lab.simulator import Trace, simulate
from aerodaas.schedulers.lab.workload import Workload

GOLDEN = Path(__file__).with_name("lab_golden.json")
"""Digests by scheduler and case; `REGENERATE` shows how they were made."""
CASES = {
    "steady": (Workload.named("80D-A/7", 5 * NANOSECONDS), "nominal", "steady", 32),
    "varying": (Workload.named("4D-P", 20 * NANOSECONDS), "lognormal:0.3", "trapezium", 3),
    "outages": (Workload.named("12D-A", 10 * NANOSECONDS), "gamma:0.15", "outage", 32),
    "no cloud": (Workload.named("3D-A", 20 * NANOSECONDS), "lognormal:0.15", "steady", 0),
}
REGENERATE = "python -c 'from test_lab_golden import digests; print(digests())' > lab_golden.json"


def run(scheduler: str, case: str) -> Trace:
    """The trace of a scheduler on one edge."""
    load, times, network, slots = CASES[case]
    wavering = Network.named(network, load.duration)
    path = SamplePath.draw(load, 0, 7, ExecutionTimes.named(times), wavering)
    return simulate(path, load_scheduler(scheduler), Resources(slots), record=True)


def digest(trace: Trace) -> str:
    """Digest of all decisions and ends, each with its time."""
    told = [
        *((at, type(one).__name__, one.task.id, one.reason) for at, one in trace.decisions),
        *(
            (r.task.id, r.outcome.value, r.place.value, r.started, r.finished)
            for r in trace.results
        ),
    ]
    return hashlib.sha256(repr(told).encode()).hexdigest()[:16]


def digests() -> str:
    """Digests of all schedulers in all cases, as JSON."""
    found = {name: {case: digest(run(name, case)) for case in CASES} for name in scheduler_names()}
    return json.dumps(found, indent=1)


@pytest.mark.parametrize("name", scheduler_names())
def test_decisions_are_as_before(name: str) -> None:
    """A digest that differs is an error, or a decision that is meant to change: see its diff."""
    expected = json.loads(GOLDEN.read_text(encoding="utf-8"))[name]
    assert {case: digest(run(name, case)) for case in CASES} == expected
