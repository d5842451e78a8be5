"""Published decisions of the dispatcher's scheduler with their reasons, and totals."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Any

from aerodaas.clock import host_time_ns
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Header
from aerodaas.messages.mission import Decision
from aerodaas.runtime.node import Outlet
from aerodaas.runtime.stream_names import DECISIONS
from aerodaas.schedulers.analytics.base import MILLISECOND, Result, Task, TaskOutcome
from aerodaas.schedulers.analytics.windows import QoeWindows

__all__ = ["Counts", "DecisionLog"]


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
