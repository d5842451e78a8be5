"""Workloads, execution times and networks: what chance and the world do to tasks."""

from __future__ import annotations

import json
import random
from itertools import pairwise
from pathlib import Path
from statistics import fmean, quantiles, stdev

import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerodaas.clock import NANOSECONDS
from aerodaas.errors import SchedulerError, UnknownIdError
from aerodaas.schedulers.analytics.base import MILLISECOND
from aerodaas.schedulers.lab.network import ExecutionTimes, Network
from aerodaas.schedulers.lab.sample import SamplePath
from aerodaas.schedulers.lab.workload import SIX, Workload, load_workload

MINUTE = 60 * NANOSECONDS


@pytest.mark.parametrize("name", SIX)
def test_each_drone_makes_a_task_per_model_and_second(name: str) -> None:
    """In order of arrival, numbered from zero, all of a segment's tasks at one moment."""
    workload = Workload.named(name, MINUTE)
    tasks = workload.tasks(0, random.Random(0))
    assert len(tasks) == int(name[0]) * len(workload.models) * 60
    assert [task.id for task in tasks] == list(range(len(tasks)))
    assert all(a.arrival <= b.arrival for a, b in pairwise(tasks))
    segment = [t for t in tasks if (t.source, t.segment) == ("drone0", 7)]
    assert {t.profile.model for t in segment} == set(workload.models)
    assert len({t.arrival for t in segment}) == 1


def test_a_fleet_is_dealt_over_its_edges() -> None:
    """80 drones over 7 edges: 11 or 12 each, every drone on one edge only."""
    workload = Workload.named("80D-A/7", 2 * NANOSECONDS)
    drones = [{t.source for t in workload.tasks(edge, random.Random(edge))} for edge in range(7)]
    assert sorted(len(found) for found in drones) == [11, 11, 11, 11, 12, 12, 12]
    assert len(set().union(*drones)) == 80


@pytest.mark.parametrize("name", ["3D", "D-A", "3D-X", "", "3D-A/0"])
def test_unknown_workloads_are_refused(name: str) -> None:
    """With the names that exist, or the reason."""
    with pytest.raises((UnknownIdError, SchedulerError)):
        Workload.named(name)


def test_a_workload_from_a_file(tmp_path: Path) -> None:
    """Models of one's own beside published ones; listed tasks keep their measured times."""
    file = tmp_path / "patrol.json"
    fire = {"benefit": 80, "deadline_ms": 600, "edge_ms": 90, "cloud_ms": 210, "qoe_bonus": 5}
    content = {
        "name": "patrol",
        "edges": 2,
        "duration_s": 10,
        "models": {"HV": "published", "fire": fire},
        "tasks": [
            {"at_s": 2.0, "model": "fire", "edge": 1, "cloud_ms": 333},
            {"at_s": 1.0, "model": "HV", "edge": 1, "source": "drone4"},
        ],
    }
    file.write_text(json.dumps(content))
    workload = load_workload(file)
    path = SamplePath.draw(workload, 1, 0, ExecutionTimes(), Network())
    assert [(t.profile.model, t.arrival // MILLISECOND) for t in path.tasks] == [
        ("HV", 1000),
        ("fire", 2000),
    ]
    assert path.cloud_times == [398 * MILLISECOND, 333 * MILLISECOND]
    assert path.edge_times == [174 * MILLISECOND, 90 * MILLISECOND]
    assert SamplePath.draw(workload, 0, 0, ExecutionTimes(), Network()).tasks == []


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"models": {"fire": {"benefit": 1}}}, "models.fire"),
        ({"models": {"fire": "published"}}, "published models are HV"),
        ({"models": {}}, "models"),
        ({"drones": 0}, "drones"),
        ({"speed": 1}, "speed"),
        ({"tasks": [{"at_s": 0, "model": "nope"}]}, "'nope' on edge 0"),
        ({"tasks": [{"at_s": 0, "model": "HV", "edge": 3}]}, "on edge 3"),
    ],
)
def test_a_bad_file_is_explained(tmp_path: Path, change: dict[str, object], words: str) -> None:
    """By the file's name and the place in it."""
    file = tmp_path / "bad.json"
    file.write_text(json.dumps({"models": {"HV": "published"}, **change}))
    with pytest.raises(SchedulerError, match=f"bad.json.*{words}"):
        load_workload(file)


