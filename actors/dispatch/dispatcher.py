"""Dispatcher actor: an analytics scheduler decides live where and when each analysis runs.

The scheduler is the same class as in the simulator, driven through the same `Dispatch`. Each
frame becomes a task for each managed analysis. The edge executor is serial, as in the model that
the schedulers were designed for: one analysis runs at a time. Only the dispatcher publishes the
analyses' results, so that a late result is discarded.

An executor that dies is restarted by Ray, and its task is retried once if the deadline allows. A
cloud that is gone has no slots until it answers again. A scheduler that raises, returns invalid
decisions or is slow is replaced by edge-first EDF.
"""

from __future__ import annotations

import heapq
import itertools
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from aerodaas.actors.base import StreamActor
from aerodaas.actors.cluster.liveness import Life, LivenessMonitor
from aerodaas.actors.dispatch.decisions import Counts, DecisionLog
from aerodaas.actors.dispatch.edge_turns import EdgeTurns
from aerodaas.actors.dispatch.executor_pool import ExecutorPool
from aerodaas.actors.dispatch.remote_executor import Executor, RemoteResult
from aerodaas.actors.triggers import Triggers, TriggerSpec
from aerodaas.runtime.dispatch.deadline_reserve import DeadlineReserve
from aerodaas.runtime.dispatch.estimates import Estimates
from aerodaas.runtime.dispatch.guarded_scheduler import GuardedDispatch
from aerodaas.runtime.dispatch.recent_frames import FrameReferences, MissingFrame
from aerodaas.runtime.session import FRAME_DEPTH, MESSAGE_DEPTH, Session
from aerodaas.runtime.stream_names import ACKS, DECISIONS, done_stream, task_stream
from aerodaas.schedulers.analytics.base import (
    AnalyticsScheduler,
    Drop,
    Profile,
    Resources,
    Result,
    RunOnEdge,
    SendToCloud,
    Task,
    TaskOutcome,
    TaskPlace,
)
from aerodaas.schedulers.analytics.published.edge_cloud import EdgeCloudEdf
from aerodaas.types.clock import NANOSECONDS, host_time_ns
from aerodaas.types.data import Frame
from aerodaas.types.errors import failure_line
from aerodaas.types.status import Message

__all__ = ["DispatcherActor", "Managed"]

_LAST_ANSWERS = 2.0
"""Seconds to wait for the cloud's answers at the end of a run."""
_COMPLAINTS_KEPT = 16
_EDGE_PATIENCE = 4
"""An execution on the edge that takes this many times its expected time has failed."""
_LEAST_PATIENCE = NANOSECONDS
"""... but not before this: a first inference may take several."""
_FORGOTTEN = NANOSECONDS
"""Nanoseconds after its deadline at which a task, undecided with an idle edge, is an error."""


@dataclass(frozen=True)
class Managed:
    """One analysis managed by the dispatcher."""

    stream: str
    inputs: tuple[str, ...]
    profile: Profile
    """Times, deadline and utility; its model's name is the stream."""
    acknowledges: bool = False
    """Whether mission time waits for each of its frames, because its results have no readers."""
    open_times: frozenset[str] = frozenset()
    """Times of the profile that are to be measured, because the user gave none."""
    triggers: tuple[TriggerSpec, ...] = ()
    offloadable: bool = True
    """Whether anything in the cloud runs it."""


