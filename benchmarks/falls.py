"""How surely a fall before the camera is told, and how often one that was none.

python benchmarks/falls.py --lens tello
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from _report import Report

from aerodaas.analytics.base import ComputeKind, Context
from aerodaas.analytics.follow.followers import VipFollowAnalytics
from aerodaas.analytics.people.body_pose import BodyPoseEmergencyAnalytics
from aerodaas.analytics.people.pose import PoseAnalytics
from aerodaas.simulation.scenario import Scenario
from aerodaas.simulation.world import World
from aerodaas.types.clock import seconds
from aerodaas.types.data import Alert, Detections, Header, Odometry
from aerodaas.types.geometry import CameraModel
from aerodaas.types.vehicle import VehicleState
from tools.tuning.chase import Chase
from tools.tuning.perception import DetectorPerception, TruthPerception
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


class Watching(DetectorPerception):
    """Follows by true boxes, while the shipped models watch the body on renders."""

    def __init__(self, world: World, camera: CameraModel, seed: int, begin: float) -> None:
        """Watch from `begin` seconds on."""
        super().__init__(world, camera, PoseAnalytics())
        self._follow_by = TruthPerception(world.thing(PERSON), "vest", camera, seed=seed)
        self._begin = begin
        self._body = BodyPoseEmergencyAnalytics()
        self._body.open()
        self.onlooker = Onlooker()

    def look(
        self, header: Header, pose: Odometry, believed: Odometry, context: Context
    ) -> Detections:
        """Watch the body; return the vest."""
        if seconds(header.stamp) >= self._begin:
            self.onlooker.stamp = header.stamp
            found = super().look(header, pose, believed, context)
            self._body.process(found, self.onlooker)
        return self._follow_by.look(header, pose, believed, context)


def alarms(
    world: World, lens: Lens, rate: float, seed: int, begin: float, end: float
) -> list[float]:
    """Follow the person until `end` seconds; when a fall was told."""
    camera = LENSES[lens]
    eyes = Watching(world, camera, seed, begin)
    chase = Chase(world.thing(PERSON), "vest", rate, camera=camera, seed=seed)
    chase.fly(VipFollowAnalytics(), eyes, end)
    eyes.close()
    return [seconds(alert.header.stamp) for alert in eyes.onlooker.alerts if alert.kind == "fallen"]


def scene(heading: float, seed: int) -> World:
    """A person who falls two metres before the drone with the head towards `heading` degrees.

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
    json: Annotated[Path | None, typer.Option(help="Write the figures to this file.")] = None,
) -> None:
    """Follow people who fall two metres ahead, and people who walk; count what is told.

    Walks are at 0.3 to 1.5 m/s, with turns and in wind.
    """
    report = Report("falls", UNITS, packages=["onnxruntime"])
    for name, heading in HEADINGS.items():
        told = [
            alarms(scene(heading, seed), lens, rate, seed, STARTS, ENDS) for seed in range(falls)
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
        alarms(walk(float(speeds[seed % 5]), duration, seed), lens, rate, seed, 5.0, duration)
        for seed in range(walks)
    ]
    wrong = sum(map(len, flown))
    none = math.nan
    report.row("walks", {"scenes": walks, "told": none, "after": none, "false": wrong})
    report.note(
        f"{lens.value} lens, {rate:g} frames a second; walks of {duration:g} s. The shipped models "
        "look at renders; the follower is given true boxes with noise."
    )
    report.show()
    if json is not None:
        report.write(json)


if __name__ == "__main__":
    typer.run(main)
