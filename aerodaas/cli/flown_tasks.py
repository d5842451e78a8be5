"""Tasks of a recorded flight: arrival, place of execution, and outcome."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from aerodaas.config.model import EnvironmentConfig, validated
from aerodaas.errors import RecordingError
from aerodaas.messages.mission import Decision
from aerodaas.recording.reader import Recording
from aerodaas.recording.recorded_environment import allowed_content, merged, recorded_content
from aerodaas.schedulers.analytics.base import (
    MILLISECOND,
    Profile,
    Resources,
    TaskOutcome,
    TaskPlace,
)
from aerodaas.schedulers.analytics.published.profiles import told_profile

__all__ = ["Flown", "FlownTask"]

_ENDS = {"drop": TaskOutcome.DROPPED} | {outcome.value: outcome for outcome in TaskOutcome}
_ANSWERED = (TaskOutcome.DONE, TaskOutcome.LATE)
_PLACES = {place.value: place for place in TaskPlace}


@dataclass(slots=True)
class FlownTask:
    """One task of the flight; stamps and durations in nanoseconds."""

    model: str
    source: str
    arrival: int
    number: int
    """Number of its arrival: the tasks of one frame arrive at the same time, but in order."""
    reserve: int
    began: int | None = None
    place: TaskPlace = TaskPlace.NOWHERE
    """Place where its execution began."""
    ended: int = 0
    outcome: TaskOutcome | None = None
    """None if the flight was over before."""
    why: str = ""
    """Reason of the last decision about it."""

    @property
    def took(self) -> int | None:
        """Duration of its execution, if answered."""
        answered = self.outcome in _ANSWERED and self.began is not None
        return self.ended - (self.began or 0) if answered else None

    def note(self, decision: Decision) -> None:
        """Update by a recorded decision or outcome."""
        action, reason = decision.action, decision.reason
        if action in {"edge", "cloud"}:
            self.began, self.place, self.why = decision.stamp, TaskPlace(action), reason
        elif action in _ENDS:
            self.outcome, self.ended = _ENDS[action], decision.stamp
            if action == "drop":
                self.place, self.why = TaskPlace.NOWHERE, reason
            else:
                # A busy recorder may have lost the decision.
                named = reason.partition(":")[0]
                self.place = _PLACES.get(named, TaskPlace.NOWHERE)


@dataclass(frozen=True)
class Flown:
    """Tasks of a recording, with the decisions of its analytics scheduler."""

    name: str
    tasks: list[FlownTask]
    """In order of arrival."""
    models: dict[str, Profile]
    """Their profiles in the environment."""
    resources: Resources

    @classmethod
    def read(cls, path: str | Path) -> Flown:
        """Read a recording.

        Raises RecordingError for one without decisions or without its environment.
        """
        with Recording.open(path) as recording:
            decisions = [r.value for r in recording.records(schemas=["aerodaas.Decision"])]
            tasks = _tasks(one for one in decisions if "waited_ms" in one.values)
            if not tasks:
                raise RecordingError(
                    f"{path} holds no decisions of an analytics scheduler; fly with one, such as "
                    '"schedulers": {"analytics": "dems"} in the environment file'
                )
            content = merged(allowed_content(recorded_content(recording)), {})
            simulated_time = recording.provenance.get("speed") == "max"
        environment = validated(content, f"the environment in {path}")
        told = environment.schedulers
        models = {name: told_profile(name, told) for name in sorted({t.model for t in tasks})}
        return cls(
            Path(path).stem, tasks, models, Resources(_cloud_slots(environment, simulated_time))
        )


def _tasks(decisions: Iterable[Decision]) -> list[FlownTask]:
    found: dict[str, FlownTask] = {}
    for decision in decisions:
        name, figures = decision.task, decision.values
        task = found.get(name)
        if task is None:
            model, _, frame = name.partition("#")
            task = found[name] = FlownTask(
                model,
                frame.rpartition(":")[0],
                decision.stamp - round(figures["waited_ms"] * MILLISECOND),
                int(figures.get("number", 0)),
                round(figures.get("reserve_ms", 0.0) * MILLISECOND),
            )
        task.note(decision)
    return sorted(found.values(), key=lambda task: (task.arrival, task.number))


def _cloud_slots(environment: EnvironmentConfig, simulated_time: bool) -> int:  # noqa: FBT001
    if environment.compute == "auto":
        return Resources().cloud_slots
    clouds = [one for one in environment.compute if one.kind == "cloud"]
    # A simulated cloud was there in simulated time alone.
    return sum(one.executors for one in clouds if simulated_time or not one.simulated)
