"""Workloads: which tasks arrive at which edge, and when.

A JSON file has models of one's own, fleets, or tasks listed one by one:

::

    {"name": "patrol", "drones": 5, "edges": 2, "period_s": 0.5,
     "models": {"HV": "published",
                "fire": {"benefit": 80, "deadline_ms": 600, "edge_ms": 90, "cloud_ms": 210,
                         "edge_cost": 1, "cloud_cost": 12, "qoe_bonus": 50}}}

With `"tasks": [{"at_s": 0.2, "model": "fire", "source": "drone1", "edge": 0}, ...]` the listed
tasks replace the drones; one taken from a recorded flight may carry `edge_ms` and `cloud_ms`.
"""

from __future__ import annotations

import random
import re
from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import count
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from aerodaas.clock import NANOSECONDS
from aerodaas.errors import SchedulerError, UnknownIdError
from aerodaas.schedulers.analytics.base import MILLISECOND, Profile, QoeGoal, Task
from aerodaas.schedulers.analytics.published.profiles import ACTIVE, PASSIVE, PUBLISHED

__all__ = ["SIX", "Segment", "TaskArrival", "Workload", "load_workload"]

SIX: tuple[str, ...] = ("2D-P", "3D-P", "4D-P", "2D-A", "3D-A", "4D-A")
"""The published workloads: drones on one edge, with four (P) or six (A) models."""

