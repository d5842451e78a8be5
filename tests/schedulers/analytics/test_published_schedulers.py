"""Each published rule on an example worked by hand; times in milliseconds."""

from __future__ import annotations

import pytest

from aerodaas.clock import NANOSECONDS
from aerodaas.schedulers.analytics.base import (
    MILLISECOND,
    AnalyticsScheduler,
    Profile,
    QoeGoal,
    Resources,
)
from aerodaas.schedulers.analytics.published.cloud_only import CloudOnly
from aerodaas.schedulers.analytics.published.dedas import Dedas
from aerodaas.schedulers.analytics.published.dem import Dem
from aerodaas.schedulers.analytics.published.dems import Dems
from aerodaas.schedulers.analytics.published.dems_a import DemsA
from aerodaas.schedulers.analytics.published.edge_cloud import EdgeCloudEdf, EdgeCloudSjf
from aerodaas.schedulers.analytics.published.edge_only import Edf, Fifo, Hbf, Hpf, Huf, Sjf
from aerodaas.schedulers.analytics.published.gems import Gems
from aerodaas.schedulers.analytics.published.kalmia import Kalmia
from aerodaas.schedulers.lab.network import Network
from aerodaas.testing.scheduler_kit import End, play


def _model(
    name: str,
    *,
    benefit: float = 100,
    deadline: float = 1000,
    edge: float = 100,
    cloud: float = 300,
    costs: tuple[float, float] = (1, 20),
    qoe: QoeGoal | None = None,
    urgent: bool = True,
) -> Profile:
    return Profile(
        name,
        benefit,
        round(deadline * MILLISECOND),
        round(edge * MILLISECOND),
        round(cloud * MILLISECOND),
        *costs,
        qoe=qoe,
        urgent=urgent,
    )


BLOCK = _model("block", edge=50)
"""Keeps the edge busy until 50 so that those behind it are ordered."""


def _edge_order(ends: list[End]) -> list[int]:
    """Indices of the tasks that ran on the edge, in the order of their starts."""
    ran = [(end.started, index) for index, end in enumerate(ends) if end.place == "edge"]
    return [index for _, index in sorted(ran)]


A = _model("a", benefit=50, deadline=900, edge=300, costs=(1, 20))
B = _model("b", benefit=90, deadline=700, edge=200, costs=(60, 20))
C = _model("c", benefit=70, deadline=800, edge=100, costs=(5, 20))


@pytest.mark.parametrize(
    ("scheduler", "order"),
    [
        (Fifo(), [0, 1, 2, 3]),
        (Edf(), [0, 2, 3, 1]),
        (Sjf(), [0, 3, 2, 1]),
        (Hbf(), [0, 2, 3, 1]),
        (Huf(), [0, 3, 1, 2]),  # gains 49, 30, 65
        (Hpf(), [0, 3, 1, 2]),  # gains per ms 0.163, 0.150, 0.65
    ],
)
def test_edge_only_orders(scheduler: AnalyticsScheduler, order: list[int]) -> None:
    """The queue behind a running task is served in the scheduler's order."""
    assert _edge_order(play(scheduler, [(0, BLOCK), (1, A), (2, B), (3, C)])) == order


def test_edge_only_checks_each_start_just_in_time() -> None:
    """A task that would end after its deadline is dropped, and the next one runs."""
    tight = _model("tight", deadline=140)
    ends = play(Fifo(), [(0, BLOCK), (0, tight), (0, A)])
    assert ends[1] == End("nowhere", "dropped", 50, 50)
    assert ends[2] == End("edge", "done", 50, 350)


def test_edf_as_published_orders_by_the_relative_deadline() -> None:
    """A task that arrives later with a shorter relative deadline overtakes an earlier one."""
    early = _model("early", deadline=500)
    late = _model("late", deadline=480)
    tasks = [(0.0, BLOCK), (1.0, early), (40.0, late)]
    assert _edge_order(play(Edf(), tasks)) == [0, 1, 2]
    assert _edge_order(play(Edf(published=True), tasks)) == [0, 2, 1]


