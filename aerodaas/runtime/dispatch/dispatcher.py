"""Dispatcher node: an analytics scheduler decides in flight where and when each analysis runs.

The scheduler is the same class as in the laboratory, driven through the same `Dispatch`. Each
frame becomes a task for each managed analysis. The edge executor is serial, as in the model that
the schedulers were designed for: one analysis runs at a time. Only the dispatcher publishes the
analyses' results, so that a late result is discarded. A scheduler that raises or returns invalid
decisions is replaced by edge-first EDF.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from aerodaas.clock import NANOSECONDS, Clock, host_time_ns
from aerodaas.errors import failure_line
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Header
from aerodaas.messages.mission import Decision
from aerodaas.runtime.dispatch.guarded_scheduler import GuardedDispatch
from aerodaas.runtime.node import Node, Outlet
from aerodaas.runtime.nodes.triggers import TriggerSpec, fire
from aerodaas.runtime.session import FRAME_DEPTH, MESSAGE_DEPTH, Session
from aerodaas.runtime.stream_names import DECISIONS, done_stream, task_stream
from aerodaas.schedulers.analytics.base import (
    MILLISECOND,
    AnalyticsScheduler,
    Drop,
    Profile,
    Resources,
    Result,
    RunOnEdge,
    SendToCloud,
    Task,
    TaskOutcome,
)
from aerodaas.schedulers.analytics.published.edge_cloud import EdgeCloudEdf
from aerodaas.schedulers.analytics.windows import QoeWindows

__all__ = ["Counts", "DecisionLog", "Dispatcher", "Managed"]

_FORGOTTEN = NANOSECONDS
"""Nanoseconds after its deadline at which a task, undecided with an idle edge, is an error."""


@dataclass(frozen=True)
class Managed:
    """One analysis managed by the dispatcher."""

    stream: str
    inputs: tuple[str, ...]
    profile: Profile
    """Times, deadline and utility; its model's name is the stream."""
    open_times: frozenset[str] = frozenset()
    """Times of the profile that are to be measured, because the user gave none."""
    triggers: tuple[TriggerSpec, ...] = ()
    offloadable: bool = True
    """Whether anything in the cloud runs it."""


