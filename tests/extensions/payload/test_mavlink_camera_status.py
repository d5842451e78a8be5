"""What a camera says that it is and does, and pictures of which only its count tells."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from emulated import Stepped, told
from hypothesis import given
from hypothesis import strategies as st
from surveyors import find_payload, patience, payload_of, photo_outcome, take_photo

from aerodaas.clock import NANOSECONDS, SimulatedClock
from aerodaas.config.model import LimitsConfig
from aerodaas.config.sections.preflight import PreflightConfig
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.errors import VehicleError
from aerodaas.extensions.payload.equipment import LensCamera, LensTarget, PhotoFailure
from aerodaas.extensions.payload.mavlink.camera_status import with_capture, with_model
from aerodaas.messages.health import HealthItem, Verdict
from aerodaas.messages.payload import CameraStatus, Photo
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.safety.checklist import Checklist
from tools.mavlink_vehicle import AutopilotOptions
from tools.mavlink_vehicle.payload import EmulatedPayload

CAMERA, GIMBAL = 100, 154


@pytest.fixture
def ends(monkeypatch: pytest.MonkeyPatch) -> Stepped:
    """A vehicle whose camera and gimbal speak for themselves."""
    return Stepped(monkeypatch, AutopilotOptions(components=(CAMERA, GIMBAL)))


def payload(ends: Stepped) -> EmulatedPayload:
    """The emulated camera."""
    return ends.autopilot.components[CAMERA].payload


def ready(ends: Stepped) -> None:
    """Wait until the camera has told how many pictures it took."""
    find_payload(ends)
    ends.wait(lambda: [one.taken for one in payload_of(ends.vehicle).cameras()] != [None])


def camera_item(ends: Stepped, **policy: str) -> HealthItem | None:
    """The camera's in the list before take-off."""
    levels = PreflightConfig.model_validate(policy)
    checklist = Checklist(ends.vehicle, LimitsConfig(), levels)
    items = checklist.examine(ends.vehicle.read())
    return next((one for one in items if one.name == "camera"), None)


def test_a_camera_tells_what_it_is_and_does(ends: Stepped) -> None:
    """Model, lens, room, pictures, interval and video, anew every ten seconds; before take-off."""
    with ends:
        payload(ends).free = 12_000.0
        ready(ends)
        ends.watch(3.0)
        (status,) = payload_of(ends.vehicle).cameras()
        view = math.degrees(2 * math.atan(13.2 / 2 / 8.8))
        assert status.view == pytest.approx(view, abs=1e-3)
        assert replace(status, view=None) == CameraStatus(
            "camera (component 100)", "emulated", (5472, 3648), free=12_000.0, taken=0
        )
        item = camera_item(ends)
        assert item is not None
        assert item.verdict is Verdict.GOOD
        assert item.value == (
            "camera (component 100): emulated, 5472x3648, sees 74 degrees across, "
            "12000 MiB free, 0 pictures taken"
        )
        payload(ends).interval, payload(ends).recording = 2.0, 12.0
        ends.watch(12.0)
        item = camera_item(ends)
        assert item is not None
        assert item.value.endswith("takes one every 2 s, has been recording for 12 s")


def test_a_camera_that_knows_the_former_requests_alone(ends: Stepped) -> None:
    """What it refuses by MAV_CMD_REQUEST_MESSAGE is asked for by the commands of former days."""
    with ends:
        camera = ends.autopilot.components[CAMERA]
        camera.former = True
        payload(ends).free, payload(ends).video = 12_000.0, "rtsp://127.0.0.1/main"
        ready(ends)
        ends.wait(lambda: payload_of(ends.vehicle).cameras()[0].free == 12_000.0)
        ends.wait(payload_of(ends.vehicle).streams)
        wanted = [one.command for one in camera.heard if one.get_type() == "COMMAND_LONG"]
        ends.watch(8.0)
        newer = [one.command for one in camera.heard if one.get_type() == "COMMAND_LONG"]
    refused = wanted.count(mavlink.MAV_CMD_REQUEST_MESSAGE)
    assert refused == 4
    assert newer.count(mavlink.MAV_CMD_REQUEST_MESSAGE) == refused
    assert newer.count(mavlink.MAV_CMD_REQUEST_CAMERA_INFORMATION) == 1


def test_a_picture_whose_message_is_lost_is_taken_by_the_count(ends: Stepped) -> None:
    """Within seconds, at the time of the camera's word, and without its own place."""
    with ends:
        ready(ends)
        clock = SimulatedClock()
        ends.vehicle.use_clock(clock)
        payload(ends).mute = True
        asked = ends.now
        number = take_photo(ends)
        # Time and place are those of the camera's word, not of its count.
        ends.wait(lambda: payload(ends).taken)
        clock.advance_to(NANOSECONDS)
        photo = photo_outcome(ends, 6.0)
        assert isinstance(photo, Photo)
        assert photo.stamp == 0
        assert (photo.number, photo.label, photo.place, photo.file) == (number, "wp1", None, "")
        assert photo.odometry is not None
        assert photo.gimbal is not None
        assert ends.now - asked < 4.0
        # The next one is told as ever, with its own name.
        payload(ends).mute = False
        second = take_photo(ends)
        photo = photo_outcome(ends)
        assert isinstance(photo, Photo)
        assert (photo.number, photo.file) == (second, "DCIM/0002.JPG")
        (status,) = payload_of(ends.vehicle).cameras()
        assert status.taken == 1


