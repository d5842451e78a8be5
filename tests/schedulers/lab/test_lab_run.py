"""The simulator, the score and the runs over seeds."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path

import pytest

from aerodaas.clock import NANOSECONDS
from aerodaas.errors import SchedulerError, UnknownIdError
from aerodaas.schedulers.analytics.base import (
    MILLISECOND,
    Decision,
    Profile,
    QoeGoal,
    Resources,
    Task,
)
from aerodaas.schedulers.analytics.published.cloud_only import CloudOnly
from aerodaas.schedulers.analytics.published.edge_only import Fifo
from aerodaas.schedulers.analytics.registry import load_scheduler
from aerodaas.schedulers.lab.metrics import mean_of, score
from aerodaas.schedulers.lab.network import ExecutionTimes, Network
from aerodaas.schedulers.lab.plots import plot_bars, plot_timeline
from aerodaas.schedulers.lab.run import run_lab
from aerodaas.schedulers.lab.sample import SamplePath
from aerodaas.schedulers.lab.simulator import simulate
from aerodaas.schedulers.lab.workload import TaskArrival, Workload

SHORT = Workload.named("2D-A", 10 * NANOSECONDS)
VARYING = ExecutionTimes("lognormal", 0.15)


def test_the_score_of_a_case_worked_by_hand() -> None:
    """Two in time on the edge, one late, one dropped; a window of QoE won, one lost."""
    goal = QoeGoal(50, 0.5, NANOSECONDS)
    profile = Profile("m", 100, 300 * MILLISECOND, 200 * MILLISECOND, 300 * MILLISECOND, 2, 9, goal)
    arrivals = (0, 1000, 1400, 1410)
    tasks = [
        Task(number, profile, ms * MILLISECOND, ms * MILLISECOND + profile.deadline)
        for number, ms in enumerate(arrivals)
    ]
    # The third takes 350 instead of 200; the fourth has no time left when it ends at 1750.
    edge = [200 * MILLISECOND, 200 * MILLISECOND, 350 * MILLISECOND, 200 * MILLISECOND]
    path = SamplePath(tasks, edge, [1] * 4, Network())
    found = score(tasks, simulate(path, Fifo()))
    assert (found.tasks, found.done, found.late, found.dropped) == (4, 2, 1, 1)
    assert found.qos == 98 + 98 - 2
    assert found.qoe == 50
    assert found.cost == 6
    assert found.edge_busy == 750 * MILLISECOND
    assert found.completion == 0.5
    assert found.done_by_model == {"m": 2}


def test_cloud_slots_limit_what_runs_at_once() -> None:
    """With 4 slots the cloud is never busier than that, and fewer tasks finish than with 32."""
    path = SamplePath.draw(Workload.named("4D-A", 10 * NANOSECONDS), 0, 0, VARYING, Network())
    few = score(path.tasks, simulate(path, CloudOnly(), Resources(cloud_slots=4)))
    many = score(path.tasks, simulate(path, CloudOnly()))
    assert few.cloud_busy <= 4 * 12 * NANOSECONDS
    assert few.done < many.done


def test_a_run_leaves_the_scheduler_as_it_was() -> None:
    """The instance is a recipe: simulating twice with it gives the same."""
    path = SamplePath.draw(SHORT, 0, 1, VARYING, Network())
    scheduler = load_scheduler("margin")
    first = score(path.tasks, simulate(path, scheduler))
    assert score(path.tasks, simulate(path, scheduler)) == first


def test_seeds_give_identical_results_however_they_are_spread() -> None:
    """Here, over two processes, and through a map of the caller's own."""
    arguments = (SHORT, ["ec_edf", "margin"], [3, 1])
    alone = run_lab(*arguments, times=VARYING, jobs=1)
    together = run_lab(*arguments, times=VARYING, jobs=2)
    elsewhere = run_lab(*arguments, times=VARYING, spread=map)
    assert alone == together == elsewhere
    assert alone.scores["margin"][0] != alone.scores["margin"][1]


def test_progress_and_figures() -> None:
    """Each part is reported; figures are shares and rates with intervals."""
    seen: list[tuple[int, int]] = []
    result = run_lab(
        SHORT, ["ec_edf"], [0, 1], jobs=1, progress=lambda done, all_: seen.append((done, all_))
    )
    assert seen == [(1, 2), (2, 2)]
    figures = result.figures("ec_edf")
    assert 0 < figures["of bound"].value <= 1
    assert figures["completion"].margin >= 0


