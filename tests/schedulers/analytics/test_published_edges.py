"""The published schedulers where two times are equal, a gain is nothing, and in their words."""

from __future__ import annotations

import pytest

from aerodaas.clock import NANOSECONDS
from aerodaas.schedulers.analytics.base import (
    MIGRATED,
    MILLISECOND,
    STOLEN,
    Drop,
    Profile,
    Resources,
    Result,
    RunOnEdge,
    SendToCloud,
    Task,
    TaskOutcome,
    TaskPlace,
    WakeAt,
)
from aerodaas.schedulers.analytics.published.cloud_only import CloudOnly
from aerodaas.schedulers.analytics.published.dedas import Dedas
from aerodaas.schedulers.analytics.published.dem import Dem
from aerodaas.schedulers.analytics.published.dems import Dems
from aerodaas.schedulers.analytics.published.dems_a import DemsA
from aerodaas.schedulers.analytics.published.edge_cloud import EdgeCloudEdf
from aerodaas.schedulers.analytics.published.kalmia import Kalmia
from aerodaas.testing.scheduler_kit import End, play


def model(
    name: str,
    *,
    deadline: float = 1000,
    edge: float = 100,
    cloud: float = 300,
    costs: tuple[float, float] = (1, 20),
    urgent: bool = True,
) -> Profile:
    """A profile in milliseconds, of benefit 100."""
    due, here, there = (round(ms * MILLISECOND) for ms in (deadline, edge, cloud))
    return Profile(name, 100, due, here, there, *costs, urgent=urgent)


def task(profile: Profile, at: float = 0.0, number: int = 0) -> Task:
    """A task that arrives at `at` milliseconds."""
    arrival = round(at * MILLISECOND)
    return Task(number, profile, arrival, arrival + profile.deadline)


BLOCK = model("block", edge=50)


def test_cloud_only_sends_until_the_last_moment_and_says_why_not_later() -> None:
    """A task due at 1000 that takes 300 may start by 700."""
    one = task(model("m"))
    late = 700 * MILLISECOND
    assert CloudOnly().task_arrived(one, late) == [SendToCloud(one, "cloud only", late)]
    assert CloudOnly().task_arrived(one, late + 1) == [Drop(one, "no time left for the cloud")]


@pytest.mark.parametrize(("cost", "sent"), [(100, False), (99.5, True)])
def test_any_gain_at_all_is_worth_the_cloud(cost: float, sent: bool) -> None:  # noqa: FBT001
    """Half a unit is a gain; a cost of the benefit is none, and the reason says so."""
    one = task(model("m", costs=(1, cost)))
    (decision,) = CloudOnly().task_arrived(one, 0)
    dropped = Drop(one, "the cloud costs more than the result is worth")
    assert decision == (SendToCloud(one, "cloud only", 700 * MILLISECOND) if sent else dropped)
    ends = play(EdgeCloudEdf(), [(0, model("long", edge=950)), (0, one.profile)])
    assert ends[1].place == ("cloud" if sent else "nowhere")


def test_without_a_cloud_cloud_only_drops() -> None:
    """There is no slot that it could wait for."""
    scheduler = CloudOnly()
    scheduler.start(Resources(cloud_slots=0), 0)
    assert [type(one) for one in scheduler.task_arrived(task(model("m")), 0)] == [Drop]


@pytest.mark.parametrize(("deadline", "place"), [(150, "cloud"), (151, "edge")])
def test_edge_and_cloud_want_to_be_done_before_the_deadline(deadline: float, place: str) -> None:
    """Behind the block a task of 100 is done at 150."""
    one = model("m", deadline=deadline, cloud=60)
    assert play(EdgeCloudEdf(), [(0, BLOCK), (0, one)])[1].place == place
    assert play(Kalmia(), [(0, BLOCK), (0, one)])[1].place == place


def test_edge_and_cloud_as_published_order_by_the_relative_deadline() -> None:
    """One that came later with a shorter relative deadline overtakes."""
    tasks = [(0.0, BLOCK), (1.0, model("early", deadline=500)), (40.0, model("late", deadline=480))]
    for published, first in ((False, 1), (True, 2)):
        ends = play(EdgeCloudEdf(published=published), tasks)
        assert ends[first].started == 50
        assert ends[3 - first].started == 150


@pytest.mark.parametrize(("deadline", "place"), [(300, "nowhere"), (301, "cloud")])
def test_kalmia_wants_the_cloud_to_be_done_before_the_deadline(deadline: float, place: str) -> None:
    """A task that takes 300 there and finds the edge busy."""
    ends = play(Kalmia(), [(0, model("long", edge=950)), (0, model("m", deadline=deadline))])
    assert ends[1].place == place


