"""The rules between schedulers and executors, which the lab and the dispatcher share."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

import pytest

from aerodaas.errors import SchedulerError
from aerodaas.schedulers.analytics.base import (
    MILLISECOND,
    AnalyticsScheduler,
    Decision,
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
from aerodaas.schedulers.analytics.dispatch import EXECUTOR_DOWN, Dispatch
from aerodaas.schedulers.analytics.registry import load_scheduler, scheduler_names

MODEL = Profile("m", 10, 100 * MILLISECOND, 10 * MILLISECOND, 20 * MILLISECOND, 1, 2)


class _RecordingHost:
    """Starts nothing; remembers what it was asked for."""

    def __init__(self) -> None:
        self.asked: list[tuple[str, int, int]] = []
        self.results: list[Result] = []
        self.decisions: list[Decision] = []
        self.decided_at: list[int] = []

    def run_edge(self, task: Task, now: int) -> None:
        self.asked.append(("edge", task.id, now))

    def run_cloud(self, task: Task, now: int) -> None:
        self.asked.append(("cloud", task.id, now))

    def wake_at(self, at: int) -> None:
        self.asked.append(("wake", -1, at))

    def decided(self, decision: Decision, now: int) -> None:
        self.decisions.append(decision)
        self.decided_at.append(now)

    def closed(self, result: Result) -> None:
        self.results.append(result)


class _Scripted(AnalyticsScheduler):
    """Answers each arrival with what the test says; runs waiting tasks when idle on demand."""

    def __init__(self, *answers: object, idle: bool = False) -> None:
        self.answers = list(answers)
        self.idle = idle
        self.waiting: list[Task] = []
        self.heard: list[Result] = []

    def task_arrived(self, task: Task, now: int) -> Iterable[Decision]:
        self.waiting.append(task)
        answer = self.answers.pop(0) if self.answers else None
        if answer is None:
            return ()
        return [answer(task, now)]  # type: ignore[operator]

    def executor_idle(self, now: int) -> Iterable[Decision]:  # noqa: ARG002
        return [RunOnEdge(self.waiting.pop(0))] if self.idle and self.waiting else ()

    def task_finished(self, result: Result, now: int) -> Iterable[Decision]:  # noqa: ARG002
        self.heard.append(result)
        return ()


def _task(number: int, at: int = 0) -> Task:
    return Task(number, MODEL, at, at + MODEL.deadline)


def _dispatch_of(scheduler: AnalyticsScheduler, slots: int = 1) -> tuple[Dispatch, _RecordingHost]:
    host = _RecordingHost()
    dispatch = Dispatch(scheduler, Resources(cloud_slots=slots), host)
    dispatch.start(0)
    return dispatch, host


def test_an_idle_executor_is_offered_after_every_event() -> None:
    """The second task starts when the first is back, without a decision in between."""
    dispatch, host = _dispatch_of(_Scripted(idle=True))
    dispatch.arrived(_task(0), 0)
    dispatch.arrived(_task(1), 1)
    assert host.asked == [("edge", 0, 0)]
    running = dispatch.running
    assert running is not None
    dispatch.finished(running, 30)
    assert host.asked == [("edge", 0, 0), ("edge", 1, 30)]
    assert host.results[0].place is TaskPlace.EDGE
    assert host.results[0].outcome is TaskOutcome.DONE


def test_the_cloud_queue_keeps_order_and_gives_up_at_the_latest_start() -> None:
    """With one slot, the second task waits and starts; the third one's time has passed."""
    send = lambda t, _: SendToCloud(t, "", 50 + 10 * (1 - t.id))  # noqa: E731
    scheduler = _Scripted(send, send, send)
    dispatch, host = _dispatch_of(scheduler)
    tasks = [_task(number) for number in range(3)]
    for one in tasks:
        dispatch.arrived(one, 0)
    dispatch.finished(tasks[0], 45)
    dispatch.finished(tasks[1], 60)
    assert host.asked == [("cloud", 0, 0), ("cloud", 1, 45)]
    ends = {r.task.id: r.outcome for r in host.results}
    assert ends == {0: TaskOutcome.DONE, 1: TaskOutcome.DONE, 2: TaskOutcome.DROPPED}
    assert [r.task.id for r in scheduler.heard] == [0, 2, 1]


