"""A recorded flight, flown again: the same decisions from the same sensors, and no vehicle."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from analyses import Ticker, Weave
from flying import FLAT, Flyer, hop, robot
from mcap.writer import Writer
from synthetic_models import constant_model

from aerodaas import (
    AeroNavigation,
    Analytics,
    Detections,
    Environment,
    Frame,
    NavigableAnalytics,
    NavigationType,
    NearestNeighborScheduler,
    SchedulingType,
    VelocityCommand,
    Waypoint,
)
from aerodaas.analytics.base import Context
from aerodaas.analytics.detection.detector import OnnxDetector
from aerodaas.environment.run import Run
from aerodaas.errors import RecordingError
from aerodaas.messages.detections import Detection
from aerodaas.recording.pictures import detections, frames, picture_topics
from aerodaas.recording.reader import Recording
from aerodaas.recording.replay.environment import read_timetables
from aerodaas.recording.report.difference import difference

CAMERA = {"id": "cam", "type": "camera", "rate": 7, "settings": {"width": 64, "height": 36}}


class Brightest(Analytics[Detections]):
    """Finds the brightest pixel: any loss in the pictures shows."""

    accepts: ClassVar[tuple[type, ...]] = (Frame,)
    produces: ClassVar[type] = Detections
    isolated = True
    scheduled = True

    def process(self, item: Frame, context: Context) -> Detections:  # noqa: ARG002
        """Return a box of one pixel, its score made of all pixels."""
        light = item.image.sum(axis=2)
        row, column = np.unravel_index(int(light.argmax()), light.shape)
        box = (float(column), float(row), float(column + 1), float(row + 1))
        return Detections.of(item, [Detection(box, "light", float(light.mean()) / 1000)])


class Tardy(Brightest):
    """Takes longer than a frame lasts, so that in flight it misses some."""

    def process(self, item: Frame, context: Context) -> Detections:
        """Find the brightest pixel, slowly."""
        time.sleep(0.2)
        return super().process(item, context)


class Chase(NavigableAnalytics):
    """Flies by what was found and by where the drone was when it was seen."""

    accepts: ClassVar[tuple[type, ...]] = (Detections,)

    def process(self, item: Detections, context: Context) -> AeroNavigation | None:  # noqa: ARG002
        """Turn towards the box; nothing above four metres."""
        height = item.odometry.height if item.odometry else 0.0
        aside = item.items[0].centre[0] / item.width - 0.5
        command = VelocityCommand(0.5 + item.items[0].score, 0.0, 0.2 * (2 - height), aside)
        return AeroNavigation(NavigationType.ANALYTICS_DRIVEN, [command])


def chase(env: Environment) -> None:
    """Camera to detector to follower, for five seconds."""
    drone = env.get_robot_by_id("drone")
    found = Brightest().analyse(drone.get_sensor_by_id("cam").get_data_stream())
    drone.navigate(Chase().analyse(found))
    end_after(env, 20)


def end_after(env: Environment, quarters: int) -> None:
    """End the mission after so many quarters of a second."""
    stop = Ticker().deploy(env.get_compute_resource_by_id("edge"))
    drone = env.get_robot_by_id("drone")
    stop.trigger(drone.end_mission, when=lambda count: count > quarters)
    stop.instantiate()


def with_camera(images: str) -> dict[str, Any]:
    """An environment with a rendered camera, recorded as `images`."""
    drone = robot(sensors=[CAMERA])
    world = {**FLAT["simulation"], "world": "field"}
    return {**FLAT, "robots": [drone], "simulation": world, "recording": {"images": images}}


def again(flyer: Flyer, run: Run, build: Callable[[Environment], object], **words: Any) -> Path:  # noqa: ANN401
    """Replay a run's recording; returns the new one."""
    assert run.recording is not None
    folder = flyer.folder / f"replay-{len(list(flyer.folder.glob('replay-*')))}"
    replayed = flyer.fly(build, replay=run.recording, record=folder, **words)
    assert replayed.recording is not None
    return replayed.recording


