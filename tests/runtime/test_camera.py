"""The camera node: pictures at the sensor's rate, where the vehicle was, and the last picture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hosts import Hand, item_of, published

from aerodaas.cameras.base import Picture
from aerodaas.clock import NANOSECONDS, SimulatedClock
from aerodaas.config.model import EnvironmentConfig, SensorConfig
from aerodaas.errors import SourceError
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Frame
from aerodaas.messages.odometry import Battery, Odometry
from aerodaas.messages.vehicle import VehicleMode, VehicleState
from aerodaas.mission.commands import End
from aerodaas.runtime.nodes.camera import CameraNode
from aerodaas.runtime.session import Session
from aerodaas.runtime.stream_names import end_stream

_STREAM, _STATE = "drone/cam", "drone/@state"


class Film:
    """Shows pictures whose pixels count up, without those that it `misses`, then has no more."""

    model = None
    skipped = 3

    def __init__(self, sensor: SensorConfig, environment: EnvironmentConfig) -> None:
        del environment
        self._settings = sensor.settings
        self._shown = 0
        self.poses: list[Odometry | None] = []
        self.closed = 0

    def open(self) -> None:
        """Open, unless the test wants otherwise."""
        if self._settings.get("broken"):
            raise SourceError("no such film")

    @property
    def finished(self) -> bool:
        """Whether all were shown."""
        return self._shown >= self._settings.get("length", 1000)

    def capture(self, stamp: int, pose: Odometry | None) -> Picture | None:
        """Show the next one."""
        self.poses.append(pose)
        number = self._shown
        self._shown += 1
        if number in self._settings.get("misses", ()) or self._shown > self._settings.get(
            "length", 1000
        ):
            return None
        own = place(9.0) if self._settings.get("placed") else None
        late = self._settings.get("late", 0)
        return Picture(np.full((2, 2, 3), number, np.uint8), stamp - late, odometry=own)

    def close(self) -> None:
        """Count the calls."""
        self.closed += 1


def place(east: float) -> Odometry:
    """So far to the east."""
    return Odometry(np.array([east, 0.0, 0.0]), np.zeros(3), 0.0)


def state(stamp: int, east: float) -> Message[Any]:
    """A message of the vehicle's state; its estimate is a metre off."""
    item = VehicleState(
        stamp, place(east + 1), Battery(1.0), VehicleMode.GUIDED, armed=True, truth=place(east)
    )
    return published(_STATE, item, stamp)


def made(*, ends: bool = False, rate: float = 5.0, **settings: Any) -> CameraNode:  # noqa: ANN401
    """The node of a film."""
    sensor = {"id": "cam", "type": "camera", "rate": rate, "driver": f"{__name__}:Film"}
    robot = {"id": "drone", "sensors": [{**sensor, "settings": settings}]}
    environment = EnvironmentConfig.model_validate({"robots": [robot]})
    (config,) = environment.robots[0].sensors
    return CameraNode(Session(environment, None), _STREAM, config, _STATE, ends=ends)


def started(**words: Any) -> CameraNode:  # noqa: ANN401
    """The same, opened and started."""
    node = made(**words)
    node.open(Hand())
    node.start(SimulatedClock())
    return node


def shown(node: CameraNode, count: int, *inputs: Message[Any]) -> list[Message[Any]]:
    """What the next `count` steps at its own times publish; `inputs` come with the first."""
    found: list[Message[Any]] = []
    arrived: Sequence[Message[Any]] = inputs
    for _ in range(count):
        found += node.step(node.due, arrived)
        arrived = ()
    return found


def test_frames_come_at_the_sensors_rate() -> None:
    """Numbered and stamped by mission time, the first at zero."""
    frames = shown(started(rate=5.0), 4)
    assert [frame.header.stamp for frame in frames] == [
        NANOSECONDS * number // 5 for number in range(4)
    ]
    assert [item_of(frame).header.id for frame in frames] == [0, 1, 2, 3]
    assert [int(item_of(frame).image[0, 0, 0]) for frame in frames] == [0, 1, 2, 3]
    assert {frame.stream for frame in frames} == {_STREAM}


def test_a_camera_that_is_not_due_shows_nothing() -> None:
    """A step before its time only takes the messages."""
    node = started()
    shown(node, 1)
    due = node.due
    assert list(node.step(due - 1, [state(due - 1, 4.0)])) == []
    (frame,) = node.step(due, [])
    assert item_of(frame).odometry.position[0] == 5.0


def test_frames_carry_the_newest_estimate_and_the_camera_gets_the_truth() -> None:
    """Before the first state there is neither."""
    node = started()
    (first,) = shown(node, 1)
    assert item_of(first).odometry is None
    (second,) = shown(node, 1, state(1, 1.0), state(2, 2.0))
    assert item_of(second).odometry.position[0] == 3.0
    assert isinstance(node.camera, Film)
    before, after = node.camera.poses
    assert before is None
    assert after is not None
    assert after.position[0] == 2.0


def test_a_pictures_own_odometry_counts() -> None:
    """As that of a recorded flight."""
    (frame,) = shown(started(placed=True), 1, state(0, 1.0))
    assert item_of(frame).odometry.position[0] == 9.0


def test_a_missing_picture_is_no_frame() -> None:
    """The next one has the next number."""
    frames = shown(started(misses=[1, 2]), 4)
    assert [item_of(frame).header.id for frame in frames] == [0, 1]
    assert [int(item_of(frame).image[0, 0, 0]) for frame in frames] == [0, 3]


def test_a_picture_that_is_old_already_is_stamped_by_its_own_time() -> None:
    """And its age counts as latency."""
    node = started(late=NANOSECONDS // 10)
    shown(node, 1)
    (frame,) = shown(node, 1)
    assert item_of(frame).header.stamp == NANOSECONDS // 10
    assert node.outlet(_STREAM).latencies.newest(1)[0] >= 100.0


@pytest.mark.parametrize("ends", [True, False])
def test_the_last_picture_ends_the_mission_if_it_is_to(*, ends: bool) -> None:
    """Once, with the last picture."""
    node = started(length=2, ends=ends)
    found = shown(node, 4)
    assert [isinstance(message.item, Frame) for message in found[:2]] == [True, True]
    assert [message.stream for message in found[2:]] == [end_stream(_STREAM)] * ends
    assert [message.item for message in found[2:]] == [End("drone/cam has no more pictures")] * ends
    assert node.finished
    assert node.values() == {"skipped": {"drone/cam": 3}, "finished": {"drone/cam": True}}


def test_a_camera_that_could_be_opened_is_closed_once() -> None:
    """And says nothing of itself any more."""
    node = started()
    node.close()
    node.close()
    assert isinstance(node.camera, Film)
    assert node.camera.closed == 1
    assert node.values() == {}


def test_a_camera_that_cannot_be_opened_is_refused_by_name() -> None:
    """What it holds by then is released."""
    node = made(broken=True)
    with pytest.raises(SourceError, match="no such film"):
        node.open(Hand())
    node.close()
    assert isinstance(node.camera, Film)
    assert node.camera.closed == 1


def test_a_frame_cannot_be_written_to() -> None:
    """All its readers are given the same pixels."""
    (frame,) = shown(started(), 1)
    with pytest.raises(ValueError, match="read-only"):
        item_of(frame).image[0, 0, 0] = 1
