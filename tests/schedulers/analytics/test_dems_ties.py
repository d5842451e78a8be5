"""DEM and DEMS where two times or two losses are exactly equal; times in milliseconds."""

from __future__ import annotations

import pytest

from aerodaas.schedulers.analytics.base import MILLISECOND, Profile, Resources
from aerodaas.schedulers.analytics.published.dem import Dem
from aerodaas.schedulers.analytics.published.dems import Dems
from aerodaas.testing.scheduler_kit import End, play


def _model(
    name: str, *, deadline: float, edge: float, cloud: float = 300, cloud_cost: float = 20
) -> Profile:
    due, here, there = (round(ms * MILLISECOND) for ms in (deadline, edge, cloud))
    return Profile(name, 100, due, here, there, 1, cloud_cost)


def _blocker(edge: float) -> Profile:
    return _model("blocker", deadline=5000, edge=edge)


@pytest.mark.parametrize("reverse", [False, True])
def test_the_largest_advantage_is_stolen_first(reverse: bool) -> None:  # noqa: FBT001
    """59 over the cloud comes before 19, in whichever order the two arrived."""
    pair = [
        _model("small", deadline=900, edge=300, cloud_cost=20),
        _model("large", deadline=900, edge=300, cloud_cost=60),
    ]
    large = 1 if reverse else 2
    tasks = [(0.0, _blocker(900)), *((0.0, p) for p in (reversed(pair) if reverse else pair))]
    ends = play(Dems(), tasks, edge_ms=[300, 300, 300])
    assert ends[large] == End("edge", "done", 300, 600)
    assert ends[3 - large] == End("cloud", "done", 590, 890)


def test_the_advantage_is_by_edge_time() -> None:
    """19 in 50 ms is worth more than 59 in 300 ms."""
    slow = _model("slow", deadline=900, edge=300, cloud_cost=60)
    quick = _model("quick", deadline=900, edge=50, cloud_cost=20)
    tasks = [(0.0, _blocker(900)), (0.0, slow), (0.0, quick)]
    ends = play(Dems(), tasks, edge_ms=[300, 300, 50])
    assert ends[2] == End("edge", "done", 300, 350)
    assert ends[1] == End("edge", "done", 350, 650)


def test_a_finish_at_the_deadline_is_no_room() -> None:
    """DEM wants to be done before the deadline: at 150 of 150 the task leaves, at 151 it stays."""
    at_once = play(Dem(), [(0, _blocker(50)), (0, _model("m", deadline=150, edge=100, cloud=60))])
    assert at_once[1] == End("cloud", "done", 0, 60)
    stays = play(Dem(), [(0, _blocker(50)), (0, _model("m", deadline=151, edge=100, cloud=60))])
    assert stays[1] == End("edge", "done", 50, 150)


HEAD = _model("head", deadline=1000, edge=290)
WAITING = _model("waiting", deadline=1090, edge=100)
"""Behind blocker and head it would end at 1090, its deadline: it waits, until 780."""


def test_a_head_without_spare_time_is_not_overtaken() -> None:
    """At 710 the head must start now to end at 1000."""
    tasks = [(0.0, _blocker(700)), (0.0, HEAD), (0.0, WAITING)]
    ends = play(Dems(), tasks, edge_ms=[710, 290, 100])
    assert ends[1] == End("edge", "done", 710, 1000)
    assert ends[2] == End("cloud", "done", 780, 1080)


def test_a_task_as_long_as_the_room_is_stolen() -> None:
    """At 610 the head can wait for 100, which is what the other takes; at 611 it cannot."""
    tasks = [(0.0, _blocker(700)), (0.0, HEAD), (0.0, WAITING)]
    ends = play(Dems(), tasks, edge_ms=[610, 290, 100])
    assert ends[2] == End("edge", "done", 610, 710)
    assert ends[1] == End("edge", "done", 710, 1000)
    assert play(Dems(), tasks, edge_ms=[611, 290, 100])[1] == End("edge", "done", 611, 901)


