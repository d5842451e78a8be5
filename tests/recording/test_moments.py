"""Which frames of a flight are worth a picture: what was seen first, then alerts, then states."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from synthetic_flight import PROVENANCE

from aerodaas.config.model import RecordingConfig
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Frame, Header
from aerodaas.recording.reader import Recording
from aerodaas.recording.recorder import FlightRecorder
from aerodaas.recording.report.flight import Band, RecordedDetection, RecordedFlight, RobotFlight
from aerodaas.recording.report.moments import Moment, key_moments, picture_moments
from aerodaas.recording.report.overlay import draw_detections

SECOND = 1_000_000_000
CAMERA = "tello/cam"


def flight(*seconds: float, camera: str = CAMERA) -> RecordedFlight:
    """A flight with a frame at each of these seconds."""
    made = RecordedFlight()
    made.frame_stamps[camera] = [round(second * SECOND) for second in seconds]
    return made


def seen(second: float, label: str, score: float, source: str = CAMERA) -> RecordedDetection:
    """An object found."""
    return RecordedDetection(round(second * SECOND), source, label, score)


def told(found: list[Moment]) -> list[tuple[float, str]]:
    """Second and reason of each moment."""
    return [(moment.stamp / SECOND, moment.reason) for moment in found]


def test_the_frame_shown_is_the_first_from_then_on() -> None:
    """At a frame's own time that frame; a moment later the next; after the last one, the last."""
    made = flight(1, 2, 3)
    made.alerts = [(2.0, "a", "at two"), (2.001, "b", "later"), (0.0, "c", "before")]
    assert told(key_moments(made, 3)) == [
        (1, "alert: before"),
        (2, "alert: at two"),
        (3, "alert: later"),
    ]
    made.alerts = [(9.0, "a", "after all")]
    assert told(key_moments(made, 1)) == [(3, "alert: after all")]


def test_first_and_surest_sightings_come_before_all_else() -> None:
    """A dog is first seen at 1 s and best at 4 s, the first of two alike; then the alert."""
    made = flight(*range(10))
    made.sightings = [
        seen(1, "dog", 0.5),
        seen(2, "dog", 0.4),
        seen(4, "dog", 0.9),
        seen(5, "dog", 0.9),
    ]
    made.alerts = [(7.0, "low", "battery low")]
    assert told(key_moments(made, 2)) == [(1, "first dog"), (4, "surest dog")]
    assert told(key_moments(made, 3))[2] == (7, "alert: battery low")


def test_sightings_are_in_their_own_cameras_frames() -> None:
    """Those of a camera without frames are left out; of two frames at a time, each has its own."""
    made = flight(1, 2)
    made.frame_stamps["tello/rear"] = [2 * SECOND]
    made.sightings = [
        seen(2, "dog", 0.5, "tello/rear"),
        seen(2, "cat", 0.5),
        seen(1, "cow", 0.5, "tello/lost"),
    ]
    found = key_moments(made, 12)
    assert [(it.stamp // SECOND, it.source, it.reason) for it in found] == [
        (1, CAMERA, CAMERA),
        (2, CAMERA, "first cat"),
        (2, "tello/rear", "first dog"),
    ]


def test_an_alert_is_shown_once_of_each_kind_with_the_first_camera() -> None:
    """It repeats itself at 5 s; another kind at 6 s is another alert."""
    made = flight(*range(10))
    made.frame_stamps["tello/rear"] = [4 * SECOND]
    made.alerts = [(4.0, "low", "one"), (5.0, "low", "two"), (6.0, "far", "three")]
    found = key_moments(made, 2)
    assert told(found) == [(4, "alert: one"), (6, "alert: three")]
    assert {moment.source for moment in found} == {CAMERA}


def test_states_met_for_the_first_time_come_before_those_met_again() -> None:
    """Two moments show taking off and landing; the third goes to what was met before."""
    made = flight(*range(10))
    made.robots["tello"] = RobotFlight(
        bands=[
            Band("taking_off", 1.0, 2.0, "climbing to 2 m"),
            Band("enroute", 2.0, 3.0),
            Band("enroute", 3.0, 4.0, "on again"),
            Band("landing", 4.0, 5.0),
        ]
    )
    three = [(1, "taking off: climbing to 2 m"), (2, "enroute"), (4, "landing")]
    assert told(key_moments(made, 3)) == three
    assert told(key_moments(made, 4)) == [*three[:2], (3, "enroute: on again"), three[2]]


def test_a_state_is_shown_by_its_own_robots_first_camera() -> None:
    """`tell` has no camera, though a name begins like its own; `tello` has two."""
    made = flight(1, 2, 3)
    made.frame_stamps["tello/rear"] = [SECOND, 2 * SECOND]
    made.robots["tell"] = RobotFlight(bands=[Band("lost", 1.0, 2.0)])
    made.robots["tello"] = RobotFlight(bands=[Band("landed", 2.0, 3.0)])
    (found,) = key_moments(made, 1)
    assert found == Moment(2 * SECOND, CAMERA, "landed")
    assert "lost" not in {reason for _, reason in told(key_moments(made))}


def test_pictures_are_fetched_and_what_was_found_is_drawn(tmp_path: Path) -> None:
    """Of two cameras at two times, those asked for; the box is in the picture it was found in."""
    path = tmp_path / "a.mcap"
    with FlightRecorder(path, config=RecordingConfig(), provenance=PROVENANCE) as recorder:
        for second in (1, 2):
            for camera in (CAMERA, "tello/rear"):
                stamp = second * SECOND
                header = Header(second, stamp, camera)
                frame = Frame(header, np.full((64, 96, 3), 100, np.uint8))
                recorder.write(Message(camera, second, stamp, header, 0, (), frame))
                if second == 2:
                    found = Detections.of(frame, [Detection((20, 20, 60, 50), "dog", 0.9)])
                    recorder.write(Message("tello/find", 0, stamp, header, 0, (), found))
    asked = [
        Moment(2 * SECOND, CAMERA, "first dog"),
        Moment(SECOND, "tello/rear", "landed"),
        Moment(3 * SECOND, CAMERA, "never recorded"),
    ]
    with Recording.open(path) as recording:
        pictures = picture_moments(recording, asked)
    assert [it.caption for it in pictures] == ["1.0 s: landed", "2.0 s: first dog"]
    plain, drawn = (picture.image for picture in pictures)
    assert np.abs(plain.astype(int) - 100).max() < 5
    assert np.abs(drawn.astype(int) - 100).max() > 50


def test_a_joint_that_nobody_knows_is_not_drawn() -> None:
    """A recording may hold gaps for numbers, whatever the confidence says; the others are drawn."""
    joints = np.array([[float("nan"), 20.0, 0.9], [30.0, float("inf"), 0.9], [40.0, 40.0, 0.9]])
    image = np.zeros((80, 80, 3), np.uint8)
    body = Detection((10.0, 10.0, 70.0, 70.0), "person", 0.9, keypoints=joints.astype(np.float32))
    draw_detections(image, [body])
    assert image[40, 40].any()
    assert not image[20:36, 20:36].any()
