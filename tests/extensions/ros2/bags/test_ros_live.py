"""A flight on ROS 2 topics, heard by another participant."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from cyclonedds.domain import DomainParticipant
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from numpy.typing import NDArray
from ros_domain import DOMAIN
from waiting import until

from aerodaas.cameras.images import decode_depth, decode_image
from aerodaas.extensions.ros2.bags.live import RosGraph
from aerodaas.extensions.ros2.topics import types
from aerodaas.extensions.ros2.topics.incoming import (
    battery_of,
    fix_of,
    odometry_of,
    stamp_of,
)
from aerodaas.extensions.ros2.topics.link import RosLink
from aerodaas.geometry.frames import CameraModel, rotation_from_rpy
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Frame, Header
from aerodaas.messages.odometry import Battery, GpsFix, Odometry
from aerodaas.messages.vehicle import VehicleMode, VehicleState

EPOCH = 1_700_000_000_000_000_000
STAMP = 5_250_000_000
LENS = CameraModel.from_fov(48, 32, 1.2, mount=(0.1, 0.0, 0.08), pitch=0.3)


class Ears:
    """Another node, and what it heard by topic."""

    def __init__(self, link: RosLink) -> None:
        self._link = link
        self.heard: dict[str, list[Any]] = defaultdict(list)

    def listen(self, **topics: str) -> None:
        """Subscribe to topics, named with two underscores for each slash."""
        for name, kind in topics.items():
            topic = "/" + name.replace("__", "/")
            self._link.subscribe(topic, kind, self.heard[topic].append)


@pytest.fixture
def graph(loopback_domain: None) -> Iterator[RosGraph]:
    """The flight."""
    del loopback_domain
    made = RosGraph(DOMAIN, EPOCH)
    yield made
    made.close()


@pytest.fixture
def ears(ros_link: RosLink) -> Ears:
    """Hears nothing yet."""
    return Ears(ros_link)


def message(stream: str, item: object, source: str, number: int = 0) -> Message[Any]:
    """`item` on its way."""
    header = Header(number, STAMP + number, source)
    return Message(stream, number, STAMP + number, header, 0, (), item)


def state(number: int = 0, x: float = 1.5) -> VehicleState:
    """In flight, leaning."""
    odometry = Odometry(
        np.array([x, -2.0, 3.0]), np.array([1.0, 2.0, -0.5]), 0.7, 0.1, -0.2, 0.3, 0.5
    )
    fix = GpsFix(48.1, 11.6, 520.0, 1.5, 2.5)
    mode, battery = VehicleMode.GUIDED, Battery(0.625, 15.5, 12.0)
    return VehicleState(STAMP + number, odometry, battery, mode, armed=True, gps=fix)


def picture() -> NDArray[np.uint8]:
    """Half dark, half light."""
    image = np.full((32, 48, 3), 30, np.uint8)
    image[:, 24:] = (200, 180, 160)
    return image


def test_a_state_is_odometry_transform_battery_and_fix(graph: RosGraph, ears: Ears) -> None:
    """By the frames and units of ROS 2, with the time of measurement."""
    ears.listen(
        d_1__odometry=types.ODOMETRY,
        d_1__battery=types.BATTERY,
        d_1__fix=types.NAV_SAT_FIX,
        tf=types.TRANSFORMS,
    )
    number = iter(range(1000))

    def complete() -> bool:
        sent = next(number)
        graph.put(message("d-1/@state", state(sent), "d-1", sent))
        return all(ears.heard.values())

    until(complete)
    (odometry, *_), (battery, *_), (fix, *_), (moved, *_) = ears.heard.values()
    assert (odometry.header.frame_id, odometry.child_frame_id) == ("map", "d-1/base_link")
    assert 0 <= stamp_of(odometry) - EPOCH - STAMP < 1000
    found, sent = odometry_of(odometry), state().odometry
    np.testing.assert_allclose(found.position, sent.position)
    np.testing.assert_allclose(found.velocity, sent.velocity)
    np.testing.assert_allclose(
        [found.roll, found.pitch, found.yaw, found.position_sigma], [0.1, -0.2, 0.7, 0.5]
    )
    assert battery_of(battery) == Battery(0.625, 15.5, 12.0)
    assert fix_of(fix) == GpsFix(48.1, 11.6, 520.0, 1.5, 2.5)
    (transform,) = moved.transforms
    assert (transform.header.frame_id, transform.child_frame_id) == ("map", "d-1/base_link")
    shift = transform.transform.translation
    assert (shift.x, shift.y, shift.z) == (1.5, -2.0, 3.0)


def test_a_frame_is_a_picture_with_its_lens_and_depth(graph: RosGraph, ears: Ears) -> None:
    """And detections have its stamp."""
    ears.listen(
        d__eye__image__compressed=types.COMPRESSED_IMAGE,
        d__eye__aligned_depth=types.IMAGE,
        d__eye__camera_info=types.CAMERA_INFO,
        d__vest__detections=types.DETECTIONS,
    )
    depth = np.arange(32 * 48, dtype=np.uint16).reshape(32, 48)
    box = Detection((4.0, 6.0, 20.0, 30.0), "person", 0.75, track_id=7)
    header = Header(0, STAMP, "d/eye")
    frame = Frame(header, picture(), LENS, depth=depth)

    def complete() -> bool:
        graph.put(message("d/eye", frame, "d/eye"))
        found = Detections(header, (box,), 48, 32, LENS)
        graph.put(message("d/vest", found, "d/eye"))
        return all(ears.heard.values())

    until(complete)
    (image, *_), (measured, *_), (lens, *_), (boxes, *_) = ears.heard.values()
    assert image.header == measured.header == lens.header == boxes.header
    assert stamp_of(image) == EPOCH + STAMP
    assert image.header.frame_id == "d/eye"
    shown = decode_image("sensor_msgs/msg/CompressedImage", image)
    assert shown is not None
    assert np.abs(shown.astype(int) - picture()).mean() < 3
    np.testing.assert_array_equal(decode_depth(measured), depth)
    assert (lens.width, lens.height, lens.k[0], lens.k[2]) == (48, 32, LENS.fx, 24.0)
    (found,) = boxes.detections
    hypothesis, centre = found.results[0].hypothesis, found.bbox.center.position
    assert (hypothesis.class_id, hypothesis.score, found.id) == ("person", 0.75, "7")
    assert (centre.x, centre.y, found.bbox.size_x, found.bbox.size_y) == (12.0, 18.0, 16.0, 24.0)


def test_where_a_camera_is_mounted_is_kept(graph: RosGraph) -> None:
    """In one message, of all cameras: by z-y-x angles and the optical frame's axes."""
    for name in ("eye", "back"):
        header = Header(0, STAMP, f"d/{name}")
        graph.put(message(f"d/{name}", Frame(header, picture(), LENS), f"d/{name}"))
    # As ROS 2's own listener of transforms subscribes.
    participant = DomainParticipant(DOMAIN)
    qos = Qos(Policy.Reliability.Reliable(10**8), Policy.Durability.TransientLocal)
    topic: Any = Topic(participant, "rt/tf_static", types.dds_type(types.TRANSFORMS))
    reader = DataReader(participant, topic, qos=qos)
    heard: list[Any] = []

    def told() -> bool:
        heard.extend(reader.take())
        return bool(heard)

    until(told)
    transforms = heard[-1].transforms
    assert [one.child_frame_id for one in transforms] == ["d/eye", "d/back"]
    transform = transforms[0].transform
    assert transforms[0].header.frame_id == "d/base_link"
    place = transform.translation
    assert (place.x, place.y, place.z) == (0.1, 0.0, 0.08)
    x, y, z, w = (getattr(transform.rotation, axis) for axis in "xyzw")
    # The third column of a quaternion's matrix: where the lens looks.
    looks = [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)]
    np.testing.assert_allclose(looks, rotation_from_rpy(0, 0.3, 0) @ [1, 0, 0], atol=1e-9)


def test_what_ros_has_no_message_for_is_left_out(graph: RosGraph, ros_link: RosLink) -> None:
    """A place that is not known, a state that came before, and results of other kinds."""
    graph.put(message("d/@state", state(x=float("nan")), "d"))
    graph.put(message("d/words", "hello", "d/eye"))
    graph.put(message("d/nothing", None, "d/eye"))
    graph.put(message("seen/@state", state(5), "seen"))
    until(lambda: "/seen/odometry" in ros_link.published())
    assert not [name for name in ros_link.published() if name.startswith("/d/")]
