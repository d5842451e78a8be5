"""Inspecting a tower in a closed loop: never nearer than the stand-off, bounded, then landing."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest
from follow_world import TELLO, Snapshot
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from aerodaas.analytics.inspection.tower_inspection import TowerInspectionAnalytics, inspection_over
from aerodaas.clock import NANOSECONDS
from aerodaas.dataflow.graph import AeroStreamData, Graph, Node
from aerodaas.errors import ConfigError, GraphError
from aerodaas.following.inspection import InspectionPhase
from aerodaas.geometry.frames import Vector, body_to_enu, enu_to_body
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.frames import Frame, Header
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.readings import Alert
from aerodaas.messages.waypoints import VelocityCommand

HALF = 1.5


@dataclass
class Site:
    """A square tower of 35 m that tapers, a point drone with a lag, and a level camera."""

    tower: tuple[float, float]
    position: Vector
    yaw: float = 0.0
    turned: float = 0.0
    rate: float = 5.0
    noise: float = 0.0
    hidden: Callable[[float], bool] = lambda _: False
    score: float = 0.9
    loose: float | None = None
    """Score of a second box in the first seconds, twice as wide, as around a tower and a hut."""
    time: float = 0.0
    velocity: Vector = field(default_factory=lambda: np.zeros(3))
    yaw_rate: float = 0.0
    alerts: list[Alert] = field(default_factory=list)
    heights: list[float] = field(default_factory=list)

    def odometry(self) -> Odometry:
        """The drone's true odometry."""
        return Odometry(self.position.copy(), self.velocity.copy(), self.yaw)

    def look(self, random: np.random.Generator) -> Detections:
        """Box around the tower, clipped by the picture."""
        pixels = []
        for height, half in ((0.0, HALF), (35.0, HALF / 3)):
            for corner in range(4):
                angle = self.turned + math.pi / 4 + corner * math.pi / 2
                reach = half * math.sqrt(2)
                east = self.tower[0] + reach * math.cos(angle)
                north = self.tower[1] + reach * math.sin(angle)
                offset = enu_to_body(np.array([east, north, height]) - self.position, self.yaw)
                pixels.append(TELLO.project(offset))
        items = []
        points = np.array(pixels)
        if (points[:, 2] > 0.1).all() and not self.hidden(self.time):
            spread = self.noise * np.ptp(points[:, 0])
            box = np.array([*points[:, :2].min(axis=0), *points[:, :2].max(axis=0)])
            box = np.clip(box + random.normal(0, spread, 4), 0, [1280, 720, 1280, 720])
            left, top, right, bottom = box.tolist()
            if right - left > 4 and bottom - top > 8:
                items.append(Detection((left, top, right, bottom), "tower", self.score))
                if self.loose is not None and self.time < 4.0:
                    wide = max(0.0, left - (right - left))
                    items.append(Detection((wide, top, right, bottom), "tower", self.loose))
        header = Header(round(self.time * 100), round(self.time * NANOSECONDS), "drone/cam")
        return Detections(header, tuple(items), 1280, 720, TELLO, self.odometry())

    def run(self, inspect: TowerInspectionAnalytics, duration: float, seed: int = 0) -> float:
        """Fly until the end or for `duration` s; returns the least distance to the tower's side."""
        random = np.random.default_rng(seed)
        nearest = math.inf
        waiting = [self.look(random)]
        while self.time < duration:
            waiting.append(self.look(random))
            item = waiting.pop(0)
            stamp = round(self.time * NANOSECONDS)
            result = inspect.process(item, Snapshot(stamp, self.odometry(), self.alerts))
            command = result.commands[0] if result is not None else VelocityCommand()
            self.fly(command)
            nearest = min(nearest, self.distance)
            self.heights.append(float(self.position[2]))
            if inspection_over(result):
                break
        return nearest

    @property
    def distance(self) -> float:
        """Metres along the ground to the nearest point of the foot."""
        east, north = self.position[:2] - np.array(self.tower)
        c, s = math.cos(self.turned), math.sin(self.turned)
        own = np.abs([c * east + s * north, c * north - s * east]) - HALF
        return float(np.hypot(*np.maximum(own, 0.0)))

    def fly(self, command: VelocityCommand) -> None:
        """Move for one frame's time."""
        dt = 1 / self.rate / 10
        for _ in range(10):
            wanted = body_to_enu(command.velocity, self.yaw)
            self.velocity = self.velocity + (wanted - self.velocity) * dt / 0.3
            self.yaw_rate += (command.yaw_rate - self.yaw_rate) * dt / 0.15
            self.position = self.position + self.velocity * dt
            self.yaw += self.yaw_rate * dt
            self.time += dt


