"""How surely a fall before the camera is told, and how often one that was none.

python benchmarks/falls.py --lens tello
python benchmarks/falls.py --eyes boxes --falls 100
"""

from __future__ import annotations

import enum
import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from _report import Report
from numpy.typing import NDArray

from aerodaas.analytics.base import ComputeKind, Context
from aerodaas.analytics.detection.detector import OnnxDetector
from aerodaas.analytics.follow.followers import VipFollowAnalytics
from aerodaas.analytics.people.body_pose import BodyPoseEmergencyAnalytics
from aerodaas.analytics.people.pose import PoseAnalytics
from aerodaas.clock import seconds
from aerodaas.geometry.frames import CameraModel, rotation_from_rpy
from aerodaas.messages.detections import Detections
from aerodaas.messages.frames import Header
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.readings import Alert
from aerodaas.messages.vehicle import VehicleState
from aerodaas.simulation.scenario import Scenario
from aerodaas.simulation.world import Thing, World
from tools.tuning.chase import Chase
from tools.tuning.perception import DetectorPerception, Perception, TruthPerception
from tools.tuning.walk import PERSON, walk

TILT = math.radians(12)
STARTS, FALLS, ENDS = 9.0, 14.0, 20.0
"""Seconds: the pose is looked at from the first on, the person falls at the second."""
HEADINGS = {"away": 0.0, "across": 80.0, "towards": 180.0}
"""Degrees from the drone's view to where the head falls."""
UNITS = {"scenes": "", "told": "%", "after": "s, median", "false": "alarms"}


class Lens(str, enum.Enum):
    """What the camera sees, tilted 12 degrees down."""

    TELLO = "tello"
    SIMULATED = "simulated"


LENSES = {
    Lens.TELLO: CameraModel.from_fov(
        640, 480, math.radians(55.2), mount=(0.035, 0.0, 0.0), pitch=TILT
    ),
    Lens.SIMULATED: CameraModel.from_fov(
        640, 360, math.radians(82.6), mount=(0.1, 0.0, 0.08), pitch=TILT
    ),
}


class Eyes(str, enum.Enum):
    """What finds the body: models on renders, or its true box with noise."""

    MODELS = "models"
    BOXES = "boxes"


SEES = {
    Eyes.MODELS: "models look at renders",
    Eyes.BOXES: "true boxes with noise of 3 % and 5 % misses, joints only before the fall",
}


@dataclass(frozen=True)
class Watched:
    """By what a person is watched, and from where."""

    lens: Lens
    eyes: Eyes
    detector: Path | None
    rate: float
    distance: float


@dataclass
class Onlooker:
    """What the analysis asks of its actor."""

    stamp: int = 0
    alerts: list[Alert] = field(default_factory=list)
    kind: ComputeKind = "edge"

    def now(self) -> int:
        """Stamp of the frame."""
        return self.stamp

    def vehicle(self) -> VehicleState | None:
        """Not needed."""
        return None

    def alert(self, alert: Alert) -> None:
        """Keep it."""
        self.alerts.append(alert)


class StandingJoints(TruthPerception):
    """The body's true box with noise; its joints only while it stands, none once it falls."""

    def __init__(self, person: Thing, camera: CameraModel, seed: int) -> None:
        """See `person`."""
        super().__init__(person, "person", camera, seed=seed, noise=0.03, misses=0.05)
        self._person, self._lens = person, camera
        self._jitter = np.random.default_rng(seed)

    def look(
        self, header: Header, pose: Odometry, believed: Odometry, context: Context
    ) -> Detections:
        """Return the box, unless it is missed, with its joints."""
        found = super().look(header, pose, believed, context)
        joints = self._joints(seconds(header.stamp), pose)
        return replace(found, items=tuple(replace(one, keypoints=joints) for one in found))

    def _joints(self, time: float, pose: Odometry) -> NDArray[np.float32]:
        turn = rotation_from_rpy(pose.roll, pose.pitch, pose.yaw)
        places = (self._person.keypoints(time) - pose.position) @ turn
        pixels = np.array([self._lens.project(place) for place in places])
        size = (self._lens.width, self._lens.height)
        inside = ((pixels[:, :2] > 0) & (pixels[:, :2] < size)).all(axis=1) & (pixels[:, 2] > 0)
        if self._person.state(time).posture.fallen > 0:
            inside[:] = False
        noise = 0.02 * np.ptp(pixels[:, 1]) * self._jitter.normal(size=(len(pixels), 2))
        return np.column_stack([pixels[:, :2] + noise, 0.9 * inside]).astype(np.float32)


class Watching:
    """Follows by true boxes, while `eyes` watch the body from `begin` seconds on."""

    def __init__(self, follow_by: TruthPerception, eyes: Perception, begin: float) -> None:
        """Open the analysis."""
        self._follow_by, self._eyes, self._begin = follow_by, eyes, begin
        self._body = BodyPoseEmergencyAnalytics()
        self._body.open()
        self.onlooker = Onlooker()

    def look(
        self, header: Header, pose: Odometry, believed: Odometry, context: Context
    ) -> Detections:
        """Watch the body; return the vest."""
        if seconds(header.stamp) >= self._begin:
            self.onlooker.stamp = header.stamp
            found = self._eyes.look(header, pose, believed, context)
            self._body.process(found, self.onlooker)
        return self._follow_by.look(header, pose, believed, context)


