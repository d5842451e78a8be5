"""Recordings as ROS 2 bags, read by the library, and back."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from recorded_pictures import encoded, strange_pictures
from ros_bags import EPOCH, Sent, odometry, read, write
from synthetic_flight import PROVENANCE, SyntheticFlight, record
from typer.testing import CliRunner

from aerodaas.cli.app import app
from aerodaas.config.model import RecordingConfig
from aerodaas.errors import RecordingError
from aerodaas.extensions.ros2.bags.bag import RosBag
from aerodaas.extensions.ros2.bags.bag_preview import BagTopics
from aerodaas.extensions.ros2.bags.bag_writer import write_bag
from aerodaas.extensions.ros2.bags.importing import import_bag
from aerodaas.extensions.ros2.bags.outgoing import MessageBuilder
from aerodaas.extensions.ros2.topics.incoming import odometry_of
from aerodaas.extensions.ros2.topics.types import IMAGE, ros_message
from aerodaas.geometry.frames import CameraModel, rotation_from_rpy
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Frame, Header
from aerodaas.messages.odometry import Odometry
from aerodaas.recording.pictures import frames, shots
from aerodaas.recording.reader import Recording, vehicle_states
from aerodaas.recording.recorder import FlightRecorder

OURS = BagTopics(
    "tello",
    camera={"camera": "/tello/camera/image/compressed"},
    odometry="/tello/odometry",
    gps="/tello/fix",
    battery="/tello/battery",
)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A flight with pictures and detections."""
    path = tmp_path_factory.mktemp("flight") / "flight.mcap"
    record(path, SyntheticFlight(frames=0.5, rate=5.0, hover=0.5))
    return path


@pytest.fixture(scope="module")
def bag(recorded: Path) -> Path:
    """It as a bag."""
    with Recording.open(recorded) as recording:
        return write_bag(recording, recorded.parent)


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_the_library_reads_what_was_written(recorded: Path, tmp_path: Path, storage: str) -> None:
    """Every state and picture, at its stamp and time, in REP 103's frames and ROS' units."""
    with Recording.open(recorded) as recording:
        found = read(write_bag(recording, tmp_path, storage))
    with Recording.open(recorded) as recording:
        states = [state for _, state in vehicle_states(recording, "tello")]
        pictures = list(shots(recording))
    for (_, message), state in zip(found["/tello/odometry"], states, strict=True):
        pose, twist, seen = message.pose.pose, message.twist.twist, state.odometry
        assert stamp(message) == EPOCH + state.stamp
        assert (message.header.frame_id, message.child_frame_id) == ("map", "tello/base_link")
        at = pose.position
        np.testing.assert_array_equal([at.x, at.y, at.z], seen.position)
        body = np.array([twist.linear.x, twist.linear.y, twist.linear.z])
        np.testing.assert_allclose(matrix(pose.orientation) @ body, seen.velocity, atol=1e-9)
    for (_, message), state in zip(found["/tello/battery"], states, strict=True):
        assert message.current == -4.0, "negative when it is drawn"
        assert message.percentage == pytest.approx(state.battery.fraction)
        assert message.voltage == pytest.approx(state.battery.voltage)
    for (_, message), state in zip(found["/tello/fix"], states, strict=True):
        assert state.gps is not None
        assert (message.latitude, message.longitude) == (state.gps.latitude, state.gps.longitude)
        assert message.position_covariance.tolist() == [1, 0, 0, 0, 1, 0, 0, 0, 4]
    for (_, message), shot in zip(found["/tello/camera/image/compressed"], pictures, strict=True):
        assert stamp(message) == EPOCH + shot.header.stamp
        assert (message.format, message.data.tobytes()) == ("jpeg", shot.record.value.data)
    assert [time for time, _ in found["/tello/camera/camera_info"]] == [
        time for time, _ in found["/tello/camera/image/compressed"]
    ]
    assert len(found["/tf"]) == len(states)


def test_a_point_ahead_of_the_camera_is_where_the_transforms_say(bag: Path) -> None:
    """By `tf_static` and K, as a ROS node would compute it, and by our own camera model."""
    found = read(bag)
    static = found["/tf_static"][0][1].transforms[0]
    info = found["/tello/camera/camera_info"][0][1]
    camera = CameraModel.from_fov(320, 180, 1.4, mount=(0.1, 0.0, 0.0), pitch=0.3)
    point = np.array([4.0, 0.7, -0.9])
    assert (static.header.frame_id, static.child_frame_id) == ("tello/base_link", "tello/camera")
    moved = static.transform.translation
    optical = matrix(static.transform.rotation).T @ (point - [moved.x, moved.y, moved.z])
    pixel = info.k.reshape(3, 3) @ optical
    np.testing.assert_allclose(pixel[:2] / pixel[2], camera.project(point)[:2], rtol=1e-9)


