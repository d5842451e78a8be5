"""Cameras and gimbals with MAVLink ids of their own: found, commanded, lost, and never obeyed."""

from __future__ import annotations

import socket
from collections.abc import Callable

import pytest
from emulated import Stepped, told
from surveyors import find_payload, fly_pictures, payload_of, photo_outcome, take_photo

from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.extensions.payload.equipment import GimbalTarget, PhotoFailure
from aerodaas.messages.mission import MissionState
from aerodaas.messages.payload import Photo
from aerodaas.mission.mission import Mission
from tools.mavlink_vehicle import AutopilotOptions

CAMERA, GIMBAL = 100, 154


@pytest.fixture(params=["px4", "ardupilot"])
def ends(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Stepped:
    """Both families, with one of each that speak for themselves, and none on the autopilot."""
    options = AutopilotOptions(family=request.param, components=(CAMERA, GIMBAL))
    return Stepped(monkeypatch, options)


def commands(ends: Stepped, component: int, number: int) -> int:
    """How many commands of that number went to a component."""
    return sum(
        message.get_type() == "COMMAND_LONG"
        and message.command == number
        and message.target_component == component
        for _, message in ends.autopilot.heard
    )


def test_they_are_found_by_their_heartbeats_and_commanded_by_their_ids(ends: Stepped) -> None:
    """Pictures by the camera, angles by the gimbal; the autopilot gets none of it."""
    with ends:
        find_payload(ends)
        gimbal = payload_of(ends.vehicle).gimbal
        assert gimbal is not None
        gimbal.aim(GimbalTarget(-0.8, 0.5))
        ends.watch(3.0)
        theirs = ends.autopilot.components[GIMBAL].payload
        assert (theirs.pitch, theirs.right) == pytest.approx((-0.8, -0.5))
        seen = ends.vehicle.read().gimbal
        assert seen is not None
        assert (seen.pitch, seen.yaw) == pytest.approx((-0.8, 0.5))
        take_photo(ends)
        photo = photo_outcome(ends)
        assert isinstance(photo, Photo)
        assert photo.gimbal is not None
        assert photo.file == "DCIM/0001.JPG"
        turn, capture = (
            mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW,
            mavlink.MAV_CMD_IMAGE_START_CAPTURE,
        )
        assert (commands(ends, GIMBAL, turn), commands(ends, CAMERA, capture)) == (1, 1)
        assert (commands(ends, 1, turn), commands(ends, 1, capture)) == (0, 0)
        assert ends.vehicle.read().extra.get("stranger_packets", 0) == 0


def _vanish(ends: Stepped) -> None:
    for component in ends.autopilot.components.values():
        component.vanished = True


def _stall(ends: Stepped) -> None:
    for component in ends.autopilot.components.values():
        component.stalls = True


def _lie(ends: Stepped) -> None:
    ends.autopilot.components[GIMBAL].payload.nonsense = True


def _refuse(ends: Stepped) -> None:
    ends.autopilot.components[CAMERA].payload.camera_refuses = True


@pytest.mark.parametrize("ends", ["ardupilot"], indirect=True)
@pytest.mark.parametrize("strike", [_vanish, _stall, _lie, _refuse])
def test_what_fails_in_flight_costs_the_second_picture_alone(
    ends: Stepped, strike: Callable[[Stepped], None]
) -> None:
    """It is told, and the drone flies on, comes home and lands."""

    def each(mission: Mission) -> None:
        if mission.status.visits:
            strike(ends)

    with ends:
        mission = fly_pictures(ends, each)
        assert mission.state is MissionState.LANDED, mission.status.reason
        assert list(mission.status.visited) == ["a", "b"]
        assert mission.status.photos == (1, 1)
        assert any(text.startswith("b: no picture: ") for text in told(mission, "photo"))


def test_one_that_vanishes_is_told_and_found_again(ends: Stepped) -> None:
    """A picture that is awaited is given up; with its next heartbeat it is back."""
    with ends:
        find_payload(ends)
        number = take_photo(ends)
        ends.autopilot.components[CAMERA].vanished = True
        failure = photo_outcome(ends, 7.0)
        assert isinstance(failure, PhotoFailure)
        assert failure.number == number
        assert "says nothing any more" in failure.reason
        assert payload_of(ends.vehicle).photo_camera is None
        faults = ends.vehicle.read().faults
        assert faults == ("camera (component 100): no word from it any more",)
        ends.autopilot.components[CAMERA].vanished = False
        ends.watch(2.0)
        assert ends.vehicle.read().faults == ()
        assert take_photo(ends) > number
        assert isinstance(photo_outcome(ends), Photo)


def test_the_camera_with_the_lowest_id_is_used(monkeypatch: pytest.MonkeyPatch) -> None:
    """Before the autopilot's; where it vanishes the next one takes its place."""
    options = AutopilotOptions(components=(101, 103), camera=True)
    with Stepped(monkeypatch, options) as ends:
        ends.watch(4.0)
        capture = mavlink.MAV_CMD_IMAGE_START_CAPTURE
        numbers = []
        for component in (101, 103, 1):
            numbers.append(take_photo(ends))
            ends.watch(1.0)
            assert commands(ends, component, capture) == 1
            photo = photo_outcome(ends)
            assert isinstance(photo, Photo)
            assert photo.number == numbers[-1]
            if component != 1:
                ends.autopilot.components[component].vanished = True
                ends.watch(6.0)
        assert len(set(numbers)) == 3


def test_a_managed_gimbals_device_speaks_for_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    """As with PX4: the autopilot manages, and component 154 tells where it looks."""
    with Stepped(monkeypatch, AutopilotOptions(gimbal=True, components=(154,))) as ends:
        managed, device = ends.autopilot.firmware.payload, ends.autopilot.components[154].payload
        managed.device = 154
        device.has_gimbal = False
        ends.watch(3.0)
        device.has_gimbal, device.pitch = True, -0.4
        managed.has_gimbal = False
        device.stuck = True
        ends.watch(6.0)
        gimbal = payload_of(ends.vehicle).gimbal
        assert gimbal is not None
        assert gimbal.attitude is not None
        assert gimbal.attitude.pitch == pytest.approx(-0.4)


@pytest.mark.parametrize(("system", "elsewhere"), [(1, True), (2, False), (2, True)])
def test_strangers_are_no_components(
    monkeypatch: pytest.MonkeyPatch,
    system: int,
    elsewhere: bool,  # noqa: FBT001
) -> None:
    """Who speaks from another address, or as another system, is neither heard nor commanded."""
    with Stepped(monkeypatch, AutopilotOptions()) as ends:
        ends.watch(1.0)
        forger = mavlink.MAVLink(None, system, CAMERA)
        name = list(b"forged".ljust(32, b"\0"))
        said = [
            mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_CAMERA, 8, 0, 0, 4, 3),
            mavlink.MAVLink_camera_information_message(
                0, name, name, 0, 8.8, 13.2, 8.8, 5472, 3648, 0, 2, 0, b""
            ),
        ]
        content = b"".join(message.pack(forger) for message in said)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
            for _ in range(20):
                if elsewhere:
                    other.sendto(content, ends.autopilot.options.peer)
                else:
                    ends.autopilot.inject(content)
                ends.turn()
        assert payload_of(ends.vehicle).photo_camera is None
        assert not any(
            message.get_type() == "COMMAND_LONG" and message.target_component == CAMERA
            for _, message in ends.autopilot.heard
        )