@pytest.fixture(scope="module")
def surveyed(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A flight of two drones, one by waypoints, one by what an analysis makes of its odometry."""
    two = [robot("one"), robot("two", start=[0, 6, 0])]
    flyer = Flyer(tmp_path_factory.mktemp("surveyed"))
    return flyer.fly(survey, {**FLAT, "robots": two}, record=flyer.folder / "first")


def survey(env: Environment, first: float = 3.0) -> None:
    """Waypoints for one drone, the first of them so far to the east; a curve for the other."""
    env.get_robot_by_id("one").navigate(hop((first, 0), (3, 2), hover=0.5))
    other = env.get_robot_by_id("two")
    other.navigate(Weave().analyse(other.get_sensor_by_id("odom_two").get_data_stream()))
    stop = Ticker().deploy(env.get_compute_resource_by_id("edge"))
    stop.trigger(other.end_mission, when=lambda count: count > 20)
    stop.instantiate()


def test_a_flight_in_simulated_time_repeats_every_decision(surveyed: Run, flyer: Flyer) -> None:
    """Waypoints, wind, analytics in the loop, two drones: nothing differs."""
    assert surveyed.recording is not None
    second = again(flyer, surveyed, survey)
    found = difference(surveyed.recording, second)
    assert found.agrees, str(found)
    counted = {stream.what: stream.same for stream in found.streams}
    assert counted["one mission states"] >= 5
    assert counted["two setpoints asked for"] > 50
    assert counted["two/weave navigation"] > 20
    with Recording.open(second) as recording:
        content = json.loads(recording.attachment("environment.json"))
    assert [one["driver"] for one in content["robots"]] == ["replayed"] * 2


def test_a_mission_that_goes_elsewhere_ends_with_the_recording(surveyed: Run, flyer: Flyer) -> None:
    """Another waypoint than the one recorded is never reached; the replay ends all the same."""
    assert surveyed.recording is not None
    second = again(flyer, surveyed, lambda env: survey(env, first=-40.0))
    assert not difference(surveyed.recording, second).agrees
    with Recording.open(surveyed.recording) as one, Recording.open(second) as other:
        assert other.duration == pytest.approx(one.duration, abs=0.2)


@pytest.mark.slow
@pytest.mark.wall_clock
def test_a_flight_by_the_clock_is_seen_again(flyer: Flyer) -> None:
    """Frames come at odd times and some are missed: all pass again, and are found to hold the same.

    Planning and the setpoint loop go by the replay's own clock.
    """

    def build(env: Environment) -> None:
        drone = env.get_robot_by_id("drone")
        scheduler = NearestNeighborScheduler(env)
        env.set_trajectory_scheduler(scheduler)
        places = [Waypoint(f"wp{x}{y}", x, y, 2.0) for x, y in ((4, 4), (1, 0), (0, 3))]
        plan = AeroNavigation(NavigationType.DISTANCE_DRIVEN, places, SchedulingType.UNORDERED)
        drone.navigate(scheduler.generate_navigation(plan))
        Tardy().analyse(drone.get_sensor_by_id("cam").get_data_stream())
        end_after(env, 24)

    first = flyer.fly(
        build, with_camera("png"), record=flyer.folder / "first", simulated_time=False
    )
    assert first.recording is not None
    found = difference(first.recording, again(flyer, first, build))
    seen = {one.what: one for one in found.streams}["drone/tardy detections"]
    assert (seen.differing, seen.only_first) == (0, 0)
    assert seen.same > 10
    recorded = len(read_timetables(first.recording)["drone/cam"])
    # In flight, the camera goes on for a moment after the mission has ended.
    assert recorded - 5 <= seen.same + seen.only_second <= recorded
    assert seen.only_second > 0, "those that the analysis had no time for in flight"


def detector(path: Path, score: float) -> Path:
    """A model that finds one person in every picture, as surely as `score`."""
    rows = np.zeros((1, 300, 6), np.float32)
    rows[0, 0] = [10, 10, 40, 40, score, 0]
    names = {"names": "{0: 'person'}", "task": "detect"}
    return constant_model(path, [rows], metadata=names)


@pytest.mark.slow
def test_another_scheduler_and_another_model(flyer: Flyer) -> None:
    """Both see what was seen; decisions, and what is found, are the new ones'."""

    def build(env: Environment) -> None:
        camera = env.get_robot_by_id("drone").get_sensor_by_id("cam").get_data_stream()
        OnnxDetector(flyer.folder / "first.onnx").analyse(camera)
        chase(env)

    detector(flyer.folder / "first.onnx", 0.5)
    other = detector(flyer.folder / "other.onnx", 0.75)
    first = flyer.fly(build, with_camera("h264"), record=flyer.folder / "first")
    assert first.recording is not None
    found = difference(first.recording, again(flyer, first, build, scheduler="gems", model=other))
    assert not found.agrees
    by_name = {stream.what: stream for stream in found.streams}
    known = by_name["drone/onnx_detector detections"]
    assert (known.same, known.only_first, known.only_second) == (0, 0, 0)
    assert known.differing > 20
    assert known.boxes is not None
    assert known.boxes.most_score == pytest.approx(0.25)
    assert known.boxes.most_pixels == 0.0
    # H.264 loses a little, which this one sees.
    seen = by_name["drone/brightest detections"]
    assert seen.differing > 0
    assert seen.only_first == 0
    assert " became " in seen.example
    assert by_name["scheduler decisions"].only_second > known.differing
    json.dumps(found.as_dict())


def test_a_recording_of_others_cannot_be_replayed(tmp_path: Path, flyer: Flyer) -> None:
    """It is told what to do with it instead."""
    path = tmp_path / "theirs.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        writer.finish()
    with flyer.options(replay=path), pytest.raises(RecordingError, match='driver "mcap"'):
        Environment("environment.json")


class Ranging(Analytics[Detections]):
    """Steers by depth alone: any loss of it shows."""

    accepts: ClassVar[tuple[type, ...]] = (Frame,)
    produces: ClassVar[type] = Detections

    def process(self, item: Frame, context: Context) -> Detections:  # noqa: ARG002
        """One box around all, its score made of all that was measured."""
        assert item.depth is not None
        box = (0.0, 0.0, float(item.width), float(item.height))
        return Detections.of(item, [Detection(box, "all", float(item.depth.mean()) / 2**16)])


def by_depth(env: Environment) -> None:
    """Camera to depth to flight, for five seconds."""
    drone = env.get_robot_by_id("drone")
    found = Ranging().analyse(drone.get_sensor_by_id("cam").get_data_stream())
    drone.navigate(Chase().analyse(found))
    end_after(env, 20)


@pytest.mark.slow
def test_depth_is_recorded_and_replayed_to_the_millimetre(flyer: Flyer) -> None:
    """As the picture's companion, not as another camera; boxes keep what was measured in them."""
    content = with_camera("jpeg")
    settings = {"width": 64, "height": 36, "depth_range": 20, "pitch": 30}
    content["robots"][0]["sensors"] = [{**CAMERA, "settings": settings}]
    first = flyer.fly(by_depth, content, record=flyer.folder / "first")
    second = again(flyer, first, by_depth)
    assert first.recording is not None
    found = difference(first.recording, second)
    assert found.agrees, str(found)
    counted = {stream.what: stream.same for stream in found.streams}
    assert counted["drone/ranging detections"] > 20
    with Recording.open(first.recording) as recording:
        assert picture_topics(recording) == ["/drone/cam/image"]
        depths = [frame.depth for frame in frames(recording)]
        boxes = [result[0].depth for _, result in detections(recording)]
    assert all(depth is not None and depth.shape == (36, 64) for depth in depths)
    assert 0.2 < min(filter(None, boxes)) < 1.0, "on the ground"
    assert 1.0 < max(filter(None, boxes)) < 20.0, "above it"