class Dispatcher(Node):
    """Base of the dispatchers: runs a scheduler for the executors of the managed analyses.

    A subclass implements `run_edge`, `run_cloud` and `wake_at`, and says in `step` when executions
    have ended.
    """

    def __init__(
        self,
        session: Session,
        scheduler: AnalyticsScheduler,
        managed: tuple[Managed, ...],
        resources: Resources,
    ) -> None:
        """Create the dispatcher.

        Args:
            session: The run.
            scheduler: The analytics scheduler.
            managed: Analyses whose executions it decides about.
            resources: Those of the edge and the cloud; without a cloud, it has no slots.
        """
        inputs = dict.fromkeys((s for one in managed for s in one.inputs), FRAME_DEPTH)
        answers = dict.fromkeys((done_stream(one.stream) for one in managed), MESSAGE_DEPTH)
        # Of simultaneous messages, ends precede arrivals, as in the laboratory.
        super().__init__("dispatcher", {**answers, **inputs})
        self.managed = managed
        self._by_stream = {one.stream: one for one in managed}
        self._by_done = {done_stream(one.stream): one for one in managed}
        self._session = session
        self._resources = resources
        self._dispatch = GuardedDispatch(scheduler, resources, self)
        self._replaced = False
        self._numbers = itertools.count()
        self._frames: dict[int, Message[Any]] = {}
        """The frame of each task."""
        self._results: dict[int, Message[Any]] = {}
        self._figures: dict[int, dict[str, float]] = {}
        """Durations and sizes of an execution in the cloud, by task."""
        self._reasons: dict[int, str] = {}
        """Reason of a failed execution, or where it ran, by task."""
        self._counts = Counts()
        many = {one.stream for one in managed if len(one.inputs) > 1}
        self._log = DecisionLog(self.outlet(DECISIONS), many)
        for one in managed:
            for stream in (task_stream(one.stream), one.stream, *(t.stream for t in one.triggers)):
                self.outlet(stream)
        self._out: list[Message[Any]] = []

    def start(self, clock: Clock) -> Sequence[Message[Any]]:
        """Start the scheduler."""
        self._guarded("start", clock.now())
        return self._published()

    def _published(self) -> list[Message[Any]]:
        published, self._out = self._out, []
        return published

    # Events.

    def _frame_arrived(self, managed: Managed, message: Message[Any], now: int) -> None:
        """Make a task of a frame and pass it to the scheduler."""
        if message.item is None:
            return
        profile = self._profile(managed)
        reserve = self._reserve(profile.deadline)
        task = Task(
            id=next(self._numbers),
            profile=profile,
            arrival=now,
            deadline=now + profile.deadline - reserve,
            source=message.header.source,
            segment=message.header.id,
            reserve=reserve,
        )
        self._frames[task.id] = message
        self._counts.arrived(task)
        self._guarded("arrived", task, now)

    def _profile(self, managed: Managed) -> Profile:
        """Times, deadline and utility of a new task."""
        return managed.profile

    def _reserve(self, deadline: int) -> int:
        """Nanoseconds by which a task's relative deadline is shortened."""
        del deadline
        return 0

    def _require_decisions(self, now: int) -> None:
        """Replace a scheduler that leaves a task undecided beyond its deadline."""
        oldest = next(iter(self._dispatch.undecided.values()), None)
        if oldest is None or self._replaced or now <= oldest.deadline + _FORGOTTEN:
            return
        self._replace(f"left {self._log.label(oldest)} undecided beyond its deadline", now)

    def _guarded(self, event: str, *args: Any) -> None:  # noqa: ANN401
        """Pass an event to the scheduler; replace one that raises, misbehaves or is slow."""
        now = next(arg for arg in reversed(args) if isinstance(arg, int))
        try:
            getattr(self._dispatch, event)(*args)
        except Exception as error:  # noqa: BLE001 - a plug-in may raise anything
            self._replace(failure_line(error), now)

    def _replace(self, why: str, now: int) -> None:
        name = type(self._dispatch.scheduler).__name__
        if self._replaced:
            self.host.alert("scheduler_failed", f"{name}: {why}")
            return
        self._replaced = True
        self.host.alert("scheduler_failed", f"{name}: {why}; going on with edge-first EDF")
        self._dispatch.replace(EdgeCloudEdf(), now)

    # Host interface of `Dispatch`.

    def run_edge(self, task: Task, now: int) -> None:
        """Start an execution on the edge.

        Args:
            task: The task.
            now: Mission clock, nanoseconds.
        """
        raise NotImplementedError

    def run_cloud(self, task: Task, now: int) -> None:
        """Start an execution in the cloud.

        Args:
            task: The task.
            now: Mission clock, nanoseconds.
        """
        raise NotImplementedError

    def wake_at(self, at: int) -> None:
        """Add a time at which the scheduler is to be woken."""
        raise NotImplementedError

    def _send_task(self, task: Task, item: object) -> None:
        """Send a task with `item` to the node of its analysis."""
        frame = self._frames[task.id]
        outlet = self.outlet(task_stream(task.profile.model))
        self._out.append(outlet.derive(item, frame, host_time_ns(), frame.stamp))

    def decided(self, decision: RunOnEdge | SendToCloud | Drop, now: int) -> None:
        """Publish a decision with its reason.

        Args:
            decision: The decision, with its task and reason.
            now: Mission clock, nanoseconds.
        """
        task = decision.task
        if isinstance(decision, Drop):
            self._reasons[task.id] = decision.reason
            action = "drop"
        else:
            action = "edge" if isinstance(decision, RunOnEdge) else "cloud"
        self._out.append(self._log.message(task, action, decision.reason, now))

    def closed(self, result: Result) -> None:
        """Publish a task's result if it is in time, and its outcome."""
        task = result.task
        frame = self._frames.pop(task.id)
        answer = self._results.pop(task.id, None)
        in_time = result.outcome is TaskOutcome.DONE
        origin = answer if answer is not None else frame
        if answer is not None and answer.item is not None and in_time:
            self._publish(self._by_stream[task.profile.model], origin)
        self._counts.ended(result)
        why = self._reasons.pop(task.id, None)
        figures = self._figures.pop(task.id, None)
        if result.outcome is not TaskOutcome.DROPPED:
            reason = f"{result.place.value}: {why}" if why else result.place.value
        elif why is None:
            reason = "no room in the cloud in time"
        else:
            return
        totals = {"utility": result.utility, **self._counts.totals, **(figures or {})}
        outcome = result.outcome.value
        self._out.append(self._log.message(task, outcome, reason, result.finished, totals))

    def _publish(self, managed: Managed, answer: Message[Any]) -> None:
        stamp = self._stamp(answer)
        report = partial(self._report, managed.stream)
        self._out += fire(self, managed.triggers, answer.item, answer, self.host.now(), report)
        outlet = self.outlet(managed.stream)
        self._out.append(outlet.derive(answer.item, answer, host_time_ns(), stamp))

    def _stamp(self, answer: Message[Any]) -> int:
        """Mission time of a published result: that of the analysis' answer."""
        return answer.stamp

    def _report(self, stream: str, error: Exception) -> None:
        self.host.alert("analysis_failed", f"{stream}: {failure_line(error)}")

    def close(self) -> None:
        """End the scheduler's thread."""
        self._dispatch.close()

    def values(self) -> dict[str, Any]:
        """Counts of tasks, outcomes and utility, and the scheduler's name."""
        return {
            **self._counts.values(),
            "scheduler": type(self._dispatch.scheduler).__name__,
            "replaced": self._replaced,
            "edge_down": sorted(self._dispatch.down),
            "cloud_slots": self._dispatch.resources.cloud_slots,
        }


