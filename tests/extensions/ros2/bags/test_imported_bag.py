"""A flight, written as a ROS 2 bag and read back, replays through its application's graph."""

from __future__ import annotations

from pathlib import Path

import pytest
from flying import FLAT, Flyer, hop, robot

from aerodaas import Analytics, Environment, Frame
from aerodaas.analytics.base import Context
from aerodaas.extensions.ros2.bags.bag import RosBag
from aerodaas.extensions.ros2.bags.bag_preview import BagTopics
from aerodaas.extensions.ros2.bags.bag_writer import write_bag
from aerodaas.extensions.ros2.bags.importing import import_bag
from aerodaas.recording.reader import Recording

pytestmark = pytest.mark.slow

CAMERA = {
    "id": "cam",
    "type": "camera",
    "rate": 5,
    "settings": {"width": 64, "height": 48, "pitch": 30, "horizontal_fov": 70},
}


class Brightness(Analytics[float]):
    """Mean of a picture that was taken somewhere."""

    accepts = (Frame,)
    produces = float

    def process(self, item: Frame, context: Context) -> float:  # noqa: ARG002
        """Measure."""
        assert item.odometry is not None
        return float(item.image.mean())


def application(env: Environment) -> None:
    """A short way, looked at."""
    drone = env.get_robot_by_id("drone")
    drone.navigate(hop((1.0, 0.5), hover=0.2))
    Brightness().analyse(drone.get_sensor_by_id("cam").get_data_stream())


def brightness(path: Path) -> dict[int, float]:
    """What the analysis said of each picture, by its timestamp."""
    with Recording.open(path) as recording:
        (topic,) = (name for name in recording.topics if "brightness" in name.lower())
        records = recording.records(topics=[topic])
        return {one.value.header.stamp: one.value.value for one in records}


def test_an_analysis_says_the_same_of_a_flight_and_of_its_bag(flyer: Flyer) -> None:
    """Of every picture, at its stamp, to the last bit."""
    content = {
        **FLAT,
        "robots": [{**robot("drone"), "sensors": [CAMERA]}],
        "home": {"latitude": 13.0, "longitude": 77.5, "altitude": 900.0},
        "recording": {"images": "png"},
    }
    run = flyer.fly(application, content, record=flyer.folder / "first")
    assert run.recording is not None
    with Recording.open(run.recording) as recording:
        bag = write_bag(recording, flyer.folder)
    topics = BagTopics(
        camera={"cam": "/drone/cam/image/compressed"},
        odometry="/drone/odometry",
        gps="/drone/fix",
        battery="/drone/battery",
    )
    back = flyer.folder / "back.mcap"
    with RosBag.open(bag) as opened:
        import_bag(opened, topics, back)
    again = flyer.fly(application, replay=back, record=flyer.folder / "again")
    assert again.recording is not None
    expected, found = brightness(run.recording), brightness(again.recording)
    assert len(found) > len(expected) / 2 > 5
    assert found.items() <= expected.items()
