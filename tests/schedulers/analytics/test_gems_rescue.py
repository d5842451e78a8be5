"""When GEMS takes a model's waiting tasks to the cloud, at the edges of its rule; milliseconds."""

from __future__ import annotations

import pytest

from aerodaas.clock import NANOSECONDS
from aerodaas.schedulers.analytics.base import (
    MILLISECOND,
    Drop,
    Profile,
    QoeGoal,
    Resources,
    SendToCloud,
    Task,
    WakeAt,
)
from aerodaas.schedulers.analytics.published.gems import Gems
from aerodaas.testing.scheduler_kit import End, play

WINDOW = 20 * NANOSECONDS
BLOCK = Profile("block", 100, 1000 * MILLISECOND, 50 * MILLISECOND, 300 * MILLISECOND, 1, 20)


def _m(deadline: float, *, share: float = 0.9, cost: float = 20, cloud: float = 300) -> Profile:
    """A task of the model m, of 100 on the edge."""
    times = [round(ms * MILLISECOND) for ms in (deadline, 100, cloud)]
    return Profile("m", 100, times[0], times[1], times[2], 1, cost, QoeGoal(100, share, WINDOW))


HOPELESS = 40
"""A deadline that neither the edge nor the cloud can meet."""


@pytest.mark.parametrize(("share", "place"), [(0.5, "edge"), (0.51, "cloud")])
def test_a_model_at_its_share_is_not_in_danger(share: float, place: str) -> None:
    """One of two in time is a half: the third task stays for a goal of 0.5, and leaves for more."""
    tasks = [
        (0.0, _m(900, share=share)),
        (200.0, BLOCK),
        (200.0, _m(900, share=share)),
        (210.0, _m(HOPELESS, share=share)),
    ]
    assert play(Gems(), tasks)[2].place == place


@pytest.mark.parametrize(("deadline", "place"), [(310, "edge"), (311, "cloud")])
def test_only_what_the_cloud_ends_before_its_deadline_is_rescued(
    deadline: float, place: str
) -> None:
    """Sent at 10, the cloud's result comes at 310."""
    ends = play(Gems(), [(0, BLOCK), (0, _m(deadline)), (10, _m(HOPELESS))])
    assert ends[1].place == place
    assert ends[1].outcome == "done"


@pytest.mark.parametrize(("cost", "place"), [(100, "edge"), (99, "cloud")])
def test_only_what_gains_in_the_cloud_is_rescued(cost: float, place: str) -> None:
    """At a cost of its benefit nothing is gained."""
    ends = play(Gems(), [(0, BLOCK), (0, _m(900, cost=cost)), (10, _m(HOPELESS, cost=cost))])
    assert ends[1].place == place


def test_without_a_cloud_nothing_is_rescued() -> None:
    """It waits for the edge, in danger or not."""
    tasks = [(0.0, BLOCK), (0.0, _m(900)), (10.0, _m(HOPELESS))]
    ends = play(Gems(), tasks, resources=Resources(cloud_slots=0))
    assert ends[1] == End("edge", "done", 50, 150)


def test_all_waiting_tasks_of_the_model_are_rescued_and_no_other_models() -> None:
    """Two of m leave at the drop; the one of another model, between them, stays."""
    other = Profile("n", 100, 800 * MILLISECOND, 100 * MILLISECOND, 300 * MILLISECOND, 1, 20)
    ends = play(Gems(), [(0, BLOCK), (0, _m(900)), (0, other), (0, _m(700)), (10, _m(HOPELESS))])
    assert ends[1] == End("cloud", "done", 10, 310)
    assert ends[3] == End("cloud", "done", 10, 310)
    assert ends[2] == End("edge", "done", 50, 150)


def test_a_late_result_counts_against_its_model() -> None:
    """The first task ends late on the edge, at 150, and the one that waits leaves then."""
    tasks = [(0.0, _m(120)), (0.0, _m(900)), (0.0, _m(900))]
    ends = play(Gems(), tasks, edge_ms=[150, 100, 100])
    assert ends[0] == End("edge", "late", 0, 150)
    assert {end.place for end in ends[1:]} == {"cloud"}