_NAME = re.compile(r"(\d+)D-([PA])(?:/(\d+))?", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class TaskArrival:
    """One task of a workload that lists them, such as one taken from a recorded flight."""

    at: int
    """Nanoseconds from the start."""
    model: str
    source: str = ""
    edge: int = 0
    edge_time: int | None = None
    """Measured on the edge, where it was."""
    cloud_time: int | None = None
    reserve: int = 0
    """As in `Task`."""


class Segment(NamedTuple):
    """A segment of video that a trace tells of."""

    at: int
    """Nanoseconds from the start."""
    source: str = ""
    edge: int = 0


@dataclass(frozen=True, slots=True)
class Workload:
    """Drones that send a segment of video per period to an edge; each makes a task per model.

    Drones are dealt to the edges in turn, each with a phase of its own drawn from the seed;
    models come in random order within a segment. `segments`, where given, take the drones' place,
    up to `duration`; `arrivals`, where given, replaces all of that.
    """

    name: str
    models: Mapping[str, Profile]
    drones: int = 1
    edges: int = 1
    duration: int = 300 * NANOSECONDS
    period: int = NANOSECONDS
    arrivals: tuple[TaskArrival, ...] = field(default=())
    segments: tuple[Segment, ...] = field(default=())

    def __post_init__(self) -> None:
        """Refuse a workload of nothing."""
        if not self.models or min(self.drones, self.edges, self.duration, self.period) <= 0:
            raise SchedulerError(
                f"workload {self.name!r} needs models, drones, edges, a duration and a period"
            )

    @classmethod
    def named(cls, name: str, duration: int = 300 * NANOSECONDS) -> Workload:
        """Make `3D-A` (3 drones, all models), `4D-P` (four models) or `80D-A/7` (over 7 edges).

        Args:
            name: The name, in capitals or small letters.
            duration: Length of the run, nanoseconds.

        Raises:
            UnknownIdError: If it is any other name.
        """
        match = _NAME.fullmatch(name)
        if match is None:
            raise UnknownIdError("workload", name, [*SIX, "80D-A/7", "a JSON file"])
        drones, kind, edges = match.groups()
        models = PASSIVE if kind.upper() == "P" else ACTIVE
        return cls(
            name.upper(),
            {model: PUBLISHED[model] for model in models},
            int(drones),
            int(edges or 1),
            duration,
        )

    def on_edges(self, edges: int) -> Workload:
        """Copy of the workload on so many edges, each with as many drones as an edge has here.

        Raises SchedulerError for a workload that lists its tasks, which are its edges' own.
        """
        if self.is_listed:
            raise SchedulerError(f"{self.name} lists its tasks, so its edges are its own")
        name = f"{self.name} on {edges} edges"
        return replace(self, name=name, drones=self.drones * edges // self.edges, edges=edges)

    @property
    def is_listed(self) -> bool:
        """Whether tasks or segments are listed, so that drones and edges cannot be changed."""
        return bool(self.arrivals or self.segments)

    def lasting(self, duration: int) -> Workload:
        """Copy of the workload with another duration."""
        return replace(self, duration=duration)

    def tasks(self, edge: int, draw: random.Random) -> list[Task]:
        """The tasks of one edge in order of arrival, numbered from zero.

        Args:
            edge: Number of the edge, from 0.
            draw: Source of randomness for the arrivals.
        """
        if self.arrivals:
            return [
                Task(
                    number,
                    self.models[a.model],
                    a.at,
                    a.at + self.models[a.model].deadline - a.reserve,
                    a.source,
                    reserve=a.reserve,
                )
                for number, a in enumerate(self.arrivals_at(edge))
            ]
        segments = self._traced(edge) if self.segments else self._flown(edge, draw)
        profiles = list(self.models.values())
        tasks: list[Task] = []
        for at, name, segment in segments:
            draw.shuffle(profiles)
            tasks += [
                Task(number, profile, at, at + profile.deadline, name, segment)
                for number, profile in enumerate(profiles, len(tasks))
            ]
        return tasks

    def _flown(self, edge: int, draw: random.Random) -> list[tuple[int, str, int]]:
        """When each segment comes, its source, and its number there; in order."""
        phases = {
            f"drone{drone}": draw.randrange(self.period)
            for drone in range(edge, self.drones, self.edges)
        }
        return sorted(
            (start, name, start // self.period)
            for name, phase in phases.items()
            for start in range(phase, self.duration, self.period)
        )

    def _traced(self, edge: int) -> list[tuple[int, str, int]]:
        """Segments of a trace; in order."""
        numbers = defaultdict[str, Iterator[int]](count)
        return [
            (at, source, next(numbers[source]))
            for at, source, where in sorted(self.segments)
            if where == edge and at < self.duration
        ]

    def arrivals_at(self, edge: int) -> list[TaskArrival]:
        """The listed tasks of one edge, in the order in which `tasks` numbers them."""
        return sorted((a for a in self.arrivals if a.edge == edge), key=lambda a: a.at)


Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Count = Annotated[int, Field(ge=1)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class _Model(_Strict):
    benefit: Positive
    deadline_ms: Positive
    edge_ms: Positive
    cloud_ms: Positive
    edge_cost: NotNegative = 0.0
    cloud_cost: NotNegative = 0.0
    qoe_bonus: NotNegative = 0.0
    qoe_share: Annotated[float, Field(ge=0, le=1)] = 0.9
    qoe_window_s: Positive = 20.0
    urgent: bool = True
    tenant: str = ""
    weight: Positive = 1.0

    def profile(self, name: str) -> Profile:
        goal = QoeGoal(self.qoe_bonus, self.qoe_share, round(self.qoe_window_s * NANOSECONDS))
        return Profile(
            name,
            self.benefit,
            round(self.deadline_ms * MILLISECOND),
            round(self.edge_ms * MILLISECOND),
            round(self.cloud_ms * MILLISECOND),
            self.edge_cost,
            self.cloud_cost,
            goal if self.qoe_bonus else None,
            self.urgent,
            self.tenant,
            self.weight,
        )


class _Task(_Strict):
    at_s: NotNegative
    model: str
    source: str = ""
    edge: Annotated[int, Field(ge=0)] = 0
    edge_ms: Positive | None = None
    cloud_ms: Positive | None = None


class _File(_Strict):
    name: str = "workload"
    drones: Count = 1
    edges: Count = 1
    duration_s: Positive = 300.0
    period_s: Positive = 1.0
    models: dict[str, _Model | Literal["published"]] = Field(min_length=1)
    tasks: list[_Task] = Field(default_factory=list)


def load_workload(path: str | Path) -> Workload:
    """Read a workload; raises SchedulerError that names the file and the place."""
    try:
        found = _File.model_validate_json(Path(path).read_bytes())
    except OSError as error:
        raise SchedulerError(f"cannot read the workload {path}: {error.strerror}") from None
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"]) or "file"
        raise SchedulerError(f"{path}: {place}: {first['msg']}") from None
    models = {name: _profile(name, model, path) for name, model in found.models.items()}
    for task in found.tasks:
        if task.model not in models or task.edge >= found.edges:
            raise SchedulerError(
                f"{path}: the task at {task.at_s} s names model {task.model!r} on edge "
                f"{task.edge}; the file has {', '.join(models)} on {found.edges} edge(s)"
            )
    return Workload(
        found.name,
        models,
        found.drones,
        found.edges,
        round(found.duration_s * NANOSECONDS),
        round(found.period_s * NANOSECONDS),
        tuple(
            TaskArrival(
                round(task.at_s * NANOSECONDS),
                task.model,
                task.source,
                task.edge,
                None if task.edge_ms is None else round(task.edge_ms * MILLISECOND),
                None if task.cloud_ms is None else round(task.cloud_ms * MILLISECOND),
            )
            for task in found.tasks
        ),
    )


def _profile(name: str, model: _Model | Literal["published"], path: str | Path) -> Profile:
    if isinstance(model, _Model):
        return model.profile(name)
    if name not in PUBLISHED:
        raise SchedulerError(
            f"{path}: models.{name}: the published models are {', '.join(PUBLISHED)}"
        )
    return PUBLISHED[name]