@pytest.mark.slow
@given(
    distance=st.floats(15.0, 60.0),
    bearing=st.floats(-0.5, 0.5),
    height=st.floats(1.5, 4.0),
    turned=st.floats(0.0, 1.6),
    stand_off=st.floats(5.0, 10.0),
    noise=st.sampled_from([0.0, 0.02]),
    seed=st.integers(0, 100),
)
@settings(max_examples=5, phases=[Phase.explicit, Phase.reuse, Phase.generate])
def test_it_never_comes_nearer_than_the_stand_off(
    distance: float,
    bearing: float,
    height: float,
    turned: float,
    stand_off: float,
    noise: float,
    seed: int,
) -> None:
    """From many starts, by boxes with noise and latency; up to the top, and down again."""
    tower = distance * math.cos(bearing), distance * math.sin(bearing)
    site = Site(tower, np.array([0.0, 0.0, height]), turned=turned, noise=noise)
    inspect = TowerInspectionAnalytics(stand_off=stand_off, top=20.0, interval=3.0)
    nearest = site.run(inspect, 400, seed)
    assert inspect.controller.phase is InspectionPhase.DONE
    assert nearest > stand_off - 0.5
    assert 19.5 < max(site.heights) < 20.5
    assert len(inspect.taken) == 7
    assert np.diff(inspect.taken) == pytest.approx(3.0, abs=0.5)
    assert site.heights[-1] < 2.6


def test_a_larger_box_that_is_less_sure_changes_nothing() -> None:
    """It would make the tower seem nearer, and the inspection end on the way."""
    site = Site((30.0, 0.0), np.array([0.0, 0.0, 3.0]), loose=0.5)
    inspect = TowerInspectionAnalytics(top=6.0)
    site.run(inspect, 120)
    assert inspect.taken
    assert max(site.heights) > 5.5
    assert "cut_short" not in " ".join(alert.kind for alert in site.alerts)


def test_an_unsure_tower_is_not_inspected() -> None:
    """The trunk of a tree may look a little like one."""
    site = Site((30.0, 0.0), np.array([0.0, 0.0, 3.0]), score=0.4)
    inspect = TowerInspectionAnalytics()
    site.run(inspect, 20)
    assert inspect.controller.phase is InspectionPhase.WAITING
    assert not site.alerts


def test_a_tower_that_disappears_ends_the_inspection() -> None:
    """On the way or in the climb: the drone goes no further towards it, comes down, and ends."""
    for gone, early in ((6.0, True), (40.0, False)):
        site = Site((30.0, 0.0), np.array([0.0, 0.0, 3.0]))
        site.hidden = lambda time, gone=gone: time > gone  # type: ignore[misc]
        inspect = TowerInspectionAnalytics(patience=8.0)
        site.run(inspect, 200)
        assert inspect.controller.phase is InspectionPhase.DONE
        assert site.distance > 8.0 - 0.3
        assert early == (not inspect.taken)
        assert "inspection_cut_short" in [alert.kind for alert in site.alerts]


