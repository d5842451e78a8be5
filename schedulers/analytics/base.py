"""The plug-in protocol of analytics schedulers: which inference runs where, and when.

A scheduler is a pure class. It is told what happened and what time it is, and answers with
decisions; it never sleeps, reads a clock, draws unseeded random numbers or touches an executor.
The lab drives it with simulated time and the dispatcher with the mission's, through the same
`Dispatch`, so what was studied is what flies. A whole scheduler::

    class ShortestFirst(AnalyticsScheduler):
        def __init__(self):
            self.waiting = []

        def task_arrived(self, task, now):
            self.waiting.append(task)
            return ()

        def executor_idle(self, now):
            self.waiting.sort(key=lambda task: task.profile.edge_time)
            task = self.waiting.pop(0)
            if now + task.profile.edge_time <= task.deadline:
                return [RunOnEdge(task)]
            return [Drop(task, "cannot finish in time")]

Every stamp and duration is an integer of nanoseconds, as on the mission clock.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Iterable
from dataclasses import dataclass, field

from aerodaas.clock import NANOSECONDS
from aerodaas.errors import SchedulerError

__all__ = [
    "MIGRATED",
    "MILLISECOND",
    "STOLEN",
    "AnalyticsScheduler",
    "Decision",
    "Drop",
    "Profile",
    "QoeGoal",
    "Resources",
    "Result",
    "RunOnEdge",
    "SendToCloud",
    "Task",
    "TaskOutcome",
    "TaskPlace",
    "WakeAt",
]

MILLISECOND = 1_000_000
"""Nanoseconds in a millisecond."""
MIGRATED = "migrated from the edge queue"
"""Reason of sending or dropping a task that had been queued for the edge; counted by the lab."""
STOLEN = "stolen back from the cloud"
"""Reason of running a task on the edge that had been bound for the cloud; counted by the lab."""


@dataclass(frozen=True, slots=True)
class QoeGoal:
    """A bonus for a tumbling window in which enough of a model's tasks finish in time."""

    bonus: float
    share: float = 0.9
    """On-time tasks over all tasks that arrived in the window, 0 to 1."""
    window: int = 20 * NANOSECONDS
    """Length of the windows, which start at multiples of it."""


@dataclass(frozen=True, slots=True)
class Profile:
    """The scheduler's knowledge of a model. Raises SchedulerError for senseless values."""

    model: str
    benefit: float
    """Worth of a result in time; costs and gains are in the same unit."""
    deadline: int
    """From a task's arrival at the edge."""
    edge_time: int
    """Expected time of one execution on the edge."""
    cloud_time: int
    """Expected time from sending a task to the cloud until its result is back."""
    edge_cost: float = 0.0
    cloud_cost: float = 0.0
    qoe: QoeGoal | None = None
    urgent: bool = True
    """False where a result a little after the deadline is still of use (the Kalmia variant)."""
    tenant: str = ""
    """Whose share of edge and cloud it uses; see `SfqDems`."""
    weight: float = 1.0
    """The tenant's weight, the same in all of its profiles."""
    edge_gain: float = field(init=False)
    """Gain of finishing in time on the edge: benefit less cost."""
    cloud_gain: float = field(init=False)
    """Gain of finishing in time in the cloud."""

    def __post_init__(self) -> None:
        """Derive the gains; refuse figures that no scheduler could work with."""
        object.__setattr__(self, "edge_gain", self.benefit - self.edge_cost)
        object.__setattr__(self, "cloud_gain", self.benefit - self.cloud_cost)
        for name in ("deadline", "edge_time", "cloud_time", "weight"):
            if not 0 < getattr(self, name) < math.inf:
                raise SchedulerError(
                    f"model {self.model!r}: {name} must be positive, not {getattr(self, name)}"
                )
        for name in ("edge_cost", "cloud_cost"):
            if not 0 <= getattr(self, name) < math.inf:
                raise SchedulerError(
                    f"model {self.model!r}: {name} must not be negative, not {getattr(self, name)}"
                )
        if not max(self.edge_gain, self.cloud_gain) > 0:
            raise SchedulerError(
                f"model {self.model!r} costs at least its benefit of {self.benefit} on the edge "
                "and in the cloud, so it would never run; raise the benefit or remove the model"
            )


@dataclass(slots=True, eq=False)
class Task:
    """One inference to be done; schedulers read it and never change it."""

    id: int
    """Unique within one scheduler's life."""
    profile: Profile
    arrival: int
    deadline: int
    """Absolute, on the same clock as `arrival`."""
    source: str = ""
    """Whose data it is: a drone, a stream."""
    segment: int = 0
    """Number of the frame or segment of video."""
    reserve: int = 0
    """What the way to an executor and back may take. A scheduler plans for `deadline`; a result
    is judged by `deadline + reserve`."""