def test_dedas_drops_what_neither_place_can_finish() -> None:
    """The edge is busy until 900, and the cloud takes 300 of 250; of 300 it just does."""
    long = model("long", edge=900)
    ends = play(Dedas(), [(0, long), (0, model("m", deadline=250)), (0, model("n", deadline=300))])
    assert ends[1] == End("nowhere", "dropped", 0, 0)
    assert ends[2] == End("cloud", "done", 0, 300)


def test_dedas_at_equality_is_late_with_a_newcomer_and_in_time_with_a_victim() -> None:
    """Behind the block, 100 is done at 150: too late for a newcomer due then. 300 more is 450."""
    long = model("long", deadline=450, edge=300)
    assert play(Dedas(), [(0, BLOCK), (1, model("n", deadline=149, cloud=60))])[1].place == "cloud"
    ends = play(Dedas(), [(0, BLOCK), (0, long), (1, model("n", deadline=150))])
    assert [end.place for end in ends] == ["edge", "edge", "edge"]


@pytest.mark.parametrize(("deadline", "place"), [(300, "cloud"), (299, "nowhere")])
def test_the_cloud_may_end_at_the_deadline(deadline: float, place: str) -> None:
    """A task of 300 there, that came at 0 and finds the edge busy."""
    ends = play(EdgeCloudEdf(), [(0, model("long", edge=950)), (0, model("m", deadline=deadline))])
    assert ends[1].place == place


def test_dedas_says_of_its_victim_that_it_was_migrated() -> None:
    """The lab counts those."""
    dedas = Dedas()
    dedas.start(Resources(), 0)
    dedas.free_at = 50 * MILLISECOND
    victim = task(model("long", deadline=400, edge=300), number=1)
    assert list(dedas.task_arrived(victim, 0)) == []
    newcomer = task(model("short", deadline=390), number=2)
    (sent,) = dedas.task_arrived(newcomer, 0)
    assert sent == SendToCloud(victim, MIGRATED, 100 * MILLISECOND)


@pytest.mark.parametrize(("deadline", "migrated"), [(450, False), (449, True)])
def test_dem_leaves_alone_what_still_ends_at_its_deadline(
    deadline: float,
    migrated: bool,  # noqa: FBT001
) -> None:
    """Block 50, newcomer 100, then 300: done at 450."""
    waiting = model("waiting", deadline=deadline, edge=300, cloud=350)
    newcomer = model("newcomer", deadline=200, cloud=500)
    ends = play(Dem(), [(0, BLOCK), (0, waiting), (1, newcomer)])
    assert (ends[1].place == "cloud") == migrated
    assert ends[2] == End("edge", "done", 50, 150)


@pytest.mark.parametrize(("cloud", "stays"), [(399, True), (398, False)])
def test_dem_counts_on_the_cloud_only_before_the_deadline(
    cloud: float,
    stays: bool,  # noqa: FBT001
) -> None:
    """At 1, a victim due at 400 that takes 399 there would lose all of 99, and stays."""
    victim = model("victim", deadline=400, edge=300, cloud=cloud)
    newcomer = model("newcomer", deadline=250, cloud=200, costs=(1, 80))
    ends = play(Dem(), [(0, BLOCK), (0, victim), (1, newcomer)])
    assert (ends[1].place == "edge") == stays
    assert (ends[2].place == "cloud") == stays


def test_dems_steals_what_gains_nothing_in_the_cloud_before_what_gains_a_little() -> None:
    """Whatever they gain per millisecond on the edge: the other has somewhere to go."""
    nothing = model("nothing", deadline=900, edge=300, costs=(60, 100))
    little = model("little", deadline=900, edge=50, costs=(1, 99))
    tasks = [(0.0, model("long", edge=900)), (0.0, little), (0.0, nothing)]
    ends = play(Dems(), tasks, edge_ms=[300, 50, 300])
    assert ends[2] == End("edge", "done", 300, 600)
    assert ends[1] == End("cloud", "done", 590, 890)


def test_dems_says_what_it_stole() -> None:
    """The lab counts those."""
    dems = Dems()
    dems.start(Resources(), 0)
    dems.free_at = 900 * MILLISECOND
    waiting = task(model("m", deadline=800, edge=400))
    assert list(dems.task_arrived(waiting, 0)) == [WakeAt(490 * MILLISECOND)]
    assert list(dems.executor_idle(300 * MILLISECOND)) == [RunOnEdge(waiting, STOLEN)]


CLOUDY = model("cloudy", deadline=600, edge=590)
"""Of 300 in the cloud."""