def test_there_and_back_is_the_same_flight(recorded: Path, bag: Path, tmp_path: Path) -> None:
    """States, fixes, pictures to the last byte, home and lens."""
    with RosBag.open(bag) as opened:
        done = import_bag(opened, OURS, tmp_path / "back.mcap")
    assert not done.skipped
    assert not done.damaged
    with Recording.open(recorded) as one, Recording.open(tmp_path / "back.mcap") as other:
        pairs = zip(vehicle_states(one, "tello"), vehicle_states(other, "tello"), strict=True)
        for (_, before), (_, after) in pairs:
            assert one.epoch_ns + before.stamp == other.epoch_ns + after.stamp
            for name in ("position", "velocity", "yaw", "roll", "pitch", "yaw_rate"):
                was, now = getattr(before.odometry, name), getattr(after.odometry, name)
                np.testing.assert_allclose(now, was, atol=1e-9)
            assert after.battery.fraction == pytest.approx(before.battery.fraction)
            assert after.battery.current == 4.0
            assert before.gps is not None
            assert after.gps is not None
            assert after.gps.latitude == before.gps.latitude
            assert after.gps.horizontal_sigma == 1.0
        for was_shot, shot in zip(shots(one), shots(other), strict=True):
            assert shot.record.value.data == was_shot.record.value.data
            assert shot.header.source == "tello/camera"
        environment = json.loads(other.attachment("environment.json"))
        sensors = {sensor["id"]: sensor for sensor in environment["robots"][0]["sensors"]}
        lens = sensors["camera"]["settings"]
        assert (lens["width"], lens["height"]) == (320, 180)
        assert lens["horizontal_fov"] == pytest.approx(math.degrees(1.4), abs=1e-3)
        assert lens["mount"] == [0.1, 0.0, 0.0]
        assert lens["pitch"] == pytest.approx(math.degrees(0.3), abs=1e-3)
        assert sensors["odometry"]["rate"] == pytest.approx(5)
        assert environment["home"]["latitude"] == pytest.approx(12.97, abs=1e-7)


def test_signs_of_a_leaning_vehicle() -> None:
    """Eastwards with the nose 30 degrees down, the body sees itself move forwards and upwards."""
    value = Odometry(np.zeros(3), np.array([1.0, 0.0, 0.0]), 0.0, 0.0, math.radians(30), 0.2)
    twist = MessageBuilder(0).odometry(value, 0, "drone").twist.twist
    assert twist.linear.x == pytest.approx(math.cos(math.radians(30)))
    assert twist.linear.z == pytest.approx(math.sin(math.radians(30)))
    assert twist.angular.x == pytest.approx(-0.2 * math.sin(math.radians(30)))
    assert twist.angular.z == pytest.approx(0.2 * math.cos(math.radians(30)))


@given(
    st.floats(-math.pi + 1e-6, math.pi),
    st.floats(-1.4, 1.4),
    st.floats(-3.1, 3.1),
    st.floats(-3, 3),
)
def test_any_attitude_comes_back(yaw: float, pitch: float, roll: float, rate: float) -> None:
    """Velocity, angles and the yaw's rate survive the body's axes and the quaternion."""
    velocity = np.array([3.0, -2.0, 0.5])
    value = Odometry(np.array([1.0, 2.0, 3.0]), velocity, yaw, roll, pitch, rate, 0.5)
    found = odometry_of(MessageBuilder(0).odometry(value, 0, "drone"))
    np.testing.assert_allclose(found.velocity, velocity, atol=1e-9)
    np.testing.assert_allclose(
        rotation_from_rpy(found.roll, found.pitch, found.yaw),
        rotation_from_rpy(roll, pitch, yaw),
        atol=1e-7,
    )
    assert found.yaw_rate == pytest.approx(rate, abs=1e-6)
    assert found.position_sigma == pytest.approx(0.5)