@pytest.mark.parametrize(
    ("schedulers", "seeds", "error"),
    [
        ([], [0], SchedulerError),
        (["dems"], [], SchedulerError),
        (["dems", "dems"], [0], SchedulerError),
        (["nope"], [0], UnknownIdError),
    ],
)
def test_runs_that_make_no_sense_are_refused(
    schedulers: list[str], seeds: list[int], error: type[Exception]
) -> None:
    """Before anything is simulated."""
    with pytest.raises(error):
        run_lab(SHORT, schedulers, seeds)


def test_means_and_intervals() -> None:
    """Of 1, 2, 3: mean 2, standard deviation 1, t(2) = 4.303: 2.484; a single value has none."""
    mean = mean_of([1, 2, 3])
    assert mean.value == 2
    assert mean.margin == pytest.approx(4.303 / math.sqrt(3))
    assert math.isnan(mean_of([5]).margin)


def test_plots_are_drawn(tmp_path: Path) -> None:
    """Both, for a network with an outage, without a display."""
    network = Network.named("outage", SHORT.duration)
    result = run_lab(SHORT, ["cld", "margin"], [0, 1], network=network, jobs=1)
    plot_bars(result, tmp_path / "bars.png")
    path = SamplePath.draw(SHORT, 0, 0, VARYING, network)
    trace = simulate(path, load_scheduler("margin"))
    plot_timeline(trace, tmp_path / "timeline.png", "margin", 2, 6)
    sizes = [(tmp_path / f"{name}.png").stat().st_size for name in ("bars", "timeline")]
    assert min(sizes) > 5000


def test_a_workload_on_more_edges_has_as_many_drones_on_each() -> None:
    """Of 80 on 7 edges, 34 on 3."""
    assert SHORT.on_edges(5).drones == 10
    fleet = Workload.named("80D-A/7").on_edges(3)
    assert (fleet.drones, fleet.edges) == (34, 3)
    listed = Workload("listed", SHORT.models, arrivals=(TaskArrival(0, "HV"),))
    with pytest.raises(SchedulerError, match="lists its tasks"):
        listed.on_edges(2)


def test_one_seed_has_intervals_over_its_edges() -> None:
    """Rates are sums over the edges, and so their intervals; of two seeds it is over those."""
    fleet = SHORT.on_edges(4)
    result = run_lab(fleet, ["ec_edf"], [2], times=VARYING, bound=False, jobs=1)
    scores = result.edges["ec_edf"]
    figures = result.figures("ec_edf")
    rate = figures["qos per s"]
    assert rate.value == sum(one.qos for one in scores) / 10
    assert rate.margin == pytest.approx(4 * mean_of([one.qos / 10 for one in scores]).margin)
    share = mean_of([one.completion for one in scores])
    assert figures["completion"].margin == share.margin
    several = run_lab(fleet, ["ec_edf"], [2, 3], times=VARYING, bound=False, jobs=1)
    assert several.edges == {}
    assert several.figures("ec_edf")["qos per s"] == mean_of(
        [one.qos / 10 for one in several.scores["ec_edf"]]
    )


class Fragile(Fifo):
    """Raises an exception of its own where a certain drone's task comes."""

    class BrokenError(Exception):
        """Cannot be made of its text alone, and so not be pickled."""

        def __init__(self, what: str, where: int) -> None:
            super().__init__(f"{what} {where}")

    def task_arrived(self, task: Task, now: int) -> Iterable[Decision]:
        """Break at drone 3."""
        if task.source == "drone3":
            raise self.BrokenError("no", 3)
        return super().task_arrived(task, now)


@pytest.mark.parametrize("jobs", [1, 2])
def test_an_error_is_told_with_its_seed_and_edge(jobs: int) -> None:
    """Drone 3 of four is the second of edge 1; by processes, too."""
    fleet = Workload.named("4D-P/2", NANOSECONDS)
    told = r"^Fragile with seed 5 on edge 1: BrokenError: no 3 at test_lab_run.py:\d+$"
    with pytest.raises(SchedulerError, match=told):
        run_lab(fleet, [Fragile], [5, 6], bound=False, jobs=jobs)
