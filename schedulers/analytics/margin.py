"""MARGIN: expected utility at the margin, planned ahead. The project's own scheduler.

Idea. Every waiting task has a value in the cloud that fades as its time runs out, and a value on
the edge that depends on when it would start. The edge is scarce, so what counts there is the
difference: the gain over the cloud, with the chance of being late priced in.

1. Execution times are distributions that are learned online (`estimates`); a cloud task is worth
   benefit x chance(in time) - cost, so a placement that is likely to fail is never paid for.
2. The edge follows a plan over the next second (`planner`): beam search over sequences of waiting
   and of forecast tasks (`forecast`: video is periodic), by gain over the cloud less the price of
   edge time. The plan stands until reality departs from it.
3. A task waits for the edge only while waiting can still pay (`outlook.patience`, a marginal
   condition instead of a fixed last moment); then it is kept if the plan runs it, else sent.
4. A cloud whose answers are overdue is avoided; one cheap task a second goes to see (`outlook`).
5. A success that decides a window's QoE bonus is worth that much more (`quality`).

Sources: average-reward planning (Howard, 1960); the price of edge time is the dual of the
fractional knapsack over the models' loads (Dantzig, 1957); deferral and stealing are those of
DEMS (Raj et al., 2025). Cost: a plan takes width x lanes x steps evaluations, about 0.1 ms in
Python, twice a second or when surprised; every other event takes O(log n) in the tasks waiting.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field
from heapq import heappop, heappush
from math import exp

from aerodaas.clock import NANOSECONDS
from aerodaas.schedulers.analytics.base import (
    MILLISECOND,
    STOLEN,
    AnalyticsScheduler,
    Decision,
    Drop,
    Profile,
    QoeGoal,
    Resources,
    Result,
    RunOnEdge,
    SendToCloud,
    Task,
    TaskOutcome,
    TaskPlace,
    WakeAt,
)
from aerodaas.schedulers.analytics.estimates import TimeEstimates
from aerodaas.schedulers.analytics.forecast import LATENESS, Forecast
from aerodaas.schedulers.analytics.outlook import CloudOutlook
from aerodaas.schedulers.analytics.planner import Job, JobQueue, plan
from aerodaas.schedulers.analytics.quality import QualityWatch

__all__ = ["Margin"]

HORIZON = 1_000 * MILLISECOND
REPLAN = 500 * MILLISECOND
"""A plan that reaches less far ahead is made anew."""
GAP = 250 * MILLISECOND
"""Longest time that the edge stays idle for a better task to come."""
WIDTH = 4
SURPRISE = 3 * MILLISECOND
"""Departure from the expected end of an execution that calls for a new plan."""
_MEMORY = 5 * NANOSECONDS
_LOOK = 5
"""Tasks of one model that the planner considers."""


@dataclass(slots=True)
class _Model:
    profile: Profile
    quality: QualityWatch
    waiting: dict[Task, bool] = field(default_factory=dict)
    """In order of arrival; True once kept for the edge."""
    forecast: Forecast = field(default_factory=Forecast)
    rate: float = 0.0
    """Arrivals per nanosecond, exponentially forgotten."""
    seen: int = 0
    on_edge: float = 1.0
    waited: float = float(NANOSECONDS)


class Margin(AnalyticsScheduler):
    """Plans the edge a second ahead by expected gain over the cloud, with the risk priced in."""

    learns = frozenset({"edge_time", "cloud_time"})

    def __init__(self) -> None:
        self.cloud = CloudOutlook()
        self.edge = TimeEstimates(shared=False)
        self._models: dict[str, _Model] = {}
        self._due: list[tuple[int, int, Task]] = []
        """When each waiting task needs a decision, a heap; entries of others are stale."""
        self._hopeful: dict[str, deque[Task]] = {}
        """Per model, tasks that would go to the cloud if it were not crowded; some are stale."""
        self._wakes: list[int] = []
        """Timers asked for that have not come yet, a heap."""
        self._free_at = 0.0
        self._steps: list[tuple[float, JobQueue, Job]] = []
        self._planned: set[Task] = set()
        self._awaited: dict[tuple[str, str], Job] = {}
        """Jobs of the plan that are forecast, by model and source."""
        self._plan_end = 0.0
        self._stale = True

    def start(self, resources: Resources, now: int) -> None:
        """Begin a run."""
        super().start(resources, now)
        self.cloud.resources = resources

    def task_arrived(self, task: Task, now: int) -> Iterable[Decision]:
        """Let the task wait for as long as that can pay, or send it as a probe."""
        model = self._models.get(task.profile.model) or self._model(task.profile)
        model.quality.arrival(task.arrival)
        model.rate = model.rate * exp((model.seen - now) / _MEMORY) + 1 / _MEMORY
        model.seen = now
        self._stale |= not model.forecast.arrived(task.source, now)
        if self._awaited:
            self._fill_step(task)
        self.cloud.listen(now)
        value = self._cloud_value(model, task, now)
        if (
            value <= 0
            and self.cloud.wants_probe(now)
            and task not in self._planned
            and self._is_cheapest(model)
        ):
            self.cloud.sent(task, now)
            return [SendToCloud(task, "probe of the cloud")]
        model.waiting[task] = False
        due = self._due_at(model, task, now, value)
        if due <= now and not (self._due and self._due[0][0] <= due):
            decisions = self._settle(model, task, value, due, now)
        else:
            heappush(self._due, (due, task.id, task))
            decisions = []
        return self._decide(now, decisions)

    def timer(self, now: int) -> Iterable[Decision]:
        """Decide about the tasks for which waiting no longer pays."""
        while self._wakes and self._wakes[0] <= now:
            heappop(self._wakes)
        self.cloud.listen(now)
        return self._decide(now, [])

    def _decide(self, now: int, decisions: list[Decision]) -> list[Decision]:
        """Add what is due to the decisions, and the next time at which something will be."""
        while self._due and self._due[0][0] <= now:
            task = heappop(self._due)[2]
            model = self._models[task.profile.model]
            if task not in model.waiting:
                continue
            kept = model.waiting[task]
            value = 0.0 if kept else self._cloud_value(model, task, now)
            due = self._due_at(model, task, now, value)
            decisions += self._settle(model, task, value, due, now)
        if self._due:
            decisions += self._wake_up(now, self._due[0][0])
        return decisions

    def _settle(
        self, model: _Model, task: Task, value: float, due: int, now: int
    ) -> list[Decision]:
        """Let the task wait until it is due; if it is, keep it for the edge, send or drop it."""
        if due <= now and value > 0:
            self._refresh(now)
            if task not in self._planned:
                return [self._send(model, task, now)]
            model.waiting[task] = True
            due = self._due_at(model, task, now, 0.0)
        if due <= now:
            return [self._drop(model, task)]
        heappush(self._due, (due, task.id, task))
        return []

    def executor_idle(self, now: int) -> Iterable[Decision]:
        """Follow the plan: run its first task, or wait for one that is due to arrive."""
        self._refresh(now)
        if self._steps and not isinstance(self._steps[0][2].what, Task):
            expected = int(self._steps[0][2].release) + LATENESS
            if now < expected:
                if self._due and self._due[0][0] < expected:
                    expected = self._due[0][0]
                return self._wake_up(now, expected)
            self._stale = True
            self._refresh(now)
        if not self._steps or not isinstance(self._steps[0][2].what, Task):
            return ()
        _, lane, job = self._steps.pop(0)
        task: Task = job.what
        self._planned.discard(task)
        model = self._models[task.profile.model]
        kept = model.waiting.pop(task)
        model.waited += now - task.arrival
        model.on_edge += 1
        self._free_at = now + lane.time.mean
        bound_for_cloud = not kept and task.profile.cloud_gain > 0
        return [RunOnEdge(task, STOLEN if bound_for_cloud else "most valuable plan")]

    def task_finished(self, result: Result, now: int) -> Iterable[Decision]:
        """Learn from the result."""
        task = result.task
        model = self._models.get(task.profile.model) or self._model(task.profile)
        model.quality.ended(task.arrival, in_time=result.outcome is TaskOutcome.DONE)
        if result.place is TaskPlace.EDGE:
            self._stale |= abs(self._free_at - now) > SURPRISE
            self._free_at = now
            if result.outcome is not TaskOutcome.FAILED:
                self.edge.observe(task.profile, result.finished - result.started, now)
        else:
            self.cloud.finished(result, now)
            if self._hopeful and not self.cloud.crowded:
                return self._fill_slots(now)
        return ()

    def resources_changed(self, resources: Resources, now: int) -> Iterable[Decision]:
        """Plan for a cloud that is gone, or back: earlier estimates of it are void."""
        self.cloud.resources = resources
        self.cloud.silent_since = None
        self._stale = True
        return super().resources_changed(resources, now)

    def _model(self, profile: Profile) -> _Model:
        """Begin to watch a model."""
        model = _Model(profile, QualityWatch(profile.qoe or QoeGoal(0.0)))
        self._models[profile.model] = model
        return model

    def _is_cheapest(self, model: _Model) -> bool:
        cost = model.profile.cloud_cost
        return all(cost <= other.profile.cloud_cost for other in self._models.values())

    def _cloud_value(self, model: _Model, task: Task, now: int) -> float:
        return self.cloud.value(model.profile, task.deadline - now, model.quality.worth())

    def _due_at(self, model: _Model, task: Task, now: int, value: float) -> int:
        """When the task needs a decision: to leave for the cloud, or to be given up."""
        if value > 0 and self.cloud.slot_price > 0:
            return now
        if value > 0:
            worth = max(model.profile.edge_gain - value, 0.0)
            rate = model.on_edge / model.waited
            return int(task.deadline - self.cloud.patience(model.profile, worth, rate))
        if self.cloud.crowded and not model.waiting.get(task) and model.profile.cloud_gain > 0:
            self._hopeful.setdefault(task.profile.model, deque()).append(task)
        belief = self.edge.belief(model.profile)
        return int(task.deadline - belief.mean + belief.sigma)

    def _fill_slots(self, now: int) -> Iterable[Decision]:
        """Give free slots to waiting tasks, the most valuable models first."""
        for name in sorted(self._hopeful, key=self._slot_worth, reverse=True):
            model, queue = self._models[name], self._hopeful[name]
            while queue and not self.cloud.crowded:
                task = queue.popleft()
                if model.waiting.get(task, True) or self._cloud_value(model, task, now) <= 0:
                    continue
                self._refresh(now)
                if task not in self._planned:
                    yield self._send(model, task, now)
            if not queue:
                del self._hopeful[name]

    def _slot_worth(self, name: str) -> float:
        profile = self._models[name].profile
        return profile.cloud_gain / profile.cloud_time

    def _wake_up(self, now: int, at: int) -> list[Decision]:
        if self._wakes and self._wakes[0] <= at:
            return []
        at = max(at, now)
        heappush(self._wakes, at)
        return [WakeAt(at)]

    def _send(self, model: _Model, task: Task, now: int) -> SendToCloud:
        del model.waiting[task]
        model.waited += now - task.arrival
        self.cloud.sent(task, now)
        return SendToCloud(task, "worth more there", self.cloud.latest_start(task))

    def _drop(self, model: _Model, task: Task) -> Drop:
        del model.waiting[task]
        model.quality.ended(task.arrival, in_time=False)
        self._stale |= task in self._planned
        return Drop(task, "no longer worth its cost anywhere")

    def _fill_step(self, task: Task) -> None:
        """Put a task that came as forecast into its place in the plan."""
        job = self._awaited.pop((task.profile.model, task.source), None)
        if job is not None:
            job.what = task
            self._planned.add(task)

    def _refresh(self, now: int) -> None:
        """Make a new plan if the present one is wrong or runs out."""
        if not self._stale and self._plan_end > now + REPLAN:
            return
        begin = float(max(self._free_at, now))
        self._plan_end = begin + HORIZON
        lanes = [
            lane for model in self._models.values() if (lane := self._lane(model, begin, now)).jobs
        ]
        self._steps = plan(lanes, begin, self._plan_end, self._price(now), width=WIDTH, gap=GAP)
        self._planned, self._awaited = set(), {}
        for _, _, job in self._steps:
            if isinstance(job.what, Task):
                self._planned.add(job.what)
            else:
                self._awaited[job.what] = job
        self._stale = False

    def _lane(self, model: _Model, begin: float, now: int) -> JobQueue:
        profile = model.profile
        bonus = model.quality.worth()
        benefit = profile.benefit + bonus
        belief = self.edge.belief(profile)
        soonest = begin + belief.mean - belief.sigma
        jobs: list[Job] = []
        for task, kept in model.waiting.items():
            if task.deadline > soonest:
                room = task.deadline - now
                elsewhere = 0.0 if kept else self.cloud.value(profile, room, bonus)
                cost = profile.edge_cost + elsewhere
                jobs.append(Job(task, begin, float(task.deadline), benefit, cost))
                if len(jobs) == _LOOK:
                    return JobQueue(belief, jobs)
        cost = profile.edge_cost + self.cloud.value(profile, profile.deadline, bonus)
        for at, source in model.forecast.due(now, int(begin + HORIZON)):
            what = (profile.model, source)
            jobs.append(Job(what, float(at), float(at + profile.deadline), benefit, cost))
            if len(jobs) == _LOOK:
                break
        return JobQueue(belief, jobs)

    def _price(self, now: int) -> float:
        """Value of edge time, per nanosecond: the gain of the best mix of models on it.

        Prices the cloud's slots on the way, from the same loads.
        """
        age = 1 - exp(-(now + NANOSECONDS / 10) / _MEMORY)
        on_edge: list[tuple[float, float]] = []
        in_cloud: list[tuple[float, float]] = []
        for model in self._models.values():
            profile = model.profile
            rate = model.rate * exp((model.seen - now) / _MEMORY) / age
            time = self.edge.belief(profile).mean
            gain = profile.edge_gain - self.cloud.value(profile, profile.deadline)
            on_edge.append((gain / time, rate * time))
            time = self.cloud.beliefs.belief(profile).mean
            if profile.cloud_gain > 0:
                in_cloud.append((profile.cloud_gain / time, rate * time))
        self.cloud.set_slot_price(in_cloud)
        left, earned = 1.0, 0.0
        for density, load in sorted(on_edge, reverse=True):
            earned += min(left, load) * density
            left = max(0.0, left - load)
        return earned
