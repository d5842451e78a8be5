"""A drone in flight on an edge-cloud, something that goes wrong, and what became of every task."""

from __future__ import annotations

import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import psutil
from flying import FLAT, Flyer, hop, robot
from glances import Glance

from aerodaas import Environment
from aerodaas.actors.run.flight import Flight
from aerodaas.environment.run import Run
from aerodaas.recording.reader import Recording
from aerodaas.recording.report.flight import RecordedFlight
from tools.namespaces import EdgeCloud

__all__ = ["Watched", "eventually"]

RATE = 5.0
NAMES = ("drone/glance", "drone/gaze")
ENDS = {"done", "late", "failed", "timeout", "drop", "dropped"}
_CAMERA = {"id": "camera", "type": "camera", "driver": "glances:NoiseCamera", "rate": RATE}
_TASK = {"benefit": 10, "deadline": 900, "edge_time": 120, "cloud_time": 150, "cloud_cost": 1}
ENVIRONMENT: dict[str, Any] = {
    **FLAT,
    "robots": [robot(sensors=[_CAMERA, {"id": "odom", "type": "odometry", "rate": 10}])],
    "compute": [{"id": "edge", "kind": "edge"}, {"id": "cloud", "kind": "cloud", "executors": 4}],
    "schedulers": {"analytics": "ec_edf", "tasks": {"glance": _TASK, "gaze": _TASK}},
    "recording": {"images": "none"},
}


def eventually(condition: Callable[[], bool], seconds: float = 60.0) -> None:
    """Wait until `condition` holds."""
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "it never happened"
        time.sleep(0.1)


@dataclass
class Watched:
    """One flight: the drone hovers while two analyses of five frames a second go on."""

    flyer: Flyer
    cluster: EdgeCloud
    content: dict[str, Any] = field(default_factory=lambda: ENVIRONMENT)
    run: Run = field(init=False)
    broken_at: float = field(default=0.0, init=False)
    """Mission seconds at which something was broken."""

    @property
    def stop(self) -> Path:
        """While this file exists, analyses on the edge hang."""
        return self.flyer.folder / "stop"

    def _build(self, env: Environment) -> None:
        drone = env.get_robot_by_id("drone")
        frames = drone.get_sensor_by_id("camera").get_data_stream()
        for name in ("glance", "gaze"):
            work = Glance(name, self.stop).deploy(env.get_compute_resource_by_id("edge"))
            work.analyse(frames)
        drone.navigate(hop((3, 0), hover=900))

    @contextmanager
    def flying(self, settle: float = 4.0) -> Iterator[Watched]:
        """Be in the air, with analyses going on here and there; land when left."""
        options = {"speed": 1.0, "simulated_time": False, "address": self.cluster.address}
        with self.flyer.flying(self._build, self.content, **options) as env:
            self.run = env.launch()
            eventually(lambda: self.done() > 0 and self.height() > 1.5)
            time.sleep(settle)
            yield self
            env.get_robot_by_id("drone").end_mission()

    def broke(self) -> None:
        """Something has been broken just now."""
        self.broken_at = self.now()

    def now(self) -> float:
        """Mission seconds."""
        return self.run.poll().robots["drone"].mission.stamp / 1e9

    def height(self) -> float:
        """Metres up."""
        state = self.run.poll().robots["drone"].vehicle
        return float(state.odometry.position[2]) if state is not None else 0.0

    def outcomes(self) -> dict[str, int]:
        """What became of the tasks so far, by the dispatcher's own count."""
        report = self.run.poll().reports["dispatcher"]
        return dict(report.values.get("outcomes", {}))

    def done(self) -> int:
        """Tasks done in time so far."""
        return self.outcomes().get("done", 0)

    def goes_on(self, tasks: int = 10) -> None:
        """Wait until so many more tasks are done in time."""
        before = self.done()
        eventually(lambda: self.done() >= before + tasks or self.done() < before)
        before = min(before, self.done())
        eventually(lambda: self.done() >= before + tasks)

    def process(self, actor: str) -> psutil.Process:
        """The process of an actor on the edge."""
        assert isinstance(self.run._flight, Flight)
        return self.cluster.edge.find(self.run._flight.infos()[actor].pid)