def test_boxes_of_parts_of_the_tower_draw_it_no_nearer() -> None:
    """Half of the boxes end above the foot, so that the tower seems farther away."""
    site = Site((25.0, 0.0), np.array([0.0, 0.0, 3.0]))
    whole = site.look

    def look(random: np.random.Generator) -> Detections:
        seen = whole(random)
        if site.time < 1.0 or random.random() < 0.5:
            return seen
        parts = [
            replace(one, box=(*one.box[:3], one.box[1] + 0.9 * (one.box[3] - one.box[1])))
            for one in seen
        ]
        return replace(seen, items=tuple(parts))

    site.look = look  # type: ignore[method-assign]
    nearest = site.run(TowerInspectionAnalytics(top=6.0), 120)
    assert nearest > 8.0 - 0.5


def test_time_bounds_it() -> None:
    """After `longest` seconds the drone comes down, wherever it is."""
    site = Site((20.0, 0.0), np.array([0.0, 0.0, 3.0]))
    site.run(TowerInspectionAnalytics(longest=30.0), 200)
    assert site.time < 70


def test_one_false_box_moves_nothing() -> None:
    """Three sightings within two seconds begin it; until then others navigate."""
    site = Site((30.0, 0.0), np.array([0.0, 0.0, 3.0]))
    site.hidden = lambda time: time % 5 > 0.2
    inspect = TowerInspectionAnalytics()
    site.run(inspect, 3)
    assert inspect.controller.phase is InspectionPhase.WAITING
    assert site.position[:2] == pytest.approx([0, 0])


def test_the_end_lands_the_robot_and_pictures_need_frames(tmp_path: Path) -> None:
    """A trigger is set for the robot whose camera it is; boxes alone cannot be written."""
    graph = Graph()
    graph.add(Node("drone/boxes", "analytics", Detections, None, robot="drone"))
    boxes = AeroStreamData[Detections](graph, "drone/boxes", Detections)
    inspect = TowerInspectionAnalytics()
    inspect.analyse(boxes)
    assert inspect.node is not None
    assert [(one.target, one.method) for one in inspect.node.triggers] == [("drone", "end_mission")]
    with pytest.raises(GraphError, match="analyse the camera's stream"):
        TowerInspectionAnalytics(pictures=tmp_path).analyse(boxes)
    with pytest.raises(ConfigError, match="top must lie above base"):
        TowerInspectionAnalytics(base=10, top=5)
    with pytest.raises(ConfigError, match="stand_off must be above 0"):
        TowerInspectionAnalytics(stand_off=math.nan)


class _Seeing:
    """A detector that sees what it is told to."""

    def __init__(self, site: Site) -> None:
        self.site = site

    def open(self) -> None:
        """Nothing to load."""

    def close(self) -> None:
        """Nothing to release."""

    def process(self, item: Frame, context: object) -> Detections:
        """The site's own boxes."""
        del item, context
        return self.site.look(np.random.default_rng(0))


def test_pictures_are_written(tmp_path: Path) -> None:
    """One JPEG for each interval of height, named by it."""
    site = Site((14.0, 0.0), np.array([0.0, 0.0, 2.0]))
    inspect = TowerInspectionAnalytics(
        top=8.0,
        pictures=tmp_path / "tower",
        detector=_Seeing(site),  # type: ignore[arg-type]
    )
    image = np.zeros((72, 128, 3), np.uint8)
    while site.time < 60 and inspect.controller.phase is not InspectionPhase.DONE:
        stamp = round(site.time * NANOSECONDS)
        frame = Frame(Header(0, stamp, "drone/cam"), image, TELLO, site.odometry())
        result = inspect.process(frame, Snapshot(stamp, site.odometry(), site.alerts))
        site.fly(result.commands[0] if result is not None else VelocityCommand())
    names = sorted(path.name for path in (tmp_path / "tower").iterdir())
    assert [name[:3] for name in names] == ["001", "002", "003", "004"]