def test_a_crowd_that_gives_up_at_once_ends_one_by_one() -> None:
    """A thousand tasks wait for one slot until it is too late for all of them."""
    crowd = 1000
    scheduler = _Scripted(*([lambda t, _: SendToCloud(t, "", 10)] * crowd))
    dispatch, host = _dispatch_of(scheduler)
    tasks = [_task(number) for number in range(crowd)]
    for one in tasks:
        dispatch.arrived(one, 0)
    dispatch.finished(tasks[0], 50)
    assert [r.task.id for r in host.results] == list(range(crowd))
    assert Counter(r.outcome for r in host.results)[TaskOutcome.DROPPED] == crowd - 1
    assert sorted(r.task.id for r in scheduler.heard) == list(range(crowd))


def test_what_never_ran_costs_nothing() -> None:
    """Whatever its end is called."""
    one = Result(_task(0), TaskOutcome.FAILED, TaskPlace.NOWHERE, 5, 5)
    assert one.utility == 0


def test_results_after_the_deadline_are_late_and_cost_their_price() -> None:
    """A late result earns nothing; its cost stays."""
    dispatch, host = _dispatch_of(_Scripted(lambda t, _: SendToCloud(t)))
    one = _task(0)
    dispatch.arrived(one, 0)
    dispatch.finished(one, one.deadline + 1)
    assert host.results[0].outcome is TaskOutcome.LATE
    assert host.results[0].utility == -2


def test_lost_executions_are_reported_as_such() -> None:
    """The host's verdict stands, whatever the time."""
    dispatch, host = _dispatch_of(_Scripted(lambda t, _: SendToCloud(t)))
    one = _task(0)
    dispatch.arrived(one, 0)
    dispatch.finished(one, 5, TaskOutcome.FAILED)
    assert host.results[0].outcome is TaskOutcome.FAILED
    assert dispatch.in_cloud == 0


@pytest.mark.parametrize(
    ("answer", "slots", "words"),
    [
        (lambda _, now: WakeAt(now - 1), 1, "past"),
        (lambda _, __: WakeAt(float("nan")), 1, "past"),  # type: ignore[arg-type]
        (lambda t, _: Drop(t, ["why"]), 1, "no text"),  # type: ignore[arg-type]
        (lambda _, __: RunOnEdge(_task(99)), 1, "never arrived"),
        (lambda t, _: SendToCloud(t), 0, "no cloud"),
        (lambda _, __: "edge", 1, "none of the decisions"),
    ],
)
def test_impossible_decisions_are_refused(answer: object, slots: int, words: str) -> None:
    """The message names the scheduler and what is wrong."""
    dispatch, _ = _dispatch_of(_Scripted(answer), slots)
    with pytest.raises(SchedulerError, match=f"_Scripted decided .*{words}"):
        dispatch.arrived(_task(0, 10), 10)


def test_a_task_is_decided_once() -> None:
    """Dropping a task that is already in the cloud is refused."""
    kept: list[Task] = []

    def twice(one: Task, _: int) -> Decision:
        kept.append(one)
        return SendToCloud(one) if len(kept) == 1 else Drop(kept[0])

    dispatch, _ = _dispatch_of(_Scripted(twice, twice))
    dispatch.arrived(_task(0), 0)
    with pytest.raises(SchedulerError, match="decided before"):
        dispatch.arrived(_task(1), 0)


def test_a_busy_executor_is_not_given_a_second_task() -> None:
    """Whatever the scheduler wishes."""
    dispatch, _ = _dispatch_of(_Scripted(lambda t, _: RunOnEdge(t), lambda t, _: RunOnEdge(t)))
    dispatch.arrived(_task(0), 0)
    with pytest.raises(SchedulerError, match="busy with task 0"):
        dispatch.arrived(_task(1), 1)


def test_another_scheduler_takes_over_what_is_undecided() -> None:
    """Nothing is lost when a scheduler is replaced, and what runs goes on."""
    dispatch, host = _dispatch_of(_Scripted(idle=True))
    for number in range(3):
        dispatch.arrived(_task(number), 0)
    dispatch.replace(_Scripted(lambda t, _: SendToCloud(t), lambda t, _: Drop(t)), 5)
    assert host.asked == [("edge", 0, 0), ("cloud", 1, 5)]
    assert not dispatch.undecided
    assert [r.task.id for r in host.results] == [2]