class DispatcherActor(StreamActor):
    """Actor that runs `scheduler` for the executors of the `managed` analyses."""

    niceness = 5
    answers_always = False
    """Whether a frame without a result in time is answered, too."""

    def __init__(
        self,
        session: Session,
        scheduler: AnalyticsScheduler,
        managed: tuple[Managed, ...],
        resources: Resources,
    ) -> None:
        """Create the actor of `session`; without a cloud, `resources` has no cloud slots."""
        inputs = dict.fromkeys((s for one in managed for s in one.inputs), FRAME_DEPTH)
        answers = dict.fromkeys((done_stream(one.stream) for one in managed), MESSAGE_DEPTH)
        # Of simultaneous messages, ends precede arrivals, as in the simulator.
        super().__init__(session, "dispatcher", {**answers, **inputs})
        self._managed = managed
        self._by_done = {done_stream(one.stream): one for one in managed}
        self._resources = resources
        self._dispatch = GuardedDispatch(scheduler, resources, self)
        self._replaced = False
        self._numbers = itertools.count()
        self._frames: dict[int, Message[Any]] = {}
        self._references = FrameReferences()
        self._carried = 0
        """Tasks on the edge whose frame was sent again, because its executor no longer had it."""
        self._results: dict[int, Message[Any]] = {}
        self._timers: list[int] = []
        self._edge_since = 0
        self._way = DeadlineReserve()
        self._estimates = Estimates(session.speed or 1.0, scheduler.learns)
        self._now = 0
        self._figures: dict[int, dict[str, float]] = {}
        """Durations and sizes of an execution in the cloud, by task."""
        self._why: dict[int, str] = {}
        """Reason of a failed execution, by task."""
        self._lost: set[int] = set()
        """Tasks whose executor died during the execution."""
        self._second: set[int] = set()
        """Tasks in their second try."""
        self._again: deque[Task] = deque()
        """Tasks to be retried at once, ..."""
        self._orphans: dict[str, list[Task]] = {}
        """... and those that wait for their executor, by model."""
        self._gone: set[str] = set()
        """Models whose executor on the edge will not come back."""
        self._complaints: deque[str] = deque(maxlen=_COMPLAINTS_KEPT)
        """Failures in the cloud that have raised an alert."""
        self._counts = Counts()
        self._turns: EdgeTurns | None = None
        """Turns on an edge that other flights use, too; None for one of this flight alone."""
        self._dispatch.edge_open = session.edge is None
        self._cloud: ExecutorPool | None = None
        self._liveness_monitor: LivenessMonitor | None = None
        self._lives: deque[tuple[str, Life]] = deque()
        """Liveness changes of executors on the edge, from other threads."""

    def prepare(
        self,
        edge: Mapping[str, Any] | None = None,
        cloud: Sequence[Executor] = (),
    ) -> Any:  # noqa: ANN401 - the base's info
        """Open the streams.

        `edge` are the actors of the analyses, by stream; `cloud` are the executors in the cloud.
        """
        info = super().prepare()
        assert self.subscriber is not None  # noqa: S101 - prepared
        timeout = self._resources.cloud_timeout
        wake = self.subscriber.wake
        self._cloud = (
            ExecutorPool(cloud, timeout, wake, self.session.speed or 1.0) if cloud else None
        )

        if self.session.edge is not None:
            self._turns = EdgeTurns(self.session.edge, wake)

        def tell(model: str, life: Life) -> None:
            self._lives.append((model, life))
            wake()

        self._liveness_monitor = LivenessMonitor(edge or {}, tell)
        return info

    def _open(self) -> None:
        many = {one.stream for one in self._managed if len(one.inputs) > 1}
        self._log = DecisionLog(self.publisher(DECISIONS), many)
        self._tasks = {one.stream: self.publisher(task_stream(one.stream)) for one in self._managed}
        self._acks = {
            one.stream: self.publisher(f"{ACKS}/{one.stream}")
            for one in self._managed
            if one.acknowledges
        }
        self._answers = {one.stream: self.publisher(one.stream) for one in self._managed}
        self._triggers = {
            one.stream: Triggers(one.triggers, self.publisher) for one in self._managed
        }

    def _run(self) -> None:
        assert self.subscriber is not None  # noqa: S101 - set by prepare
        self._guarded("start", self._time())
        while not self.stopping:
            for message in self.subscriber.receive(self._patience()):
                self._wake_scheduler()
                self._take(message)
            while self._lives:
                self._executor_is(*self._lives.popleft(), self._time())
            self._advance()

    # Events.

    def _take(self, message: Message[Any]) -> None:
        managed = self._by_done.get(message.stream)
        if managed is not None:
            self._edge_answered(managed, message, self._time(message.stamp))
            return
        self._references.note(message)
        self._receive(message)

    def _receive(self, message: Message[Any]) -> None:
        self._arrive(message, self._time())

    def _arrive(self, message: Message[Any], now: int) -> None:
        for one in self._managed:
            if message.stream in one.inputs:
                self._frame_arrived(one, message, now)

    def _frame_arrived(self, managed: Managed, message: Message[Any], now: int) -> None:
        if message.item is None:
            self._publish(managed.stream, message, None)
            return
        cloud = self._cloud.expected(managed.stream) if self._cloud is not None else None
        link = self._cloud.on_the_way(managed.stream) if self._cloud is not None else 0.0
        profile = self._estimates.profile(managed.profile, managed.open_times, cloud, link)
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

    def _edge_answered(self, managed: Managed, message: Message[Any], now: int) -> None:
        if managed.stream in self._dispatch.down and managed.stream not in self._gone:
            self._executor_is(managed.stream, "serving", now)
        task = self._dispatch.running
        if task is None or task.profile.model != managed.stream:
            return
        frame = self._frames[task.id]
        if frame.header != message.header:
            return
        if isinstance(message.item, MissingFrame):
            self._send_task(task, frame.item)
            return
        self._results[task.id] = message
        self._measure(managed, message, now - self._edge_since)
        self._guarded("finished", task, now)

    def _reserve(self, deadline: int) -> int:
        """Nanoseconds by which a task's relative deadline is shortened."""
        return self._way.reserve(deadline)

    def _measure(self, managed: Managed, answer: Message[Any], taken: int) -> None:
        """Update the estimates with an execution on the edge of `taken` nanoseconds."""
        self._way.travelled(answer, taken)
        self._estimates.edge.observe(managed.stream, self.session.host_seconds(taken))

    def _executor_is(self, model: str, life: Life, now: int) -> None:
        """Handle an executor on the edge that died, is back, or will not come back."""
        down = self._dispatch.down
        if life == "serving":
            if model in down:
                down.discard(model)
                self.alert("executor_back", f"{model} is back on the edge")
                self._again.extend(self._orphans.pop(model, ()))
                self._try_again(now)
            return
        if life == "gone":
            self._gone.add(model)
        if model not in down:
            down.add(model)
            self.alert("executor_lost", f"{model} died on the edge: {life}")
        for orphan in self._orphans.pop(model, ()) if life == "gone" else ():
            self._end(Result(orphan, TaskOutcome.FAILED, TaskPlace.EDGE, now, now))
        running = self._dispatch.running
        if running is not None and running.profile.model == model:
            self._lose(running, "its executor on the edge died", now)

    def _advance(self) -> None:
        """Handle due timers, answers from the cloud, and hanging executions."""
        self._wake_scheduler()
        now = self._time()
        if self._cloud is not None:
            self._hear_from(self._cloud, now)
        running = self._dispatch.running
        if running and now - self._edge_since > self._patience_with(running.profile):
            model = running.profile.model
            self.alert("executor_lost", f"{model} does not answer on the edge")
            self._dispatch.down.add(model)
            self._lose(running, "it did not answer", now)
        elif running is None:
            self._take_turns(now)
            self._require_decisions(now)

    def _take_turns(self, now: int) -> None:
        """On a shared edge: start a task in each turn, and ask for the next while there is one."""
        turns, dispatch = self._turns, self._dispatch
        if turns is None:
            return
        if turns.used:
            turns.release(again=bool(dispatch.undecided))
        if dispatch.undecided:
            turns.ask()
        if turns.granted:
            dispatch.edge_open = True
            self._guarded("offer", now)
            dispatch.edge_open = False
            if dispatch.running is None:
                turns.release()

    def _wake_scheduler(self) -> None:
        """Deliver due timers to the scheduler before later events."""
        while self._timers and self._timers[0] <= self._time():
            self._way.delayed(self._now - heapq.heappop(self._timers))
            self._guarded("timer", self._now)

    def _patience_with(self, profile: Profile) -> int:
        """Timeout of an execution on the edge, nanoseconds."""
        return max(_EDGE_PATIENCE * profile.edge_time, _LEAST_PATIENCE)

    def _hear_from(self, cloud: ExecutorPool, now: int) -> None:
        answers = list(cloud.answers(now))
        cloud.probe(now)
        # First, so that no task is retried in a cloud that is gone.
        slots, before = cloud.slots, self._dispatch.resources.cloud_slots
        if slots != before:
            if not slots:
                self.alert("cloud_lost", "the cloud is gone; work stays on the edge meanwhile")
            elif slots < before:
                self.alert("cloud_lost", f"a part of the cloud is gone; {slots} slots are left")
            else:
                self.alert("cloud_back", "the cloud answers again")
            self._guarded("change_resources", replace(self._resources, cloud_slots=slots), now)
        for answer in answers:
            self._cloud_answered(answer, now)

    def _cloud_answered(self, answer: RemoteResult, now: int) -> None:
        task = answer.task
        if answer.way:
            self._why[task.id] = answer.way
        if answer.figures is not None:
            self._figures[task.id] = answer.figures
        if answer.lost:
            self._lose(task, answer.error, now)
        elif answer.timed_out:
            self._why[task.id] = answer.error
            self._guarded("finished", task, now, TaskOutcome.TIMEOUT)
        elif answer.message is None:
            self._why[task.id] = answer.error
            if answer.error not in self._complaints:
                self._complaints.append(answer.error)
                self.alert("cloud_failed", f"{task.profile.model} {answer.way}: {answer.error}")
            self._guarded("finished", task, now, TaskOutcome.FAILED)
        else:
            self._results[task.id] = answer.message
            self._guarded("finished", task, now)

    def _require_decisions(self, now: int) -> None:
        if self._turns is not None:
            # It decides in its turns, and those that wait for one grow old meanwhile.
            return
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
        self._try_again(now)

    def _replace(self, why: str, now: int) -> None:
        name = type(self._dispatch.scheduler).__name__
        if self._replaced:
            self.alert("scheduler_failed", f"{name}: {why}")
            return
        self._replaced = True
        self.alert("scheduler_failed", f"{name}: {why}; going on with edge-first EDF")
        self._dispatch.replace(EdgeCloudEdf(), now)

    # Tasks whose executor dies.

    def _lose(self, task: Task, why: str, now: int) -> None:
        self._lost.add(task.id)
        self._why[task.id] = why
        self._guarded("finished", task, now, TaskOutcome.FAILED)

    def _retried(self, task: Task, now: int) -> bool:
        """Keep a lost task for a second try and return True, if its deadline allows one."""
        profile, resources = task.profile, self._dispatch.resources
        room = task.deadline - now
        if task.id in self._second:
            return False
        down = profile.model in self._dispatch.down
        cloud = resources.cloud_slots and profile.cloud_gain > 0 and profile.cloud_time <= room
        if cloud or (profile.edge_time <= room and not down):
            self._again.append(task)
            return True
        if profile.edge_time <= room and profile.model not in self._gone:
            self._orphans.setdefault(profile.model, []).append(task)
            return True
        return False

    def _try_again(self, now: int) -> None:
        """Pass lost tasks to the scheduler again, as new ones with their old deadline."""
        while self._again:
            lost = self._again.popleft()
            why = self._why.pop(lost.id, "")
            if lost.deadline < now:
                self._end(Result(lost, TaskOutcome.FAILED, TaskPlace.NOWHERE, now, now))
                continue
            task = replace(lost, id=next(self._numbers))
            self._frames[task.id] = self._frames.pop(lost.id)
            self._second.add(task.id)
            self._counts.retried += 1
            self._log.note(task, "retry", why, now)
            self._guarded("arrived", task, now)

    # Host interface of `Dispatch`.

    def run_edge(self, task: Task, now: int) -> None:
        """Send a task to its analysis' executor on the edge."""
        self._edge_since = now
        if self._turns is not None:
            self._dispatch.edge_open, self._turns.used = False, True
        self._send_task(task, self._references.item(self._frames[task.id]))

    def _send_task(self, task: Task, item: object) -> None:
        frame = self._frames[task.id]
        self._carried += isinstance(item, Frame)
        self._tasks[task.profile.model].derive(item, frame, host_time_ns(), frame.stamp)

    def run_cloud(self, task: Task, now: int) -> None:
        """Send a task to the cloud."""
        if self._cloud is not None:
            left = self.session.host_seconds(task.deadline + task.reserve - now)
            self._cloud.send(task, self._frames[task.id], now, left)

    def wake_at(self, at: int) -> None:
        """Store a time at which the scheduler is to be woken."""
        heapq.heappush(self._timers, at)

    def decided(self, decision: RunOnEdge | SendToCloud | Drop, now: int) -> None:
        """Publish a decision with its reason."""
        task = decision.task
        if isinstance(decision, Drop):
            self._why[task.id] = decision.reason
            self._log.note(task, "drop", decision.reason, now)
        else:
            action = "edge" if isinstance(decision, RunOnEdge) else "cloud"
            self._log.note(task, action, decision.reason, now)

    def closed(self, result: Result) -> None:
        """Publish a task's result if in time, or retry a lost task."""
        lost = result.task.id in self._lost
        self._lost.discard(result.task.id)
        if not (lost and self._retried(result.task, result.finished)):
            self._end(result)

    def _end(self, result: Result) -> None:
        task = result.task
        frame = self._frames.pop(task.id)
        answer = self._results.pop(task.id, None)
        self._second.discard(task.id)
        in_time = result.outcome is TaskOutcome.DONE
        origin = answer if answer is not None else frame
        self._publish(task.profile.model, origin, origin.item if answer and in_time else None)
        self._counts.ended(result)
        why = self._why.pop(task.id, None)
        figures = self._figures.pop(task.id, None)
        if result.outcome is not TaskOutcome.DROPPED:
            reason = f"{result.place.value}: {why}" if why else result.place.value
        elif why is None:
            reason = "no room in the cloud in time"
        else:
            return
        totals = {"utility": result.utility, **self._counts.totals, **(figures or {})}
        self._log.note(task, result.outcome.value, reason, result.finished, totals)

    def _publish(self, node: str, origin: Message[Any], item: Any) -> None:  # noqa: ANN401
        if item is not None:
            complain = partial(self._complain, node)
            self._triggers[node].fire(item, origin, self._stamp(origin), complain)
        if item is not None or self.answers_always:
            self._answers[node].derive(item, origin, host_time_ns(), self._answered_at(origin))
        if node in self._acks:
            done = ((origin.header.source, origin.header.stamp),)
            self._acks[node].derive(done, origin, host_time_ns(), origin.stamp)

    def _complain(self, node: str, error: Exception) -> None:
        self.alert("analysis_failed", f"{node}: {failure_line(error)}")

    def _answered_at(self, origin: Message[Any]) -> int:
        """Mission time of an answer: that of the execution's own, or of the frame."""
        return origin.stamp

    def _stamp(self, origin: Message[Any]) -> int:
        """Mission time of what follows from `origin`: now."""
        del origin
        return self.clock.now()

    def _time(self, stamp: int = 0) -> int:
        """Advance to the present time and return it; `stamp` is that of a received message."""
        del stamp
        self._now = max(self._now, self.clock.now())
        return self._now

    def _patience(self) -> float:
        """Wall seconds to wait for messages: until the next timer, but not long."""
        if self._timers:
            return min(0.2, max(0.0, self.session.host_seconds(self._timers[0] - self._time())))
        return 0.2

    def _close(self) -> None:
        if self._liveness_monitor is not None:
            self._liveness_monitor.end()
        if self._cloud is not None:
            self._cloud.finish(_LAST_ANSWERS)
        if self._turns is not None:
            self._turns.close()
        self._dispatch.close()

    def _values(self) -> dict[str, Any]:
        return {
            **self._counts.values(),
            "scheduler": type(self._dispatch.scheduler).__name__,
            "replaced": self._replaced,
            "edge_down": sorted(self._dispatch.down),
            "frames_carried": self._carried,
            "cloud_slots": self._dispatch.resources.cloud_slots,
            "reserve_ms": self._way.reserve(1 << 62) / 1e6,
            "sites": self._cloud.values() if self._cloud is not None else {},
        }