def test_cloud_only_sends_what_pays_and_fits() -> None:
    """Costs at or above the benefit, or a cloud slower than the deadline, mean a drop."""
    losing = _model("losing", costs=(1, 100))
    slow = _model("slow", deadline=250)
    ends = play(CloudOnly(), [(0, A), (0, losing), (0, slow)])
    assert [end.place for end in ends] == ["cloud", "nowhere", "nowhere"]
    assert ends[0] == End("cloud", "done", 0, 300)


def test_edge_cloud_fills_the_edge_before_the_cloud() -> None:
    """In order of deadlines x would end at 50 + 200 + 100 + 300, in order of lengths as well."""
    x = _model("x", deadline=830, edge=300)
    case = [(0.0, BLOCK), (0.0, C), (0.0, B), (0.0, x)]
    assert _edge_order(play(EdgeCloudEdf(), case)) == [0, 2, 1, 3]
    x = _model("x", deadline=640, edge=300)
    case[3] = (0.0, x)
    # EDF puts x first (350 < 640); B and C then end at 550 < 700 and 650 < 800.
    assert _edge_order(play(EdgeCloudEdf(), case)) == [0, 3, 2, 1]
    # SJF puts x last (650 > 640), so it goes to the cloud.
    ends = play(EdgeCloudSjf(), case)
    assert _edge_order(ends) == [0, 1, 2]
    assert ends[3] == End("cloud", "done", 0, 300)


def test_edge_cloud_looks_at_the_newcomer_only() -> None:
    """The newcomer makes the task behind it miss; that one is dropped at its start."""
    first = _model("first", deadline=400, edge=300)
    newcomer = _model("newcomer", deadline=200, edge=100)
    ends = play(EdgeCloudEdf(), [(0, BLOCK), (0, first), (1, newcomer)])
    assert ends[2] == End("edge", "done", 50, 150)
    assert ends[1].outcome == "dropped"


DEM_VICTIM = _model("victim", deadline=400, edge=300, costs=(1, 20), cloud=350)
"""Queued behind the block it ends at 350; a newcomer of 100 before it makes it miss."""


def test_dem_migrates_a_victim_that_loses_less() -> None:
    """The victim loses |99 - 80| = 19 by leaving, the newcomer (no cloud in time) 99."""
    newcomer = _model("newcomer", deadline=200, cloud=500)
    ends = play(Dem(), [(0, BLOCK), (0, DEM_VICTIM), (1, newcomer)])
    assert ends[1] == End("cloud", "done", 1, 351)
    assert ends[2] == End("edge", "done", 50, 150)


def test_dem_sends_the_newcomer_where_the_victim_loses_more() -> None:
    """The victim would lose 19, the newcomer only |99 - 89| = 10."""
    newcomer = _model("newcomer", deadline=250, cloud=200, costs=(1, 11))
    ends = play(Dem(), [(0, BLOCK), (0, DEM_VICTIM), (1, newcomer)])
    assert ends[1] == End("edge", "done", 50, 350)
    assert ends[2] == End("cloud", "done", 1, 201)


def test_dem_as_published_overlooks_the_first_task_behind_the_slot() -> None:
    """That task stays in the queue and is dropped when its turn comes."""
    newcomer = _model("newcomer", deadline=200, cloud=500)
    ends = play(Dem(published=True), [(0, BLOCK), (0, DEM_VICTIM), (1, newcomer)])
    assert ends[1].outcome == "dropped"


def test_dems_defers_to_the_latest_start() -> None:
    """No room on the edge: the task waits until deadline - cloud time - 10 ms."""
    blocker = _model("blocker", edge=900)
    waiting = _model("waiting", deadline=800, edge=400, cloud=300)
    ends = play(Dems(), [(0, blocker), (0, waiting)])
    assert ends[1] == End("cloud", "done", 490, 790)


def test_dems_steals_when_the_edge_is_idle() -> None:
    """The edge is free earlier than expected, so the waiting task is taken back."""
    blocker = _model("blocker", edge=900)
    waiting = _model("waiting", deadline=800, edge=400, cloud=300)
    ends = play(Dems(), [(0, blocker), (0, waiting)], edge_ms=[300, 400])
    assert ends[1] == End("edge", "done", 300, 700)