def test_a_scheduler_that_fails_at_the_end_of_a_task_loses_nothing() -> None:
    """The end was taken note of before the scheduler heard of it, and once only."""

    class Failing(_Scripted):
        def task_finished(self, result: Result, now: int) -> Iterable[Decision]:
            raise ZeroDivisionError(f"{result} at {now}")

    dispatch, host = _dispatch_of(Failing(idle=True))
    dispatch.arrived(_task(0), 0)
    running = dispatch.running
    assert running is not None
    with pytest.raises(ZeroDivisionError):
        dispatch.finished(running, 5)
    dispatch.replace(_Scripted(idle=True), 5)
    assert [r.task.id for r in host.results] == [0]


def test_a_result_is_judged_by_the_true_deadline() -> None:
    """The scheduler plans for an earlier one."""
    dispatch, host = _dispatch_of(_Scripted(idle=True))
    reserve = 7
    for number, late in enumerate((7, 8)):
        one = Task(number, MODEL, 0, 100, reserve=reserve)
        dispatch.arrived(one, 0)
        dispatch.finished(one, 100 + late)
    assert [r.outcome for r in host.results] == [TaskOutcome.DONE, TaskOutcome.LATE]


def test_an_executor_that_is_down_is_not_given_work() -> None:
    """What pays and fits goes to the cloud, the rest is dropped; the scheduler hears of both."""
    scheduler = _Scripted(*([lambda t, _: RunOnEdge(t)] * 3))
    dispatch, host = _dispatch_of(scheduler)
    dispatch.down.add("m")
    tasks = [_task(0), _task(1, -85 * MILLISECOND), _task(2)]
    for one in tasks[:2]:
        dispatch.arrived(one, 0)
    dispatch.finished(tasks[0], 20)
    dispatch.down.clear()
    dispatch.arrived(tasks[2], 30)
    assert host.asked == [("cloud", 0, 0), ("edge", 2, 30)]
    assert [(r.task.id, r.outcome) for r in host.results] == [
        (1, TaskOutcome.DROPPED),
        (0, TaskOutcome.DONE),
    ]
    assert scheduler.heard == host.results
    assert [one.reason for one in host.decisions[:2]] == [EXECUTOR_DOWN] * 2  # type: ignore[union-attr]


def test_a_cloud_that_is_gone_takes_no_tasks() -> None:
    """What waits for it and what a scheduler goes on sending is given up, not refused."""
    send = lambda t, _: SendToCloud(t)  # noqa: E731
    scheduler = _Scripted(send, send, send, send)
    dispatch, host = _dispatch_of(scheduler)
    tasks = [_task(number) for number in range(4)]
    for one in tasks[:2]:
        dispatch.arrived(one, 0)
    dispatch.change_resources(Resources(cloud_slots=0), 5)
    assert scheduler.resources.cloud_slots == 0
    dispatch.arrived(tasks[2], 6)
    dispatch.finished(tasks[0], 7, TaskOutcome.FAILED)
    dispatch.change_resources(Resources(cloud_slots=1), 8)
    dispatch.arrived(tasks[3], 9)
    assert host.asked == [("cloud", 0, 0), ("cloud", 3, 9)]
    assert [(r.task.id, r.outcome) for r in host.results] == [
        (1, TaskOutcome.DROPPED),
        (2, TaskOutcome.DROPPED),
        (0, TaskOutcome.FAILED),
    ]
    assert scheduler.heard == host.results


@pytest.mark.parametrize("name", scheduler_names())
def test_every_scheduler_keeps_off_a_cloud_that_is_gone(name: str) -> None:
    """Told in the middle of a run, it sends nothing until the cloud is back."""
    host = _RecordingHost()
    dispatch = Dispatch(load_scheduler(name), Resources(), host)
    dispatch.start(0)
    dispatch.change_resources(Resources(cloud_slots=0), 1)
    for number in range(8):
        dispatch.arrived(_task(number, 2), 2)
    assert not [one for one in host.asked if one[0] == "cloud"]
    for _, at in sorted({(0, at) for kind, _, at in host.asked if kind == "wake"}):
        dispatch.timer(max(at, 2))
    assert not [one for one in host.asked if one[0] == "cloud"]