@pytest.mark.parametrize("distribution", ["lognormal", "gamma"])
@pytest.mark.parametrize("variation", [0.15, 0.5])
def test_factors_have_mean_one_and_the_variation_asked_for(
    distribution: str, variation: float
) -> None:
    """Over 40,000 draws."""
    times = ExecutionTimes.named(f"{distribution}:{variation}")
    factors = times.factors(40_000, random.Random(0))
    assert fmean(factors) == pytest.approx(1, abs=0.01)
    assert stdev(factors) == pytest.approx(variation, rel=0.03)
    assert min(factors) > 0
    assert times.name == f"{distribution}:{variation}"


def test_the_table_may_be_a_quantile() -> None:
    """95 % of the draws stay below the table's time."""
    factors = ExecutionTimes.named("lognormal:0.3@0.95").factors(40_000, random.Random(0))
    assert quantiles(factors, n=20)[-1] == pytest.approx(1, abs=0.02)


@pytest.mark.parametrize(
    "text", ["normal", "lognormal:x", "gamma:-1", "gamma:0.1@0.9", "lognormal:1@2"]
)
def test_times_that_make_no_sense_are_refused(text: str) -> None:
    """Unknown distributions, negative variations, quantiles that do not exist."""
    with pytest.raises(SchedulerError):
        ExecutionTimes.named(text)


def test_the_trapezium_rises_holds_and_falls() -> None:
    """Over 100 s: nothing until 20, 400 ms from 40 to 60, nothing from 80 on."""
    network = Network.named("trapezium", 100 * NANOSECONDS)
    added = []
    for second in (0, 20, 30, 40, 50, 60, 70, 80, 99):
        taken = network.cloud_time(1000, second * NANOSECONDS)
        assert taken is not None
        added.append((taken - 1000) / MILLISECOND)
    assert added == [0, 0, 200, 400, 400, 400, 200, 0, 0]


def test_an_outage_loses_what_overlaps_it() -> None:
    """Begun before, within, after; the earliest end is sought after it."""
    network = Network.named("outage:10-20", MINUTE)
    second = NANOSECONDS
    assert network.cloud_time(second, 8 * second) == second
    assert network.cloud_time(second, 10 * second - 1) is None
    assert network.cloud_time(second, 15 * second) is None
    assert network.cloud_time(second, 20 * second) == second
    assert network.earliest_end(second, 15 * second) == 21 * second


@pytest.mark.parametrize(
    "name", ["nope", "outage:5", "outage:9-3", "trapezium:high", "trace:nowhere.csv"]
)
def test_networks_that_make_no_sense_are_refused(name: str) -> None:
    """By what was written."""
    with pytest.raises((UnknownIdError, SchedulerError), match=name.split(":", maxsplit=1)[0]):
        Network.named(name, MINUTE)


@given(st.integers(0, 120), st.integers(1, 2000), st.integers(0, 50))
def test_the_earliest_end_is_a_bound(start: int, nominal: int, later: int) -> None:
    """No start at or after `start` ends before it."""
    network = Network.named("trapezium+outage:30-40,41-50,90-100", 100 * NANOSECONDS)
    begin, nominal = start * NANOSECONDS, nominal * MILLISECOND
    earliest = network.earliest_end(nominal, begin)
    other = begin + later * NANOSECONDS // 7
    taken = network.cloud_time(nominal, other)
    if taken is not None:
        assert earliest is not None
        assert earliest <= other + taken