def test_dems_steals_what_loses_money_in_the_cloud_first() -> None:
    """Tasks that lose money in the cloud wait only to be stolen, and come first."""
    blocker = _model("blocker", edge=900)
    paying = _model("paying", deadline=800, edge=300, costs=(1, 90))
    losing = _model("losing", deadline=900, edge=300, costs=(1, 110))
    ends = play(Dems(), [(0, blocker), (0, paying), (0, losing)], edge_ms=[300, 300, 300])
    assert ends[2] == End("edge", "done", 300, 600)
    assert ends[1] == End("cloud", "done", 490, 790)
    unlucky = play(Dems(), [(0, blocker), (0, losing)])
    assert unlucky[1] == End("nowhere", "dropped", 590, 590)


def test_dems_does_not_steal_at_the_expense_of_the_queue() -> None:
    """Head must start by 400; a candidate of 200 at 250 would end at 450."""
    blocker = _model("blocker", edge=700, deadline=2000)
    head = _model("head", deadline=1000, edge=290)
    waiting = _model("waiting", deadline=990, edge=280, cloud=300)
    # Expected 700: head ends at 990 and is queued; waiting (ends 980, pushing head) has a loss of
    # |99 - 80| = 19 against head's 19, so it waits. The block ends at 500: room 1000 - 790 = 210.
    ends = play(Dems(), [(0, blocker), (0, head), (0, waiting)], edge_ms=[500, 290, 280])
    assert ends[1] == End("edge", "done", 500, 790)
    assert ends[2].place == "cloud"


def test_dems_as_published_wants_132_ms_before_it_steals() -> None:
    """At 600 the head (960 - 250) leaves room of 110, enough for a task of 80 once mended."""
    blocker = _model("blocker", edge=700, deadline=2000)
    head = _model("head", deadline=960, edge=250, cloud=999)
    small = _model("small", deadline=740, edge=80, cloud=100)
    case = [(0.0, blocker), (0.0, head), (0.0, small)]
    mended = play(Dems(), case, edge_ms=[600, 250, 80])
    assert mended[2] == End("edge", "done", 600, 680)
    assert mended[1] == End("edge", "done", 680, 930)
    published = play(Dems(published=True), case, edge_ms=[600, 250, 80])
    assert published[2] == End("cloud", "done", 630, 730)


CLOUDY = _model("cloudy", deadline=600, edge=590, cloud=300)
"""Fits on an idle edge only; the rest goes to the cloud."""


def _stream(count: int, every: float = 100) -> list[tuple[float, Profile]]:
    blocker = _model("blocker", edge=1e6, deadline=2e6)
    return [(0.0, blocker), *((every * number, CLOUDY) for number in range(count))]


def test_dems_a_follows_the_mean_of_ten_cloud_times() -> None:
    """After ten results of 350, tasks leave at deadline - 350 - 10 instead of - 300 - 10."""
    tasks = _stream(25)
    ends = play(DemsA(), tasks, cloud_ms=[350] * len(tasks))
    waits = [end.started - at for end, (at, _) in zip(ends[1:], tasks[1:], strict=True)]
    assert waits[0] == 290
    assert ends[1].outcome == "late"
    assert waits[-1] == 240
    assert ends[-1].outcome == "done"


def test_dems_a_cools_down_and_probes() -> None:
    """Results of 700 > 600: the model stays away for 10 s, then sends one probe, which is late."""
    tasks = _stream(240)
    ends = play(DemsA(), tasks, cloud_ms=[700] * len(tasks))
    sent = [end.started for end in ends[1:] if end.place == "cloud"]
    first_drop = min(end.started for end in ends[1:] if end.outcome == "dropped")
    probes = [at for at in sent if at > first_drop + 1000]
    assert len(probes) == 2 - (probes[-1] < 20_000)
    assert probes[0] - first_drop >= 10_000
    recovered = play(DemsA(), tasks, cloud_ms=[700] * 100 + [300] * 141)
    assert [end.outcome for end in recovered[-20:-5]] == ["done"] * 15


