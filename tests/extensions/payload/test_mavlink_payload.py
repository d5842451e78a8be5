"""Gimbals and cameras by MAVLink's protocols v2: found, aimed, heard, and lost."""

from __future__ import annotations

import math

import pytest
from emulated import Stepped, told
from hypothesis import given
from hypothesis import strategies as st
from surveyors import find_payload, fly_pictures, payload_of, photo_outcome, take_photo

from aerodaas.drivers.mavlink.microservices.commander import Commander
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.extensions.payload.equipment import GimbalTarget, PhotoFailure
from aerodaas.extensions.payload.mavlink.gimbal import MavlinkGimbal
from aerodaas.messages.mission import MissionState
from aerodaas.messages.payload import Photo
from tools.mavlink_vehicle import AutopilotOptions
from tools.mavlink_vehicle.payload import EmulatedPayload

FAMILIES = ("px4", "ardupilot")


@pytest.fixture(params=FAMILIES)
def ends(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Stepped:
    """Both families, with both components."""
    return Stepped(monkeypatch, AutopilotOptions(family=request.param, gimbal=True, camera=True))


def carried(ends: Stepped) -> EmulatedPayload:
    """What goes wrong with them."""
    return ends.autopilot.firmware.payload


def test_down_and_left_are_down_and_left(ends: Stepped) -> None:
    """Ours are counted upwards and to the left; MAVLink's upwards and to the right."""
    with ends:
        find_payload(ends)
        gimbal = payload_of(ends.vehicle).gimbal
        assert gimbal is not None
        assert gimbal.aim(GimbalTarget(-0.8, 0.5)) == GimbalTarget(-0.8, 0.5)
        ends.watch(3.0)
        theirs = carried(ends)
        assert theirs.pitch == pytest.approx(-0.8, abs=1e-3)
        assert theirs.right == pytest.approx(-0.5, abs=1e-3)
        state = ends.turn()
        assert state.gimbal is not None
        assert state.gimbal.pitch == pytest.approx(-0.8, abs=1e-3)
        assert state.gimbal.yaw == pytest.approx(0.5, abs=1e-3)
        assert state.stamp - state.gimbal.stamp < 0.5e9
        assert theirs.controller == (-2.0, 0.0)


def test_a_target_is_clipped_to_what_the_gimbal_told(ends: Stepped) -> None:
    """Its range is in GIMBAL_MANAGER_INFORMATION: 90 degrees down, 20 up, 170 to either side."""
    with ends:
        find_payload(ends)
        gimbal = payload_of(ends.vehicle).gimbal
        assert gimbal is not None
        clipped = gimbal.aim(GimbalTarget(1.0, -3.1))
        assert clipped.pitch == pytest.approx(math.radians(20))
        assert clipped.yaw == pytest.approx(-math.radians(170))


def test_a_picture_has_the_autopilots_place(ends: Stepped) -> None:
    """Above the sea, with number and label of the request."""
    with ends:
        find_payload(ends)
        number = take_photo(ends)
        photo = photo_outcome(ends)
        assert isinstance(photo, Photo)
        assert (photo.number, photo.label) == (number, "wp1")
        assert photo.place is not None
        assert photo.place.latitude == pytest.approx(47.397742, abs=1e-6)
        assert photo.place.longitude == pytest.approx(8.545594, abs=1e-6)
        assert photo.place.altitude == pytest.approx(488.0, abs=0.5)
        assert photo.place.datum == "sea"
        assert photo.odometry is not None
        assert photo.gimbal is not None
        assert photo.file in {"DCIM/0001.JPG", "picture 1"}
        assert take_photo(ends) == number + 1
        assert isinstance(photo_outcome(ends), Photo)
        assert len(carried(ends).taken) == 2


@pytest.mark.parametrize(
    ("fault", "said"),
    [("camera_refuses", "failed"), ("blind", "does not tell of the picture")],
)
def test_a_picture_that_fails_is_told(ends: Stepped, fault: str, said: str) -> None:
    """At once where it is refused, after some seconds where nothing comes."""
    with ends:
        find_payload(ends)
        setattr(carried(ends), fault, True)
        number = take_photo(ends)
        failure = photo_outcome(ends)
        assert isinstance(failure, PhotoFailure)
        assert failure.number == number
        assert said in failure.reason
        setattr(carried(ends), fault, False)
        take_photo(ends)
        assert isinstance(photo_outcome(ends), Photo)


def test_a_gimbal_that_refuses_says_so(ends: Stepped) -> None:
    """The result of the command, in words."""
    with ends:
        find_payload(ends)
        gimbal = payload_of(ends.vehicle).gimbal
        assert gimbal is not None
        carried(ends).gimbal_refuses = True
        gimbal.aim(GimbalTarget(-1.0, 0.0))
        ends.watch(1.0)
        assert gimbal.fault == "denied"
        carried(ends).gimbal_refuses = False
        gimbal.aim(GimbalTarget(-1.0, 0.0))
        ends.watch(1.0)
        assert gimbal.fault == ""


def test_an_attitude_that_is_none_is_no_word(ends: Stepped) -> None:
    """The last one ages, and in the end the gimbal counts as gone; it may come back."""
    with ends:
        find_payload(ends)
        carried(ends).nonsense = True
        ends.watch(1.0)
        state = ends.turn()
        assert state.gimbal is not None
        assert math.isfinite(state.gimbal.pitch)
        ends.watch(5.0)
        assert payload_of(ends.vehicle).gimbal is None
        carried(ends).nonsense = False
        ends.watch(1.0)
        assert payload_of(ends.vehicle).gimbal is not None


@pytest.mark.parametrize("family", FAMILIES)
def test_a_vehicle_without_them_is_left_alone(monkeypatch: pytest.MonkeyPatch, family: str) -> None:
    """It is asked once for each, refuses, and is not asked again."""
    with Stepped(monkeypatch, AutopilotOptions(family=family)) as ends:  # type: ignore[arg-type]
        ends.watch(12.0)
        assert payload_of(ends.vehicle).gimbal is None
        assert payload_of(ends.vehicle).photo_camera is None
        asked = [
            message.param1
            for _, message in ends.autopilot.heard
            if message.get_type() == "COMMAND_LONG"
            and message.command == mavlink.MAV_CMD_REQUEST_MESSAGE
        ]
        for wanted in (280, 259):
            assert asked.count(wanted) == 1


def gimbal_of(*ranges: float) -> MavlinkGimbal:
    """A gimbal whose manager told these ranges."""
    told = mavlink.MAVLink_gimbal_manager_information_message(0, 0, 1, *ranges)
    return MavlinkGimbal(told, Commander(lambda _: None, (1, 1), 245))


def status(flags: int, quaternion: list[float], device: int = 1) -> object:
    """One attitude, as it is told."""
    message = mavlink.MAVLink_gimbal_device_attitude_status_message(
        0, 0, 0, flags, quaternion, math.nan, math.nan, math.nan, 0
    )
    message.gimbal_device_id = device
    return message


FREE = (-math.inf, math.inf, -math.inf, math.inf, -math.inf, math.inf)


def test_a_yaw_from_north_is_turned_to_the_nose() -> None:
    """A locked gimbal tells it so: looking east (90 degrees) from a nose to the north."""
    gimbal = gimbal_of(*FREE)
    east = [math.cos(math.pi / 4), 0.0, 0.0, math.sin(math.pi / 4)]
    gimbal.on_attitude(status(mavlink.GIMBAL_DEVICE_FLAGS_YAW_LOCK, east), 0.0, 7, 0.0)
    assert gimbal.attitude is not None
    assert gimbal.attitude.yaw == pytest.approx(-math.pi / 2)
    gimbal.on_attitude(status(0, east), 0.0, 7, 1.0)
    assert gimbal.attitude.yaw == pytest.approx(-math.pi / 2)
    gimbal.on_attitude(status(mavlink.GIMBAL_DEVICE_FLAGS_YAW_LOCK, east), 0.0, 7, math.pi / 2)
    assert gimbal.attitude.yaw == pytest.approx(0.0)


@given(
    st.integers(0, 65535),
    st.lists(st.floats(width=32), min_size=4, max_size=4),
    st.integers(0, 255),
)
def test_no_attitude_is_anything_but_finite(
    flags: int, quaternion: list[float], device: int
) -> None:
    """Whatever a gimbal tells."""
    gimbal = gimbal_of(*FREE)
    gimbal.on_attitude(status(flags, quaternion, device), 0.0, 7, 0.0)
    seen = gimbal.attitude
    assert seen is None or all(map(math.isfinite, (seen.pitch, seen.yaw, seen.roll)))


def test_a_mission_takes_its_pictures(ends: Stepped) -> None:
    """Each once the gimbal looks there, straight down included."""
    with ends:
        mission = fly_pictures(ends)
        assert mission.state is MissionState.LANDED, mission.status.reason
        assert told(mission, "photo") == []
        first, second = mission.photos
        assert first.gimbal is not None
        assert second.gimbal is not None
        assert first.gimbal.pitch == pytest.approx(-math.pi / 2, abs=0.06)
        assert second.gimbal.pitch == pytest.approx(-0.5, abs=0.06)
        assert second.gimbal.yaw == pytest.approx(0.7, abs=0.06)
        assert [photo.label for photo in (first, second)] == ["a", "b"]


def test_a_gimbal_that_tracks_is_not_commanded_each_time(ends: Stepped) -> None:
    """Targets that follow one another go as messages, with a command now and then."""
    with ends:
        find_payload(ends)
        gimbal = payload_of(ends.vehicle).gimbal
        assert gimbal is not None
        for step in range(60):
            gimbal.aim(GimbalTarget(-0.5 - step / 200, step / 100))
            ends.advance(0.1)
        ends.watch(0.5)
        theirs = carried(ends)
        commands = [
            message
            for _, message in ends.autopilot.heard
            if message.get_type() == "COMMAND_LONG"
            and message.command == mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW
        ]
        assert theirs.tracked > 50
        assert 2 <= len(commands) <= 6
        assert theirs.pitch == pytest.approx(-0.795, abs=0.01)
        assert theirs.right == pytest.approx(-0.59, abs=0.01)