@contextmanager
def eyes_for(watched: Watched, world: World, seed: int) -> Iterator[Perception]:
    """What watches the body in `world`."""
    camera = LENSES[watched.lens]
    if watched.eyes is Eyes.BOXES:
        yield StandingJoints(world.thing(PERSON), camera, seed)
        return
    pose = PoseAnalytics()
    if watched.detector is not None:
        pose = PoseAnalytics(detector=OnnxDetector(watched.detector, classes=["person", "vest"]))
    eyes = DetectorPerception(world, camera, pose)
    try:
        yield eyes
    finally:
        eyes.close()


def alarms(world: World, watched: Watched, seed: int, begin: float, end: float) -> list[float]:
    """Follow the person until `end` seconds; when a fall was told."""
    person, camera = world.thing(PERSON), LENSES[watched.lens]
    follow_by = TruthPerception(person, "vest", camera, seed=seed)
    chase = Chase(person, "vest", watched.rate, camera=camera, seed=seed)
    follow = VipFollowAnalytics(distance=watched.distance)
    with eyes_for(watched, world, seed) as eyes:
        watching = Watching(follow_by, eyes, begin)
        chase.fly(follow, watching, end)
    alerts = watching.onlooker.alerts
    return [seconds(alert.header.stamp) for alert in alerts if alert.kind == "fallen"]


def scene(heading: float, seed: int) -> World:
    """A person who falls before the drone with the head towards `heading` degrees.

    Every other one walks until then, and so do all who fall to their back.
    """
    backwards = seed % 4 >= 2  # noqa: PLR2004 - half of them
    person: dict[str, object] = {
        "kind": "person",
        "id": PERSON,
        "vest": "any",
        "gestures": [{"kind": "fallen", "start": FALLS, "duration": 30, "forward": not backwards}],
    }
    yaw = heading + (180.0 if backwards else 0.0)
    spread = float(np.random.default_rng(seed).uniform(-25, 25))
    if seed % 2 and math.cos(math.radians(yaw)) > 0.5:  # noqa: PLR2004 - about ahead of the drone
        person["motion"] = {"points": [(3, 0), (30, 0)], "speed": 0.6, "start": 6}
    else:
        person |= {"at": (3, 0), "yaw": yaw + spread}
    trees = {"kind": "trees", "id": "wood", "count": 20, "area": (15, -20, 45, 20)}
    return World(Scenario.model_validate({"name": "falls", "entities": [person, trees]}), seed)


def main(
    lens: Annotated[Lens, typer.Option(help="Of the camera.")] = Lens.TELLO,
    falls: Annotated[int, typer.Option(help="In each direction.", min=0)] = 8,
    walks: Annotated[int, typer.Option(help="Without a fall.", min=0)] = 10,
    duration: Annotated[float, typer.Option(help="Seconds of each walk.", min=10)] = 60.0,
    rate: Annotated[float, typer.Option(help="Frames a second.", min=1)] = 5.0,
    distance: Annotated[float, typer.Option(help="Of the drone, metres.", min=1.5)] = 2.0,
    eyes: Annotated[Eyes, typer.Option(help="What finds the body.")] = Eyes.MODELS,
    detector: Annotated[
        Path | None, typer.Option(help="ONNX file of another detector of people and vests.")
    ] = None,
    first_seed: Annotated[int, typer.Option(help="Of the scenes.", min=0)] = 0,
    json: Annotated[Path | None, typer.Option(help="Write the figures to this file.")] = None,
) -> None:
    """Follow people who fall, and people who walk; count what is told.

    Walks are at 0.3 to 1.5 m/s, with turns and in wind.
    """
    report = Report("falls", UNITS, packages=["onnxruntime"])
    watched = Watched(lens, eyes, detector, rate, distance)
    for name, heading in HEADINGS.items():
        told = [
            alarms(scene(heading, seed), watched, seed, STARTS, ENDS)
            for seed in range(first_seed, first_seed + falls)
        ]
        late = [
            min(at - FALLS for at in one if at > FALLS) for one in told if one and one[-1] > FALLS
        ]
        early = sum(at <= FALLS for one in told for at in one)
        share = 100 * len(late) / falls if falls else math.nan
        after = float(np.median(late)) if late else math.nan
        report.row(name, {"scenes": falls, "told": share, "after": after, "false": early})
    speeds = np.linspace(0.3, 1.5, 5)
    flown = [
        alarms(walk(float(speeds[seed % 5]), duration, seed), watched, seed, 5.0, duration)
        for seed in range(first_seed, first_seed + walks)
    ]
    wrong = sum(map(len, flown))
    none = math.nan
    report.row("walks", {"scenes": walks, "told": none, "after": none, "false": wrong})
    report.note(
        f"{lens.value} lens, {rate:g} frames a second, {distance:g} m away; walks of "
        f"{duration:g} s; {SEES[eyes]}. The follower is given true boxes with noise."
    )
    report.show()
    if json is not None:
        report.write(json)


if __name__ == "__main__":
    typer.run(main)