@pytest.mark.parametrize("component", [1, CAMERA])
def test_the_address_of_the_video_is_found(monkeypatch: pytest.MonkeyPatch, component: int) -> None:
    """The autopilot's camera or one with an id of its own; people do not see its password."""
    own = () if component == 1 else (component,)
    options = AutopilotOptions(components=own, camera=component == 1)
    with Stepped(monkeypatch, options) as ends:
        autopilot = ends.autopilot
        payload = (
            autopilot.firmware.payload if component == 1 else autopilot.components[CAMERA].payload
        )
        payload.video = "rtsp://me:secret@10.0.0.9:8554/main"
        ends.watch(8.0)
        state = ends.vehicle.read()
        assert state.video == "rtsp://me:secret@10.0.0.9:8554/main"
        assert "secret" not in repr(state)
        ((name, stream),) = payload_of(ends.vehicle).streams()
        assert str(stream) == "rtsp://10.0.0.9:8554/main (main), 1920x1080, 30/s"
        assert name == ("the autopilot's camera" if component == 1 else "camera (component 100)")
        take_photo(ends)
        assert isinstance(photo_outcome(ends), Photo)
        payload.video = "rtsp://10.6.6.6/other"
        ends.watch(8.0)
        assert ends.vehicle.read().video == state.video
