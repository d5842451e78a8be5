"""Dispatcher in simulated time: executions take no time, or the laboratory's.

Where the environment gives execution times, the result of a task is published when its simulated
execution is over, on the edge or in a simulated cloud behind a simulated network. So a scheduler
meets in flight what it meets in the laboratory, and the drone flies by results as old as they
would be. The analyses themselves run at once, each in its own node.
"""

from __future__ import annotations

import heapq
import itertools
import random
from collections import defaultdict, deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from aerodaas.clock import NANOSECONDS
from aerodaas.config.model import SimulationConfig
from aerodaas.messages.envelope import Message
from aerodaas.runtime.dispatch.dispatcher import Dispatcher, Managed
from aerodaas.runtime.node import NEVER
from aerodaas.runtime.session import Session
from aerodaas.schedulers.analytics.base import AnalyticsScheduler, Resources, Task, TaskOutcome

if TYPE_CHECKING:
    from aerodaas.schedulers.lab.network import ExecutionTimes, Network

__all__ = ["Executions", "SimulatedDispatcher"]


@dataclass(frozen=True)
class Executions:
    """Execution times and a network of the laboratory, around the times that a task is told.

    A draw depends on the seed, the analysis and the frame alone: all schedulers meet the same
    ones, in flight as in the laboratory.
    """

    times: ExecutionTimes
    network: Network
    seed: int

    @classmethod
    def of(cls, simulation: SimulationConfig) -> Executions | None:
        """Executions of an environment; None where executions take no mission time.

        Raises SchedulerError or UnknownIdError for times and networks that there are not.
        """
        if simulation.execution_times is None:
            return None
        # Few flights simulate executions, and the laboratory takes long to load.
        from aerodaas.schedulers.lab.network import ExecutionTimes, Network  # noqa: PLC0415

        period = round(simulation.network_period * NANOSECONDS)
        return cls(
            ExecutionTimes.named(simulation.execution_times),
            Network.named(simulation.network, period),
            simulation.seed,
        )

    def edge_time(self, task: Task) -> int:
        """Nanoseconds on the edge."""
        return self._drawn(task, task.profile.edge_time, "edge")

    def cloud_time(self, task: Task) -> int:
        """Nanoseconds in the cloud, before what the network adds."""
        return self._drawn(task, task.profile.cloud_time, "cloud")

    def _drawn(self, task: Task, nominal: int, place: Literal["edge", "cloud"]) -> int:
        name = f"{self.seed}/{task.profile.model}/{task.source}/{task.segment}/{place}"
        (factor,) = self.times.factors(1, random.Random(name))
        return int(nominal * factor) or 1


_END, _LOSS, _TIMER = range(3)


@dataclass(order=True, frozen=True)
class _Event:
    """End of an execution, or a timer; of one moment, ends come first, as in the laboratory."""

    at: int
    kind: int
    number: int
    task: Task | None = None


class SimulatedDispatcher(Dispatcher):
    """Dispatcher whose executions are events of simulated time."""

    def __init__(
        self,
        session: Session,
        scheduler: AnalyticsScheduler,
        managed: tuple[Managed, ...],
        resources: Resources,
    ) -> None:
        """Create the dispatcher; parameters as in the base."""
        super().__init__(session, scheduler, managed, resources)
        # Mission time waits for a scheduler, so that no answer is slow and runs are repeatable.
        self._dispatch.hurried = False
        self._executions = Executions.of(session.environment.simulation)
        self._events: list[_Event] = []
        self._order = itertools.count()
        self._running: defaultdict[str, deque[Task]] = defaultdict(deque)
        """Tasks that an analysis has not answered yet, by model; it answers in their order."""
        self._failed: set[int] = set()

    @property
    def due(self) -> int:
        """Mission time of the next end of an execution, or timer."""
        return self._events[0].at if self._events else NEVER

    @property
    def executing(self) -> bool:
        """Whether an execution has not ended yet."""
        return self._dispatch.running is not None or self._dispatch.in_cloud > 0

    def step(self, now: int, inputs: Sequence[Message[Any]]) -> Sequence[Message[Any]]:
        """Handle answers, then what is due, then frames.

        Args:
            now: Mission clock, nanoseconds.
            inputs: New messages, each stream's in order.
        """
        frames = []
        for message in inputs:
            if message.stream in self._by_done:
                self._answered(message, now)
            else:
                frames.append(message)
        while self._events and self._events[0].at <= now:
            self._handle(heapq.heappop(self._events))
        for message in sorted(frames, key=lambda frame: (frame.stamp, frame.stream, frame.seq)):
            for managed in self.managed:
                if message.stream in managed.inputs:
                    self._frame_arrived(managed, message, now)
        if self._dispatch.running is None:
            self._require_decisions(now)
        return self._published()

    def _answered(self, message: Message[Any], now: int) -> None:
        model = self._by_done[message.stream].stream
        task = self._running[model].popleft()
        self._results[task.id] = message
        if self._executions is None:
            self._guarded("finished", task, now)

    def _handle(self, event: _Event) -> None:
        task = event.task
        if task is None:
            self._guarded("timer", event.at)
        elif event.kind == _LOSS:
            self._reasons[task.id] = "lost in the simulated network"
            self._guarded("finished", task, event.at, TaskOutcome.TIMEOUT)
        elif task.id in self._failed:
            self._failed.discard(task.id)
            self._guarded("finished", task, event.at, TaskOutcome.FAILED)
        else:
            self._guarded("finished", task, event.at)

    def _add(self, at: int, kind: int, task: Task | None = None) -> None:
        heapq.heappush(self._events, _Event(at, kind, next(self._order), task))

    def run_edge(self, task: Task, now: int) -> None:
        """Start a task, which ends after its time on the edge."""
        ends = None if self._executions is None else now + self._executions.edge_time(task)
        self._run(task, ends)

    def run_cloud(self, task: Task, now: int) -> None:
        """Start a task, which ends after its time in the cloud, or is lost on the way."""
        executions = self._executions
        assert executions is not None  # noqa: S101 - else there is no cloud slot
        taken = executions.network.cloud_time(executions.cloud_time(task), now)
        timeout = self._resources.cloud_timeout
        if not self._by_stream[task.profile.model].offloadable:
            self._failed.add(task.id)
            self._reasons[task.id] = "nothing in the cloud runs it"
            self._add(now, _END, task)
        elif taken is None or taken > timeout:
            self._add(now + timeout, _LOSS, task)
        else:
            self._reasons[task.id] = "simulated"
            self._run(task, now + taken)

    def wake_at(self, at: int) -> None:
        """Add a time at which the scheduler is to be woken."""
        self._add(at, _TIMER)

    def _run(self, task: Task, ends: int | None) -> None:
        self._running[task.profile.model].append(task)
        self._send_task(task, self._frames[task.id].item)
        if ends is not None:
            self._add(ends, _END, task)

    def _stamp(self, answer: Message[Any]) -> int:
        """Mission time of a published result: now, when its execution is over."""
        del answer
        return self.host.now()