def test_depth_and_video_are_written_too(tmp_path: Path) -> None:
    """Depth as 16UC1 in millimetres; pictures of a video as JPEG."""
    path = tmp_path / "flight.mcap"
    depth = np.full((48, 64), 1234, np.uint16)
    image = np.full((48, 64, 3), (30, 160, 90), np.uint8)
    config = RecordingConfig(images="h264")
    with FlightRecorder(path, config=config, provenance=PROVENANCE) as recorder:
        for number in range(3):
            header = Header(number, number * 100_000_000, "drone/cam")
            item = Frame(header, image, depth=depth)
            recorder.write(Message("drone/cam", number, header.stamp, header, 0, (), item))
    with Recording.open(path) as recording:
        found = read(write_bag(recording, tmp_path))
    measured = found["/drone/cam/aligned_depth"][0][1]
    assert measured.encoding == "16UC1"
    pixels = measured.data.view("<u2").reshape(measured.height, measured.step // 2)
    np.testing.assert_array_equal(pixels, depth)
    pictures = [message for _, message in found["/drone/cam/image/compressed"]]
    assert len(pictures) == 3
    decoded = cv2.imdecode(pictures[0].data, cv2.IMREAD_COLOR)
    assert decoded is not None
    np.testing.assert_allclose(decoded, image, atol=6)


def test_raw_pictures_and_a_simulations_clock(tmp_path: Path) -> None:
    """An rgb8 picture, stamped from zero on, is recorded in its colours, by the bag's time."""
    image = np.zeros((32, 48, 3), np.uint8)
    image[:] = (250, 120, 10)
    sent = []
    for number in range(4):
        data = image.reshape(-1)
        message = ros_message(IMAGE, height=32, width=48, encoding="rgb8", step=3 * 48, data=data)
        message.header.frame_id = "lens"
        message.header.stamp.sec, message.header.stamp.nanosec = 7, number * 100_000_000
        # It runs at half the speed of the clock.
        sent.append(Sent("/cam/image_raw", EPOCH + number * 200_000_000, message))
    folder = write(tmp_path / "bag", sent)
    config = RecordingConfig(images="png")
    with RosBag.open(folder) as opened:
        topics = BagTopics(camera={"front": "/cam/image_raw"})
        done = import_bag(opened, topics, tmp_path / "flight.mcap", config)
    assert done.lenses == {"front": False}
    with Recording.open(tmp_path / "flight.mcap") as recording:
        assert recording.epoch_ns == EPOCH
        found = list(frames(recording))
    assert [frame.header.stamp for frame in found] == [0, 10**8, 2 * 10**8, 3 * 10**8]
    np.testing.assert_array_equal(found[0].image, image[..., ::-1])


def test_a_split_bag_is_one(tmp_path: Path) -> None:
    """The files of a folder are read together, in the order of time, whatever they are called."""
    late = write(tmp_path / "late", [odometry(index) for index in range(10, 20)])
    write(tmp_path / "a", [odometry(index) for index in range(10)])
    (tmp_path / "a" / "a.mcap").rename(late / "z.mcap")
    with RosBag.open(late) as opened:
        assert opened.topics["/odom"].count == 20
        times = [message.time for message in opened.messages(["/odom"])]
    assert times == sorted(times)
    assert len(times) == 20


def test_the_commands_list_and_convert(recorded: Path, tmp_path: Path) -> None:
    """Without topics the bag's are listed, each with the option that takes it."""
    runner = CliRunner()
    out = str(tmp_path)
    result = runner.invoke(app, ["export", "ros2", str(recorded), "--out", out])
    assert result.exit_code == 0, result.output
    folder = tmp_path / "flight_mcap"
    listed = runner.invoke(app, ["import", str(folder)]).output
    assert "--odometry /tello/odometry" in listed
    assert "--camera /tello/camera/image/compressed" in listed
    words = ["--robot", "tello", "--odometry", "/tello/odometry", "--out", f"{out}/back"]
    result = runner.invoke(app, ["import", str(folder), *words])
    assert result.exit_code == 0, result.output
    with Recording.open(tmp_path / "back" / "flight.mcap") as recording:
        assert "/tello/odometry" in recording.topics


def test_a_bag_is_written_whole_or_not_at_all(recorded: Path, tmp_path: Path) -> None:
    """Nothing is overwritten, and nothing without metadata is left."""
    with Recording.open(recorded) as recording:
        write_bag(recording, tmp_path)
        with pytest.raises(RecordingError, match="already exists"):
            write_bag(recording, tmp_path)
    bare = tmp_path / "bare.mcap"
    with FlightRecorder(bare, config=RecordingConfig(), provenance=PROVENANCE):
        pass
    with (
        Recording.open(bare) as recording,
        pytest.raises(RecordingError, match="no states, pictures"),
    ):
        write_bag(recording, tmp_path)
    assert not (tmp_path / "bare_mcap").exists()


def stamp(message: Any) -> int:  # noqa: ANN401 - a ROS message
    """Nanoseconds of a header's stamp."""
    return int(message.header.stamp.sec * 10**9 + message.header.stamp.nanosec)


def matrix(quaternion: Any) -> Any:  # noqa: ANN401
    """Rotation matrix of a ROS quaternion, by the usual formula."""
    x, y, z, w = quaternion.x, quaternion.y, quaternion.z, quaternion.w
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def test_a_bag_has_the_files_as_they_were(tmp_path: Path) -> None:
    """The same ones, by the format that they have."""
    with Recording.open(strange_pictures(tmp_path)) as recording:
        bag = write_bag(recording, tmp_path)
    messages = [message for _, message in read(bag)["/front/image/compressed"]]
    assert [message.format for message in messages] == ["jpeg", "png", "webp"]
    assert messages[1].data.tobytes() == encoded(".png")