def test_gems_rescues_the_queue_of_a_model_in_danger() -> None:
    """After the drop of one of the model's tasks, its queued one leaves for the cloud at once."""
    goal = QoeGoal(100, 0.9, 20 * NANOSECONDS)
    hopeless = _model("m", deadline=40, edge=100, cloud=300, qoe=goal)
    queued = _model("m", deadline=900, edge=100, cloud=300, qoe=goal)
    ends = play(Gems(), [(0, BLOCK), (0, queued), (10, hopeless)])
    assert ends[1] == End("cloud", "done", 10, 310)
    assert play(DemsA(), [(0, BLOCK), (0, queued), (10, hopeless)])[1].place == "edge"


def test_gems_starts_afresh_with_each_window() -> None:
    """A drop in the window before does not matter any more."""
    goal = QoeGoal(100, 0.9, NANOSECONDS)
    hopeless = _model("m", deadline=40, edge=100, cloud=300, qoe=goal)
    queued = _model("m", deadline=900, edge=100, cloud=300, qoe=goal)
    ends = play(Gems(), [(10, BLOCK), (10, hopeless), (1000, BLOCK), (1001, queued)])
    assert ends[3].place == "edge"


def test_gems_as_published_drops_newcomers_that_lose_money_in_the_cloud() -> None:
    """Mended, they wait to be stolen."""
    losing = _model("losing", deadline=900, edge=300, costs=(1, 110))
    case = [(0.0, _model("blocker", edge=900)), (0.0, losing)]
    assert play(Gems(published=True), case)[1] == End("nowhere", "dropped", 0, 0)
    assert play(Gems(), case, edge_ms=[300, 300])[1] == End("edge", "done", 300, 600)


def test_kalmia_ignores_cost_and_extends_what_is_not_urgent() -> None:
    """950 + 100 > 1000: the cloud whatever it costs; a deadline of 310 * 1.1 lets 330 pass."""
    blocker = _model("blocker", edge=950)
    losing = _model("losing", costs=(1, 500))
    patient = _model("patient", deadline=310, cloud=330, urgent=False)
    urgent = _model("urgent", deadline=310, cloud=330)
    ends = play(Kalmia(), [(0, blocker), (0, losing), (0, patient), (0, urgent)])
    assert ends[1] == End("cloud", "done", 0, 300)
    assert ends[2] == End("cloud", "late", 0, 330)
    assert ends[3] == End("nowhere", "dropped", 0, 0)


def test_dedas_swaps_only_to_gain_time() -> None:
    """The victim of 300 leaves for a newcomer of 100; with two victims the newcomer goes."""
    short = _model("short", deadline=390, edge=100)
    long = _model("long", deadline=400, edge=300)
    ends = play(Dedas(), [(0, BLOCK), (0, long), (1, short)])
    assert ends[1] == End("cloud", "done", 1, 301)
    assert ends[2] == End("edge", "done", 50, 150)
    two = [
        (0.0, BLOCK),
        (0.0, _model("p", deadline=210, edge=150)),
        (0.0, _model("q", deadline=380, edge=170)),
    ]
    ends = play(Dedas(), [*two, (1, short)])
    assert [end.place for end in ends] == ["edge", "edge", "edge", "cloud"]


def test_without_a_cloud_nothing_is_sent() -> None:
    """Schedulers that use the cloud fall back to what the edge can do."""
    for scheduler in (
        CloudOnly(),
        EdgeCloudEdf(),
        Dem(),
        Dems(),
        DemsA(),
        Gems(),
        Kalmia(),
        Dedas(),
    ):
        ends = play(scheduler, [(0, A), (0, B), (0, C)] * 2, resources=Resources(cloud_slots=0))
        assert "cloud" not in {end.place for end in ends}


def test_an_outage_loses_what_is_under_way() -> None:
    """The time-out frees the slot; the task counts as lost."""
    network = Network(outages=((100 * MILLISECOND, 200 * MILLISECOND),))
    resources = Resources(cloud_timeout=700 * MILLISECOND)
    ends = play(CloudOnly(), [(0, A), (150, A), (250, A)], network=network, resources=resources)
    assert [end.outcome for end in ends] == ["timeout", "timeout", "done"]
    assert ends[0].finished == 700
