"""Video on the camera's own card: begun and ended by command, and what its status says of it."""

from __future__ import annotations

import logging

import pytest
from emulated import Stepped, told
from surveyors import find_payload, patience, payload_of

from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.errors import VehicleError
from aerodaas.extensions.payload.equipment import VideoCamera
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.mission import Mission
from tools.mavlink_vehicle import AutopilotOptions
from tools.mavlink_vehicle.payload import EmulatedPayload

CAMERA, OTHER, GIMBAL = 100, 101, 154
START, STOP = mavlink.MAV_CMD_VIDEO_START_CAPTURE, mavlink.MAV_CMD_VIDEO_STOP_CAPTURE
ABLE = mavlink.CAMERA_CAP_FLAGS_CAPTURE_IMAGE | mavlink.CAMERA_CAP_FLAGS_CAPTURE_VIDEO
STILL, NOT = (
    "the camera says that it is still recording",
    "the camera says that it is not recording",
)
BEGIN = Waypoint("a", 3, 0, 2, video=True)
FINISH = Waypoint("b", 3, 3, 2, video=False)
OPTIONS = patience(4.0)


@pytest.fixture
def ends(monkeypatch: pytest.MonkeyPatch) -> Stepped:
    """A vehicle with two cameras and a gimbal that speak for themselves, and can record."""
    both = Stepped(monkeypatch, AutopilotOptions(components=(CAMERA, OTHER, GIMBAL)))
    for number in (CAMERA, OTHER):
        both.autopilot.components[number].payload.flags = ABLE
    return both


def payload(ends: Stepped, number: int = CAMERA) -> EmulatedPayload:
    """The emulated camera."""
    return ends.autopilot.components[number].payload


def camera_of(ends: Stepped) -> VideoCamera:
    """The camera."""
    camera = payload_of(ends.vehicle).photo_camera
    assert isinstance(camera, VideoCamera)
    return camera


def known(ends: Stepped) -> VideoCamera:
    """The camera, once it has said whether it records."""
    find_payload(ends)
    ends.wait(lambda: camera_of(ends).filming is not None)
    return camera_of(ends)


def recording(ends: Stepped) -> VideoCamera:
    """The camera, which records and has said so."""
    camera = known(ends)
    camera.film(on=True)
    ends.watch(4.0)
    assert camera.filming is not None
    return camera


def vanish(ends: Stepped) -> None:
    """Let the camera be gone."""
    ends.autopilot.components[CAMERA].vanished = True
    ends.watch(7.0)


def heard(ends: Stepped, number: int = CAMERA) -> list[tuple[float, ...]]:
    """Orders of video that it has heard: the command and its parameters."""
    return [
        (one.command, *(getattr(one, f"param{index}") for index in range(1, 8)))
        for one in ends.autopilot.components[number].heard
        if one.get_type() == "COMMAND_LONG" and one.command in {START, STOP}
    ]


def test_a_video_is_begun_and_ended_at_waypoints(ends: Stepped) -> None:
    """All streams, and no status asked for by it; its own status tells so soon after."""
    recorded: list[float | None] = []

    def note(_: Mission) -> None:
        recorded.append(next(iter(payload_of(ends.vehicle).cameras())).recording)

    with ends:
        known(ends)
        mission = ends.mission([BEGIN, FINISH], OPTIONS).fly(note)
        assert list(mission.status.visited) == ["a", "b"]
        assert heard(ends) == [(START, *[0.0] * 7), (STOP, *[0.0] * 7)]
        assert payload(ends).recording is None
        assert heard(ends, OTHER) == []
        assert told(mission, "video") == []
        assert any(one is not None for one in recorded)
        assert recorded[-1] is None


def test_a_silent_camera_is_told_and_its_status_counts_later(ends: Stepped) -> None:
    """No answer is no refusal: it may have begun."""
    with ends:
        camera = known(ends)
        ends.autopilot.components[CAMERA].stalls = True
        mission = ends.mission([BEGIN], OPTIONS).fly()
        assert list(mission.status.visited) == ["a"]
        assert told(mission, "video")[0] == (
            "video not begun at a: the camera did not acknowledge it within 4 s"
        )
        assert (camera.filming, camera.film_fault) == (None, "")
        ends.watch(8.0)
        assert heard(ends)[-1][0] == STOP
        assert (camera.filming, camera.film_fault) == (None, "")
        payload(ends).recording = 3.0
        ends.autopilot.components[CAMERA].stalls = False
        late = payload(ends).message(mavlink.MAVLINK_MSG_ID_CAMERA_CAPTURE_STATUS)
        ends.autopilot.components[CAMERA].say(late)
        ends.turn()
        assert camera.filming is True