@pytest.mark.parametrize("name", scheduler_names())
def test_every_scheduler_can_take_over_in_flight(name: str) -> None:
    """It is told the ends of tasks that it never saw start."""
    scheduler = _Scripted(lambda t, _: SendToCloud(t), lambda t, _: RunOnEdge(t))
    dispatch, host = _dispatch_of(scheduler, slots=4)
    tasks = [_task(number) for number in range(3)]
    for one in tasks:
        dispatch.arrived(one, 0)
    dispatch.replace(load_scheduler(name), 1)
    dispatch.finished(tasks[0], 2)
    dispatch.finished(tasks[1], 3, TaskOutcome.FAILED)
    dispatch.arrived(_task(7, 4), 4)
    ends = {result.task.id: result.outcome for result in host.results}
    assert (ends[0], ends[1]) == (TaskOutcome.DONE, TaskOutcome.FAILED)
    assert dispatch.running is not tasks[1]


class _Noting(_Scripted):
    """Notes each event with its time."""

    def __init__(self, *answers: object) -> None:
        super().__init__(*answers)
        self.told: list[tuple[str, int]] = []

    def task_arrived(self, task: Task, now: int) -> Iterable[Decision]:
        self.told.append(("arrived", now))
        return super().task_arrived(task, now)

    def executor_idle(self, now: int) -> Iterable[Decision]:
        self.told.append(("idle", now))
        return ()

    def timer(self, now: int) -> Iterable[Decision]:
        self.told.append(("timer", now))
        return ()

    def task_finished(self, result: Result, now: int) -> Iterable[Decision]:
        self.told.append((f"finished {result.task.id}", now))
        return ()


def test_a_scheduler_is_told_the_time_of_each_event_and_of_idleness_only_with_work_left() -> None:
    """Nothing is undecided until 2; the edge runs task 1 from 4 on."""
    scheduler = _Noting(lambda t, _: SendToCloud(t), None, lambda t, _: RunOnEdge(t))
    dispatch, host = _dispatch_of(scheduler)
    in_cloud, waiting, on_edge = _task(0), _task(1), _task(2)
    dispatch.arrived(in_cloud, 1)
    dispatch.arrived(waiting, 2)
    dispatch.timer(3)
    dispatch.arrived(on_edge, 4)
    dispatch.timer(5)
    dispatch.finished(in_cloud, 6)
    dispatch.finished(on_edge, 7)
    assert scheduler.told == [
        *[("arrived", 1), ("arrived", 2), ("idle", 2), ("timer", 3), ("idle", 3)],
        *[("arrived", 4), ("timer", 5), ("finished 0", 6), ("finished 2", 7), ("idle", 7)],
    ]
    assert [(r.task.id, r.started, r.finished) for r in host.results] == [(0, 1, 6), (2, 4, 7)]


def test_a_dropped_task_ran_nowhere() -> None:
    """Neither place is to blame, and it ended when it was given up."""
    dispatch, host = _dispatch_of(_Scripted(lambda t, _: Drop(t)))
    dispatch.arrived(_task(0), 3)
    (end,) = host.results
    assert (end.outcome, end.place) == (TaskOutcome.DROPPED, TaskPlace.NOWHERE)
    assert (end.started, end.finished) == (3, 3)


@pytest.mark.parametrize(("at", "place"), [(80, "cloud"), (81, "nowhere")])
def test_an_executor_that_is_down_leaves_the_cloud_until_the_last_moment(
    at: int, place: str
) -> None:
    """A task due at 100 that takes 20 there and gains half a unit may go until 80."""
    small = Profile("m", 2.5, MODEL.deadline, MODEL.edge_time, MODEL.cloud_time, 1, 2)
    dispatch, host = _dispatch_of(_Scripted(lambda t, _: RunOnEdge(t)))
    dispatch.down.add("m")
    dispatch.arrived(Task(0, small, 0, small.deadline), at * MILLISECOND)
    if place == "cloud":
        assert host.asked == [("cloud", 0, at * MILLISECOND)]
    else:
        assert [end.place for end in host.results] == [TaskPlace.NOWHERE]


class _Timed(_Noting):
    """Notes the start and changes of the resources as well, and answers the latter."""

    def start(self, resources: Resources, now: int) -> None:
        self.told.append(("start", now))
        super().start(resources, now)

    def resources_changed(self, resources: Resources, now: int) -> Iterable[Decision]:
        self.told.append(("resources", now))
        super().resources_changed(resources, now)
        return [WakeAt(now), *(Drop(task) for task in self.waiting)]