class Adapting:
    """DEMS-A on a busy edge, with results of the cloud by hand; milliseconds."""

    def __init__(self) -> None:
        self.scheduler = DemsA()
        self.scheduler.start(Resources(), 0)
        self.scheduler.free_at = 2**62
        self.count = 0

    def result(
        self,
        taken: float,
        outcome: TaskOutcome = TaskOutcome.DONE,
        place: TaskPlace = TaskPlace.CLOUD,
    ) -> None:
        """A task of 600 ended at 0, after `taken`."""
        self.count += 1
        one = task(CLOUDY, number=self.count)
        ended = Result(one, outcome, place, 0, round(taken * MILLISECOND))
        self.scheduler.task_finished(ended, 0)

    @property
    def waits(self) -> float:
        """For how long the next task of 600 waits: until 600 - the estimate - 10."""
        self.count += 1
        (decision,) = self.scheduler.task_arrived(task(CLOUDY, number=self.count), 0)
        assert isinstance(decision, WakeAt)
        return decision.at / MILLISECOND

    def arrives(self, at: float, deadline: float) -> tuple[Task, list[object]]:
        """A task with this deadline arrives, and what is decided at once."""
        self.count += 1
        profile = model("cloudy", deadline=deadline, edge=590)
        one = task(profile, at, self.count)
        return one, list(self.scheduler.task_arrived(one, one.arrival))


def test_dems_a_adapts_at_ten_results_and_not_before() -> None:
    """Nine of 350 change nothing."""
    one = Adapting()
    for _ in range(9):
        one.result(350)
    assert one.waits == 290
    one.result(350)
    assert one.waits == 240


@pytest.mark.parametrize(
    ("taken", "waits"), [(310, 290), (310.1, 279.9), (290, 290), (289, 301), (305, 290)]
)
def test_dems_a_ignores_a_difference_of_10_ms(taken: float, waits: float) -> None:
    """Either way; beyond, the mean takes the estimate's place."""
    one = Adapting()
    for _ in range(10):
        one.result(taken)
    assert one.waits == pytest.approx(waits, abs=1e-6)


def test_dems_a_keeps_whole_nanoseconds() -> None:
    """A mean between two of them is rounded down."""
    one = Adapting()
    for number in range(10):
        one.result(350 + (number == 0) * 5e-6)
    assert one.waits == 240


def test_dems_a_learns_from_answers_of_the_cloud_alone() -> None:
    """A task that never came back has no time, and the edge's times are the edge's."""
    one = Adapting()
    for _ in range(10):
        one.result(10_000, TaskOutcome.TIMEOUT)
        one.result(590, place=TaskPlace.EDGE)
    assert one.waits == 290
    for _ in range(5):
        one.result(350)
        one.result(350, TaskOutcome.LATE)
    assert one.waits == 240


def test_dems_a_probes_after_ten_seconds_and_again_after_a_late_probe() -> None:
    """Of tasks that fit by the profile alone: the first cools, one at 10 s probes, one follows."""
    one = Adapting()
    for _ in range(10):
        one.result(350)
    first, decided = one.arrives(0, 300)
    assert decided == [Drop(first, "no time left for the cloud")]
    _, decided = one.arrives(9_999.9, 340)
    assert [type(each) for each in decided] == [Drop]
    probe, decided = one.arrives(10_000, 340)
    assert decided == [WakeAt(10_030 * MILLISECOND)]
    _, decided = one.arrives(10_000, 340)
    assert [type(each) for each in decided] == [Drop], "one probe at a time"
    (sent,) = one.scheduler.timer(10_030 * MILLISECOND)
    assert sent == SendToCloud(probe, "probe of the cloud", 10_040 * MILLISECOND)
    late = Result(probe, TaskOutcome.LATE, TaskPlace.CLOUD, probe.arrival, 11 * NANOSECONDS)
    one.scheduler.task_finished(late, 11 * NANOSECONDS)
    _, decided = one.arrives(20_999, 340)
    assert [type(each) for each in decided] == [Drop]
    _, decided = one.arrives(21_000, 340)
    assert decided == [WakeAt(21_030 * MILLISECOND)]


def test_what_gains_nothing_in_the_cloud_is_no_probe_and_starts_no_cooling() -> None:
    """It waits to be stolen, as ever."""
    one = Adapting()
    for _ in range(10):
        one.result(350)
    free = Profile("cloudy", 20, 340 * MILLISECOND, 100 * MILLISECOND, 300 * MILLISECOND, 1, 20)
    waiting = Task(99, free, 0, free.deadline)
    assert list(one.scheduler.task_arrived(waiting, 0)) == [WakeAt(230 * MILLISECOND)]
    _, decided = one.arrives(10_000, 340)
    assert [type(each) for each in decided] == [Drop], "cooling begins only now"