def test_what_ends_at_its_own_deadline_is_stolen() -> None:
    """At 500 a task of 300 due at 800 fits; at 501 it does not."""
    tasks = [(0.0, _blocker(900)), (0.0, _model("m", deadline=800, edge=300, cloud=100))]
    assert play(Dems(), tasks, edge_ms=[500, 300])[1] == End("edge", "done", 500, 800)
    assert play(Dems(), tasks, edge_ms=[501, 300])[1] == End("cloud", "done", 690, 790)


def test_equal_losses_leave_the_queue_alone() -> None:
    """Newcomer and victim would lose 19 each: the newcomer goes; with 20 to lose it stays."""
    victim = _model("victim", deadline=400, edge=300, cloud=350)
    equal = _model("newcomer", deadline=200, edge=100, cloud=100)
    ends = play(Dem(), [(0, _blocker(50)), (0, victim), (1, equal)])
    assert ends[2] == End("cloud", "done", 1, 101)
    assert ends[1] == End("edge", "done", 50, 350)
    more = _model("newcomer", deadline=200, edge=100, cloud=100, cloud_cost=21)
    ends = play(Dem(), [(0, _blocker(50)), (0, victim), (1, more)])
    assert ends[2] == End("edge", "done", 50, 150)
    assert ends[1] == End("cloud", "done", 1, 351)


@pytest.mark.parametrize("deadline", [300, 310])
def test_the_cloud_is_left_for_at_the_last_moment(deadline: float) -> None:
    """A cloud of 300 fits in 300, and a latest start (310 - 300 - 10) of now is now."""
    tasks = [(0.0, _blocker(900)), (0.0, _model("m", deadline=deadline, edge=400))]
    assert play(Dems(), tasks)[1] == End("cloud", "done", 0, 300)
    late = [(0.0, _blocker(900)), (0.0, _model("m", deadline=299, edge=400))]
    assert play(Dems(), late)[1].outcome == "dropped"


def test_what_must_leave_now_does_not_wait_to_be_stolen() -> None:
    """Its latest start (300 - 290 - 10) is now: it leaves, though an idle edge could just do it.

    With a millisecond to wait it does wait, and the idle edge takes it.
    """
    now = _model("m", deadline=300, edge=300, cloud=290)
    assert play(Dems(), [(0.0, now)])[0] == End("cloud", "done", 0, 290)
    later = _model("m", deadline=300, edge=300, cloud=289)
    assert play(Dems(), [(0.0, later)])[0] == End("edge", "done", 0, 300)


def test_without_a_cloud_a_task_waits_for_the_edge_alone() -> None:
    """Until 900 - 300 - 10, however slow the cloud would have been."""
    tasks = [(0.0, _blocker(900)), (0.0, _model("m", deadline=900, edge=300, cloud=890))]
    nowhere = Resources(cloud_slots=0)
    taken = play(Dems(), tasks, edge_ms=[300, 300], resources=nowhere)
    assert taken[1] == End("edge", "done", 300, 600)
    never = play(Dems(), tasks, resources=nowhere)
    assert never[1] == End("nowhere", "dropped", 590, 590)


@pytest.mark.parametrize("reverse", [False, True])
@pytest.mark.parametrize(
    ("edge", "cost", "other_cost"),
    [
        pytest.param(250, 110, 20, id="what loses money in the cloud before what pays there"),
        pytest.param(200, 99, 100, id="0.49 a millisecond before 0.396, which breaks even"),
    ],
)
def test_stealing_before_a_queue_as_published(
    edge: float,
    cost: float,
    other_cost: float,
    reverse: bool,  # noqa: FBT001
) -> None:
    """With 400 of room before the head, the better of two is stolen, whichever arrived first."""
    better = _model("better", deadline=800 + edge, edge=edge, cloud_cost=cost)
    other = _model("other", deadline=1050, edge=250, cloud_cost=other_cost)
    pair = [other, better] if reverse else [better, other]
    tasks = [(0.0, _blocker(700)), (0.0, _model("head", deadline=1000, edge=100))]
    tasks += [(0.0, profile) for profile in pair]
    times = [500, 100, *(profile.edge_time / MILLISECOND for profile in pair)]
    ends = play(Dems(published=True), tasks, edge_ms=times)
    assert ends[2 + pair.index(better)] == End("edge", "done", 500, 500 + edge)
    assert ends[1] == End("edge", "done", 500 + edge, 600 + edge)
    assert ends[2 + pair.index(other)].place != "edge"