class DecisionLog:
    """Decisions and outcomes of each task, as messages."""

    def __init__(self, outlet: Outlet, many: set[str]) -> None:
        """Number the messages by `outlet`; `many` are the analyses of several cameras."""
        self._outlet = outlet
        self._many = many

    def label(self, task: Task) -> str:
        """Name of a task: the analysis, the camera if it has several, and the frame."""
        model = task.profile.model
        source = f"{task.source}:" if model in self._many else ""
        return f"{model}#{source}{task.segment}"

    def message(
        self,
        task: Task,
        action: str,
        reason: str,
        now: int,
        totals: Mapping[str, float] | None = None,
    ) -> Message[Decision]:
        """Make the message of one decision or outcome.

        Args:
            task: The task.
            action: Decision or outcome, as in `Decision`.
            reason: Why, in a few words.
            now: Mission time, nanoseconds.
            totals: Further figures by name.
        """
        slack = task.deadline + task.reserve - now
        waited = (now - task.arrival) / 1e6
        # The tasks of a frame arrive at the same time; their numbers give the order.
        values = {"slack_ms": slack / 1e6, "waited_ms": waited, "number": float(task.id)}
        if action in {"edge", "cloud"}:
            values["edge_ms"] = task.profile.edge_time / MILLISECOND
            values["cloud_ms"] = task.profile.cloud_time / MILLISECOND
        if task.reserve:
            values["reserve_ms"] = task.reserve / 1e6
        values |= totals or {}
        header = Header(self._outlet.sent, now, DECISIONS)
        record = Decision(now, self.label(task), action, reason, values)
        return self._outlet.measure(record, header, host_time_ns())


class Counts:
    """Counts of tasks and outcomes and the utility of a run, as in the simulator."""

    def __init__(self) -> None:
        """Start with all counts at zero."""
        self._tasks = 0
        self._outcomes: Counter[str] = Counter()
        self._places: Counter[str] = Counter()
        self._utility = 0.0
        self._windows = QoeWindows()

    def arrived(self, task: Task) -> None:
        """Count a task."""
        self._tasks += 1
        self._windows.arrived(task)

    def ended(self, result: Result) -> None:
        """Count a task's outcome and utility."""
        self._outcomes[result.outcome.value] += 1
        self._places[result.place.value] += 1
        self._utility += result.utility
        if result.outcome is TaskOutcome.DONE:
            self._windows.done(result.task)

    @property
    def totals(self) -> dict[str, float]:
        """Utility so far: QoS and QoE."""
        return {"qos_total": self._utility, "qoe_total": self._windows.utility}

    def values(self) -> dict[str, Any]:
        """All counts, for the report."""
        return {
            "tasks": self._tasks,
            "outcomes": dict(self._outcomes),
            "places": dict(self._places),
            **self.totals,
            "qoe_windows": self._windows.won,
        }