def test_a_camera_without_video_is_told_at_once(ends: Stepped) -> None:
    """By the flags of its CAMERA_INFORMATION; one without any flags may have it."""
    with ends:
        payload(ends).flags = mavlink.CAMERA_CAP_FLAGS_CAPTURE_IMAGE
        find_payload(ends)
        mission = ends.mission([BEGIN], OPTIONS).fly()
        assert list(mission.status.visited) == ["a"]
        assert told(mission, "video") == ["video not begun at a: the camera records no video"]
        assert heard(ends) == []


def test_a_video_is_ended_before_the_link_is_closed(
    ends: Stepped, caplog: pytest.LogCaptureFixture
) -> None:
    """Though the mission's last turn has asked for it, and the first word is lost."""
    caplog.set_level(logging.WARNING)
    with ends:
        known(ends)
        mission = ends.mission([BEGIN], OPTIONS).fly()
        assert mission.finished
        assert payload(ends).recording is not None
    assert payload(ends).recording is None
    assert "has not acknowledged" not in caplog.text


def test_a_status_that_belies_the_beginning_is_told_once(ends: Stepped) -> None:
    """Seconds after the acknowledgement; it is ended at the end all the same."""
    stops = [BEGIN, Waypoint("b", 3, 3, 2, hover_duration=6.0)]
    with ends:
        camera = known(ends)
        payload(ends).video_sticks = True
        acknowledged: list[float] = []
        belied: list[float] = []

        def note(mission: Mission) -> None:
            if camera.filming and not acknowledged:
                acknowledged.append(ends.now)
            if told(mission, "video") and not belied:
                belied.append(ends.now)

        mission = ends.mission(stops, OPTIONS).fly(note)
        assert told(mission, "video") == [f"video begun at a, but {NOT}"]
        assert 2.0 <= belied[0] - acknowledged[0] < 5.0
        ends.watch(1.0)
        assert [one[0] for one in heard(ends)] == [START, STOP]


def test_a_recording_that_breaks_off_is_told(ends: Stepped) -> None:
    """Such as by a full card; one that others begin after ours has ended is theirs."""
    with ends:
        camera = known(ends)
        camera.film(on=True)
        ends.watch(5.0)
        assert (camera.filming, camera.film_fault) == (True, "")
        payload(ends).recording = None
        ends.watch(12.0)
        assert (camera.filming, camera.film_fault) == (False, NOT)
        camera.film(on=False)
        ends.watch(5.0)
        assert (camera.filming, camera.film_fault) == (False, "")
        assert [one[0] for one in heard(ends)] == [START, STOP]
        payload(ends).recording = 1.0
        ends.watch(12.0)
        assert (camera.filming, camera.film_fault) == (True, "")


def test_a_camera_that_is_gone_begins_nothing_when_it_is_back(ends: Stepped) -> None:
    """Nor does another one take its place; what it says when it is back counts."""
    with ends:
        camera = known(ends)
        ends.autopilot.components[CAMERA].stalls = True
        camera.film(on=True)
        ends.turn()
        vanish(ends)
        assert (camera.filming, camera.film_fault) == (None, "")
        with pytest.raises(VehicleError, match="no camera answers"):
            camera.film(on=False)
        asked = len(heard(ends))
        ends.autopilot.components[CAMERA].stalls = False
        ends.autopilot.components[CAMERA].vanished = False
        ends.watch(8.0)
        assert len(heard(ends)) == asked
        assert heard(ends, OTHER) == []
        assert payload(ends).recording is None
        assert camera.filming is False


def test_an_order_ends_the_one_before(ends: Stepped) -> None:
    """A beginning that were repeated after the end would record on."""
    with ends:
        camera = known(ends)
        ends.autopilot.components[CAMERA].stalls = True
        camera.film(on=True)
        camera.film(on=True)
        ends.turn()
        assert (camera.filming, camera.film_fault) == (None, "")
        camera.film(on=False)
        ends.watch(3.0)
        orders = [one[0] for one in heard(ends)]
        assert orders[:3] == [START, START, STOP]
        assert set(orders[2:]) == {STOP}