@dataclass
class Told:
    """What the recordings of a flight tell."""

    flight: RecordedFlight
    ends: dict[str, list[tuple[float, str, str]]]
    """Mission seconds, outcome and reason of each end, by task."""
    sent: dict[str, float]
    """Mission seconds at which each task that went to the cloud was first sent there."""

    @classmethod
    def of(cls, watched: Watched) -> Told:
        """Read the recording."""
        path = watched.run.recording
        assert path is not None
        ends: dict[str, list[tuple[float, str, str]]] = defaultdict(list)
        sent: dict[str, float] = {}
        with Recording.open(path) as recording:
            flight = RecordedFlight.read(recording)
            for record in recording.records(schemas={"aerodaas.Decision"}):
                value = record.value
                if value.action == "cloud":
                    sent.setdefault(value.task, value.stamp / 1e9)
                if value.action in ENDS:
                    end = (value.stamp / 1e9, value.action, value.reason)
                    ends[value.task].append(end)
        return cls(flight, dict(ends), sent)

    def alerts(self, kind: str) -> list[str]:
        """Texts of the alerts of this kind."""
        return [text for _, one, text in self.flight.alerts if one == kind]

    def safe(self) -> None:
        """The drone stayed where it hovered until it was told to land, and landed."""
        drone = self.flight.robots["drone"]
        assert drone.outcome.startswith("landed"), drone.outcome
        assert drone.position[-1, 2] < 0.2
        states = [band.state for band in drone.bands]
        assert states[-2:] == ["landing", "landed"], states
        landing = drone.bands[-2].start
        there = next(
            t for t, place in zip(drone.time, drone.position, strict=True) if place[2] > 1.8
        )
        hover = drone.position[(drone.time > there + 3.0) & (drone.time < landing)]
        assert abs(hover[:, 2] - 2.0).max() < 0.7

    def each_counted_once(self) -> None:
        """No task ended twice, and between the first and the last none is missing."""
        assert self.ends
        twice = {task: ends for task, ends in self.ends.items() if len(ends) > 1}
        assert not twice
        missing = self.missing()
        assert not missing, missing

    def missing(self) -> list[str]:
        """Tasks of which nobody has told an end, the last second's aside."""
        numbers: dict[str, set[int]] = defaultdict(set)
        for task in self.ends:
            name, _, number = task.rpartition("#")
            numbers[name].add(int(number))
        return [
            f"{name}#{number}"
            for name, known in numbers.items()
            for number in range(min(known), max(known) - int(RATE))
            if number not in known
        ]

    def sent_to_cloud(self, begin: float, end: float) -> list[str]:
        """Tasks sent to the cloud between these mission seconds, and ended since.

        What was decided for the cloud, but not sent because it had to be late, is none.
        """
        kept = "too late"
        return [
            one
            for one, at in self.sent.items()
            if begin < at < end and one in self.ends and kept not in self.ends[one][-1][2]
        ]

    def recovery(self, after: float, where: str = "") -> float:
        """Seconds from `after` to the next result in time (of `where`) of a later frame."""
        times = [
            t
            for ends in self.ends.values()
            for t, end, why in ends
            if end == "done" and t > after and why.startswith(where)
        ]
        return min(times) - after if times else float("inf")

    def longest_gap(self, after: float) -> float:
        """Longest stretch of seconds from `after` on without a result in time."""
        done = sorted(t for ends in self.ends.values() for t, end, _ in ends if end == "done")
        times = [after, *(t for t in done if t > after)]
        return max((late - early for early, late in pairwise(times)), default=float("inf"))

    def summary(self) -> str:
        """What became of all tasks, and why some failed."""
        counts = Counter(
            f"failed ({why})" if end == "failed" else end
            for ends in self.ends.values()
            for _, end, why in ends
        )
        return ", ".join(f"{count} {end}" for end, count in sorted(counts.items()))
