"""Workloads from a JSON file: models of one's own, fleets, or tasks listed one by one.

::

    {"name": "patrol", "drones": 5, "edges": 2, "period_s": 0.5,
     "models": {"HV": "published",
                "fire": {"benefit": 80, "deadline_ms": 600, "edge_ms": 90, "cloud_ms": 210,
                         "edge_cost": 1, "cloud_cost": 12, "qoe_bonus": 50}}}

With `"tasks": [{"at_s": 0.2, "model": "fire", "source": "drone1", "edge": 0}, ...]` the listed
tasks replace the drones; one taken from a recorded flight may carry `edge_ms` and `cloud_ms`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from aerodaas.clock import NANOSECONDS
from aerodaas.errors import SchedulerError
from aerodaas.schedulers.analytics.base import MILLISECOND, Profile, QoeGoal
from aerodaas.schedulers.analytics.published.profiles import PUBLISHED
from aerodaas.schedulers.lab.workload import Arrival, Workload

__all__ = ["load_workload"]

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
            Arrival(
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