def test_the_time_of_a_start_and_of_a_change_of_resources_is_told() -> None:
    """A wake-up for that very moment is no past one, and what follows it is carried out, too."""
    scheduler = _Timed()
    host = _RecordingHost()
    dispatch = Dispatch(scheduler, Resources(cloud_slots=1), host)
    dispatch.start(3)
    dispatch.arrived(_task(0), 4)
    dispatch.change_resources(Resources(cloud_slots=2), 5)
    assert scheduler.told == [("start", 3), ("arrived", 4), ("idle", 4), ("resources", 5)]
    assert host.asked == [("wake", -1, 5)]
    assert [(end.task.id, end.finished) for end in host.results] == [(0, 5)]
    assert host.decided_at == [5]
    assert not dispatch.undecided


def test_an_idle_executor_is_offered_when_the_resources_or_the_scheduler_change() -> None:
    """For what is undecided, at that time; a new scheduler is told of its start before."""
    scheduler = _Noting()
    dispatch, host = _dispatch_of(scheduler)
    dispatch.arrived(_task(0), 4)
    dispatch.change_resources(Resources(cloud_slots=2), 5)
    assert scheduler.told == [("arrived", 4), ("idle", 4), ("idle", 5)]
    another = _Timed(lambda t, _: SendToCloud(t))
    dispatch.replace(another, 6)
    assert another.told == [("start", 6), ("arrived", 6)]
    assert host.decided_at == [6]


def test_a_wake_up_in_the_past_is_refused_with_its_time() -> None:
    """As it was decided."""
    dispatch, _ = _dispatch_of(_Scripted(lambda _, __: WakeAt(9)))
    with pytest.raises(SchedulerError, match=r"_Scripted decided WakeAt\(at=9.*now is 10"):
        dispatch.arrived(_task(0, 10), 10)


def test_a_scheduler_that_answers_nothing_is_named() -> None:
    """None is a forgotten return, and the message says whose."""

    class Forgetful(_Scripted):
        def task_arrived(self, task: Task, now: int) -> Iterable[Decision]:  # noqa: ARG002
            return None  # type: ignore[return-value]

    dispatch, _ = _dispatch_of(Forgetful())
    with pytest.raises(SchedulerError, match=r"^Forgetful answered an event with None"):
        dispatch.arrived(_task(0), 0)


def test_what_is_given_up_ends_when_it_is() -> None:
    """For an executor that is down and for a cloud that is gone, with or without a queue."""
    scheduler = _Scripted(lambda t, _: RunOnEdge(t), *([lambda t, _: SendToCloud(t)] * 3))
    dispatch, host = _dispatch_of(scheduler)
    dispatch.down.add("m")
    late = 90 * MILLISECOND
    dispatch.arrived(_task(0), late)
    for number in (1, 2):
        dispatch.arrived(_task(number), late + number)
    dispatch.change_resources(Resources(cloud_slots=0), late + 3)
    dispatch.arrived(_task(3), late + 4)
    ends = [(end.task.id, end.place, end.started, end.finished) for end in host.results]
    assert ends == [
        (number, TaskPlace.NOWHERE, late + when, late + when)
        for number, when in ((0, 0), (2, 3), (3, 4))
    ]
    assert scheduler.heard == host.results


def test_a_task_is_in_time_at_its_deadline_and_may_leave_at_its_latest_start() -> None:
    """Equal is within, for the result and for the queue of the cloud."""
    send = lambda t, _: SendToCloud(t, "", 40)  # noqa: E731
    dispatch, host = _dispatch_of(_Scripted(send, send))
    first, second = _task(0), _task(1)
    for one in (first, second):
        dispatch.arrived(one, 0)
    dispatch.finished(first, 40)
    assert host.asked[-1] == ("cloud", 1, 40)
    dispatch.finished(second, second.deadline)
    assert [end.outcome for end in host.results] == [TaskOutcome.DONE] * 2


def test_a_closed_edge_is_offered_to_nobody() -> None:
    """Whatever happens meanwhile; what waits starts when it is opened, one at a time."""
    dispatch, host = _dispatch_of(_Scripted(idle=True))
    dispatch.edge_open = False
    dispatch.arrived(_task(0), 0)
    dispatch.arrived(_task(1), 1)
    dispatch.timer(2)
    dispatch.change_resources(Resources(cloud_slots=2), 3)
    dispatch.offer(4)
    assert host.asked == []
    dispatch.edge_open = True
    dispatch.offer(5)
    assert host.asked == [("edge", 0, 5)]
    dispatch.offer(6)
    assert dispatch.running is not None
    dispatch.edge_open = False
    dispatch.finished(dispatch.running, 7)
    assert host.asked == [("edge", 0, 5)]
