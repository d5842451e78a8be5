"""ROS 2 bags of strangers: cut off, damaged, or made to harm. Each costs an error or a count."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path

import pytest
from ros_bags import SECOND, TYPES, Sent, odometry, write

from aerodaas.errors import RecordingError
from aerodaas.extensions.ros2.bags.bag import RosBag
from aerodaas.extensions.ros2.bags.bag_preview import BagTopics
from aerodaas.extensions.ros2.bags.importing import ImportedBag, import_bag
from aerodaas.extensions.ros2.topics.types import TRANSFORMS, ros_decoder, ros_message

TOPICS = BagTopics(odometry="/odom")


def imported(bag: Path, folder: Path, topics: BagTopics = TOPICS) -> ImportedBag:
    """Import a bag."""
    with RosBag.open(bag) as opened:
        return import_bag(opened, topics, folder / "flight.mcap")


def cut_off(folder: Path, share: float) -> Path:
    """A bag of which only the first part is there, as after a crash."""
    bag = write(folder / "bag", [odometry(index) for index in range(4000)])
    (file,) = bag.glob("*.mcap")
    content = file.read_bytes()
    file.write_bytes(content[: round(len(content) * share)])
    return bag


def test_what_is_whole_of_a_cut_off_bag_is_taken(tmp_path: Path) -> None:
    """As of any MCAP file."""
    done = imported(cut_off(tmp_path, 2 / 3), tmp_path)
    assert not done.complete
    assert 0 < done.summary.channels["/drone/state"] < 4000


def test_a_bag_that_holds_nothing_whole_is_told(tmp_path: Path) -> None:
    """As a recording that is empty."""
    with pytest.raises(RecordingError, match="no whole message"):
        imported(cut_off(tmp_path, 1e-4), tmp_path)


def test_lengths_that_lie_cost_no_memory() -> None:
    """A sequence of four billion transforms in sixty bytes; a message larger than any."""
    with pytest.raises(Exception, match=r".") as caught:
        ros_decoder(TRANSFORMS)(b"\x00\x01\x00\x00" + struct.pack("<I", 2**32 - 1) + bytes(60))
    assert not isinstance(caught.value, MemoryError)
    moved = ros_message("geometry_msgs/msg/TransformStamped")
    many = ros_message(TRANSFORMS, transforms=[moved] * 20_000)
    with pytest.raises(ValueError, match="exceeds"):
        ros_decoder(TRANSFORMS)(bytes(TYPES.serialize_cdr(many, TRANSFORMS)))


def spoilt(change: Callable[[Sent], None]) -> list[Sent]:
    """Ten odometries, the sixth of which is changed."""
    sent = [odometry(index) for index in range(10)]
    change(sent[5])
    return sent


def _not_finite(sent: Sent) -> None:
    sent.value.pose.pose.position.x = float("nan")


def _no_rotation(sent: Sent) -> None:
    sent.value.pose.pose.orientation.w = 0.0
    sent.value.pose.pose.orientation.z = 0.0


def _far_future(sent: Sent) -> None:
    sent.value.header.stamp.sec = 2**31 - 1


def _repeated(sent: Sent) -> None:
    sent.value.header.stamp.nanosec = 0


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (_not_finite, "vector"),
        (_no_rotation, "quaternion"),
        (_far_future, "too far"),
        (_repeated, "not newer"),
    ],
)
def test_a_message_that_is_nonsense_costs_itself(
    tmp_path: Path, change: Callable[[Sent], None], reason: str
) -> None:
    """It is counted and told with its reason; the others are taken."""
    done = imported(write(tmp_path / "bag", spoilt(change)), tmp_path)
    count, told = done.skipped["/odom"]
    assert (count, done.summary.channels["/drone/state"]) == (1, 9)
    assert reason in told


@pytest.mark.parametrize("frame", ["odom_ned", "map_ned", "NED"])
def test_odometry_in_another_frame_is_refused(tmp_path: Path, frame: str) -> None:
    """In NED every sign would be wrong; nothing is left of the attempt."""
    bag = write(tmp_path / "bag", [odometry(index, frame=frame) for index in range(3)])
    with pytest.raises(RecordingError, match="REP 103"):
        imported(bag, tmp_path)
    assert not (tmp_path / "flight.mcap").exists()


def test_topics_that_do_not_fit_are_told_with_those_that_do(tmp_path: Path) -> None:
    """Unknown, of another type, none."""
    bag = write(tmp_path / "bag", [odometry(0)])
    cases = [
        (BagTopics(odometry="/nowhere"), "/nowhere is not there.*the bag has: /odom"),
        (BagTopics(camera={"c": "/odom"}), "is nav_msgs/msg/Odometry; camera takes"),
        (BagTopics(), "at least a camera or odometry"),
    ]
    for topics, words in cases:
        with pytest.raises(RecordingError, match=words):
            imported(bag, tmp_path, topics)


def test_what_is_no_bag_is_told(tmp_path: Path) -> None:
    """With what to give instead."""
    other = tmp_path / "flight.bag"
    other.write_bytes(b"#ROSBAG V2.0\n")
    sqlite = write(tmp_path / "sqlite", [odometry(0)], "SQLITE3")
    for path in (other, sqlite, sqlite / "sqlite.db3"):
        with pytest.raises(RecordingError, match=rf"rosbags-convert --src {path} .*mcap"):
            RosBag.open(path)
    (tmp_path / "empty").mkdir()
    with pytest.raises(RecordingError, match=r"holds 0 .mcap files"):
        RosBag.open(tmp_path / "empty")
    (tmp_path / "empty" / "a.db3.zstd").write_bytes(b"")
    with pytest.raises(RecordingError, match="unzstd"):
        RosBag.open(tmp_path / "empty")
    with pytest.raises(RecordingError, match="No such file"):
        RosBag.open(tmp_path / "nowhere")


def test_the_start_is_that_of_the_first_message(tmp_path: Path) -> None:
    """Capture times count from the earliest, whatever the bag's own clock was late by."""
    sent = [odometry(index, late=SECOND // 50) for index in range(5)]
    done = imported(write(tmp_path / "bag", sent), tmp_path)
    assert done.complete
    assert done.summary.duration == pytest.approx(0.4)