def _blind(camera: EmulatedPayload) -> None:
    camera.blind = True


def _countless(camera: EmulatedPayload) -> None:
    camera.counts, camera.mute = False, True


def _busy(camera: EmulatedPayload) -> None:
    camera.interval, camera.mute = 1.0, True


@pytest.mark.parametrize("strike", [_blind, _countless, _busy])
def test_a_picture_that_nothing_tells_of_is_lost(ends: Stepped, strike: object) -> None:
    """Not taken; no count; or the camera takes others by itself, and whose is it then."""
    with ends:
        find_payload(ends)
        assert callable(strike)
        strike(payload(ends))
        ends.watch(12.0)
        number = take_photo(ends)
        failure = photo_outcome(ends, 10.0)
        assert failure == PhotoFailure(number, "the camera does not tell of the picture")


@given(
    image=st.integers(0, 255),
    video=st.integers(0, 255),
    interval=st.floats(width=32),
    free=st.floats(width=32),
    count=st.integers(-(2**31), 2**31 - 1),
)
def test_no_status_is_too_odd(
    image: int, video: int, interval: float, free: float, count: int
) -> None:
    """Whatever it holds, what is read of it is finite and not negative."""
    message = mavlink.MAVLink_camera_capture_status_message(
        0, image, video, interval, 1500, free, count
    )
    status = with_capture(CameraStatus("camera"), message)
    for value in (status.taken, status.interval, status.recording, status.free):
        assert value is None or 0.0 <= value < math.inf
    assert (status.recording == 1.5) == (video == 1)
    assert (status.interval is None) == (image not in {2, 3})


@given(
    names=st.lists(st.integers(0, 255), min_size=32, max_size=32),
    focal=st.floats(width=32),
    sensor=st.floats(width=32),
    pixels=st.integers(0, 65535),
)
def test_no_camera_is_too_odd(names: list[int], focal: float, sensor: float, pixels: int) -> None:
    """A name is printable, a view an angle."""
    message = mavlink.MAVLink_camera_information_message(
        0, names, names, 0, focal, sensor, 1.0, pixels, 10, 0, 0, 0, b""
    )
    known = with_model(CameraStatus("camera"), message)
    assert known.model.isascii()
    assert known.model.isprintable()
    assert known.view is None or 0.0 < known.view < 180.0
    assert (known.pixels is None) == (pixels == 0)


ABLE = mavlink.CAMERA_CAP_FLAGS_CAPTURE_IMAGE | mavlink.CAMERA_CAP_FLAGS_HAS_BASIC_ZOOM


def lens_of(ends: Stepped) -> LensCamera:
    """The camera, whose lens can be set."""
    camera = payload_of(ends.vehicle).photo_camera
    assert isinstance(camera, LensCamera)
    return camera


def test_zoom_and_focus_are_set_in_percent(ends: Stepped) -> None:
    """Acknowledged before it counts; what the camera says that it has not is refused at once."""
    with ends:
        payload(ends).flags = ABLE | mavlink.CAMERA_CAP_FLAGS_HAS_BASIC_FOCUS
        find_payload(ends)
        camera = lens_of(ends)
        camera.adjust(LensTarget(40.0, 100.0))
        assert not camera.adjusted
        ends.wait(lambda: camera.adjusted)
        assert payload(ends).lens == {"zoom": 40.0, "focus": 100.0}
        payload(ends).lens_refuses = True
        camera.adjust(LensTarget(10.0))
        ends.wait(lambda: camera.lens_fault)
        assert (camera.adjusted, camera.lens_fault) == (False, "zoom: denied")
        payload(ends).lens_refuses = False
        camera.adjust(LensTarget(20.0))
        ends.wait(lambda: camera.adjusted)
        assert payload(ends).lens["zoom"] == 20.0


def test_a_lens_without_zoom_or_focus_is_told(ends: Stepped) -> None:
    """By the flags of its CAMERA_INFORMATION; the drone flies on."""
    with ends:
        payload(ends).flags = ABLE
        find_payload(ends)
        with pytest.raises(VehicleError, match="focus of the camera cannot be set"):
            lens_of(ends).adjust(LensTarget(focus=3.0))
        stop = Waypoint("a", 3, 0, 2, zoom=30.0, focus=5.0, photo=True)
        mission = ends.mission([stop], patience(4.0)).fly()
        assert mission.status.photos == (0, 1)
        assert told(mission, "photo") == ["a: no picture: the focus of the camera cannot be set"]
        camera = lens_of(ends)
        ends.autopilot.components[CAMERA].vanished = True
        ends.watch(6.0)
        with pytest.raises(VehicleError, match="no camera answers"):
            camera.adjust(LensTarget(30.0))