class TaskPlace(str, enum.Enum):
    """Where a task ran."""

    EDGE = "edge"
    CLOUD = "cloud"
    NOWHERE = "nowhere"


class TaskOutcome(str, enum.Enum):
    """How a task ended."""

    DONE = "done"
    """Finished by its deadline."""
    LATE = "late"
    """Finished after its deadline."""
    TIMEOUT = "timeout"
    """The cloud did not answer within its time-out."""
    FAILED = "failed"
    """Its executor died or raised."""
    DROPPED = "dropped"
    """Never started."""


@dataclass(slots=True, eq=False)
class Result:
    """The end of one task."""

    task: Task
    outcome: TaskOutcome
    place: TaskPlace
    started: int
    """When its execution began; for a task never started, when it was given up."""
    finished: int

    @property
    def utility(self) -> float:
        """QoS utility: the gain if in time, minus the cost if it ran in vain, 0 if it never ran."""
        profile = self.task.profile
        in_time = self.outcome is TaskOutcome.DONE
        if self.place is TaskPlace.CLOUD:
            return profile.cloud_gain if in_time else -profile.cloud_cost
        if self.place is TaskPlace.EDGE:
            return profile.edge_gain if in_time else -profile.edge_cost
        return 0.0


@dataclass(frozen=True, slots=True)
class Resources:
    """Resources of a scheduler: one serial edge executor and a cloud of many slots."""

    cloud_slots: int = 32
    """Executions that may be in the cloud at once; 0 without a cloud."""
    cloud_timeout: int = 10 * NANOSECONDS
    """After which an execution in the cloud counts as lost and frees its slot."""

    def __post_init__(self) -> None:
        """Refuse a negative number of slots or a time-out of nothing."""
        if self.cloud_slots < 0 or self.cloud_timeout <= 0:
            raise SchedulerError(
                "resources need cloud_slots >= 0 and a positive cloud_timeout, not "
                f"{self.cloud_slots} and {self.cloud_timeout}"
            )


@dataclass(slots=True)
class RunOnEdge:
    """Start `task` on the edge now; only while the executor is idle."""

    task: Task
    reason: str = ""


@dataclass(slots=True)
class SendToCloud:
    """Hand `task` to the cloud's queue, which starts tasks first come, first served."""

    task: Task
    reason: str = ""
    latest_start: int | None = None
    """If no slot is free by then, the task is dropped and reported as finished so."""


@dataclass(slots=True)
class Drop:
    """Give `task` up."""

    task: Task
    reason: str = ""


@dataclass(slots=True)
class WakeAt:
    """Call `timer` at this time, which must not lie in the past; any number may be pending."""

    at: int


Decision = RunOnEdge | SendToCloud | Drop | WakeAt


class AnalyticsScheduler:
    """Base of every scheduler: override the events that matter.

    An instance is a recipe: each edge and each run gets a deep copy, then one `start`. Each
    event returns decisions (a list, or a generator that yields them). Every task that arrived
    must be run, sent or dropped exactly once.
    """

    resources: Resources = Resources()
    learns: frozenset[str] = frozenset()
    """Times of a profile, `edge_time` or `cloud_time`, that it learns from results by itself.

    In flight, those that it does not learn follow what is measured, where the user told none.
    """

    def start(self, resources: Resources, now: int) -> None:  # noqa: ARG002 - for overriding
        """Begin a run; tasks follow.

        Args:
            resources: The edge executor and the cloud of the run.
            now: Time of the event, nanoseconds.
        """
        self.resources = resources

    def task_arrived(self, task: Task, now: int) -> Iterable[Decision]:
        """Take note of a new task, or decide at once.

        Args:
            task: The task that has arrived.
            now: Time of the event, nanoseconds.
        """
        raise NotImplementedError

    def executor_idle(self, now: int) -> Iterable[Decision]:  # noqa: ARG002 - for overriding
        """Choose the next task of the idle edge executor, if any.

        Called after each event that leaves the executor idle while undecided tasks exist, and
        again for as long as the answer drops or sends tasks without starting one.
        """
        return ()

    def task_finished(self, result: Result, now: int) -> Iterable[Decision]:  # noqa: ARG002
        """Learn how a task ended; not called for tasks that the scheduler itself dropped.

        Args:
            result: The task, where it ran, and how it ended.
            now: Time of the event, nanoseconds.
        """
        return ()

    def timer(self, now: int) -> Iterable[Decision]:  # noqa: ARG002 - for overriding
        """Act at a time asked for with `WakeAt`."""
        return ()

    def resources_changed(
        self,
        resources: Resources,
        now: int,  # noqa: ARG002 - for overriding
    ) -> Iterable[Decision]:
        """The cloud is gone (no slots) or back; only in flight.

        Args:
            resources: The resources from now on.
            now: Time of the event, nanoseconds.
        """
        self.resources = resources
        return ()