@pytest.mark.parametrize("at", [999, 1000])
def test_windows_are_whole_multiples_of_their_length(at: int) -> None:
    """A drop at 990 counts until 999, whenever the model's first task came."""
    goal = QoeGoal(100, 0.9, NANOSECONDS)
    times = (900 * MILLISECOND, 100 * MILLISECOND, 300 * MILLISECOND)
    waiting = Profile("m", 100, *times, 1, 20, goal)
    hopeless = Profile("m", 100, HOPELESS * MILLISECOND, *times[1:], 1, 20, goal)
    gems = Gems()
    gems.start(Resources(), 0)
    early = Task(1, hopeless, 990 * MILLISECOND, 1030 * MILLISECOND)
    assert [type(one) for one in gems.task_arrived(early, early.arrival)] == [Drop]
    assert gems._in_danger(Task(2, waiting, 0, 2**62), at * MILLISECOND) == (at == 999)


def test_the_reason_of_a_drop_is_kept() -> None:
    """GEMS counts it, and passes it on."""
    gems = Gems()
    gems.start(Resources(), 0)
    task = Task(1, _m(900), 0, 900)
    assert gems.drop(task, 5, "too late") == Drop(task, "too late")


def test_a_drop_at_its_turn_on_the_edge_rescues() -> None:
    """The block takes 100, not 50: the next can't end by 160; of those behind, one runs at once."""
    tasks = [(0.0, BLOCK), (0.0, _m(160)), (0.0, _m(900)), (0.0, _m(901))]
    ends = play(Gems(), tasks, edge_ms=[100, 100, 100, 100])
    assert ends[1] == End("nowhere", "dropped", 100, 100)
    assert ends[2] == End("edge", "done", 100, 200)
    assert ends[3] == End("cloud", "done", 100, 400)


def test_a_drop_at_its_latest_start_rescues() -> None:
    """Not stolen until 690, one that would lose money in the cloud is dropped."""
    long = Profile("long", 100, 2000 * MILLISECOND, 800 * MILLISECOND, 300 * MILLISECOND, 1, 20)
    ends = play(Gems(), [(0, long), (1, _m(800, cost=110)), (2, _m(1500))])
    assert ends[1] == End("nowhere", "dropped", 691, 691)
    assert ends[2] == End("cloud", "done", 691, 991)


def test_as_published_the_cloud_s_times_are_not_learnt() -> None:
    """After twelve results of 350 instead of 300, a task still leaves for the cloud at 290."""
    endless = Profile("endless", 100, 2**60, 2**59, 300 * MILLISECOND, 1, 20)
    stream = [(0.0, endless), *((1000.0 * number, _m(600)) for number in range(14))]
    for published, wait in ((True, 290), (False, 240)):
        ends = play(Gems(published=published), stream, cloud_ms=[350] * len(stream))
        assert ends[-1].started - stream[-1][0] == wait


def test_as_published_what_gains_nothing_in_the_cloud_waits_to_be_stolen() -> None:
    """Only what loses is dropped at once; a cost of the benefit loses nothing."""
    long = Profile("long", 100, 2000 * MILLISECOND, 900 * MILLISECOND, 300 * MILLISECOND, 1, 20)
    tasks = [(0.0, long), (1.0, _m(900, cost=100)), (1.0, _m(900, cost=100.5))]
    ends = play(Gems(published=True), tasks)
    assert ends[1] == End("nowhere", "dropped", 791, 791)
    assert ends[2] == End("nowhere", "dropped", 1, 1)


def test_as_published_nothing_is_stolen_for_an_empty_queue() -> None:
    """The edge is free at 300, and a waiting task that would fit leaves for the cloud at 590."""
    long = Profile("long", 100, 2000 * MILLISECOND, 900 * MILLISECOND, 300 * MILLISECOND, 1, 20)
    tasks = [(0.0, long), (0.0, _m(900))]
    assert play(Gems(published=True), tasks, edge_ms=[300, 100])[1].started == 590
    assert play(Gems(), tasks, edge_ms=[300, 100])[1] == End("edge", "done", 300, 400)


@pytest.mark.parametrize("published", [False, True])
def test_the_reason_to_leave_for_the_cloud_is_kept(published: bool) -> None:  # noqa: FBT001
    """At its latest start the task is sent for the reason for which it had waited."""
    gems = Gems(published=published)
    gems.start(Resources(), 0)
    task = Task(1, _m(600), 0, 600 * MILLISECOND)
    assert list(gems.to_cloud(task, 0, "why")) == [WakeAt(290 * MILLISECOND)]
    assert list(gems.timer(290 * MILLISECOND)) == [SendToCloud(task, "why", 300 * MILLISECOND)]
