"""A survey with pictures, flown whole: files, table, recording, and what the video showed."""

from __future__ import annotations

import csv
import math
from typing import Any

import pytest
from flying import FLAT, Flyer, robot
from keywords import keywords
from PIL import Image

from aerodaas import AeroNavigation, Environment, Waypoint
from aerodaas.recording.reader import Recording

DOWN = -math.pi / 2
CAMERA = {"id": "cam", "rate": 2, "settings": {"width": 64, "height": 48, "gimbal": {}, "zoom": 3}}


def content(**camera: Any) -> dict[str, Any]:  # noqa: ANN401
    """One drone with a camera, over flat ground with a geodetic home."""
    home = {"latitude": 47.397742, "longitude": 8.545594, "altitude": 488.0}
    return {**FLAT, "home": home, "robots": [robot(sensors=[{**CAMERA, **camera}])]}


def survey(env: Environment) -> None:
    """Two pictures, straight down and ahead."""
    drone = env.get_robot_by_id("drone")
    stops = [
        Waypoint("nadir", 4, 0, 4, gimbal_pitch=DOWN, photo=True, video=True),
        Waypoint("aside", 4, 4, 4, gimbal_pitch=-0.5, gimbal_yaw=0.6, zoom=50, photo=True),
    ]
    drone.navigate(AeroNavigation(data=stops))


@pytest.mark.slow
def test_a_survey_leaves_its_pictures_beside_the_recording(flyer: Flyer) -> None:
    """Each has a row, a file with a place in it, and a message on the robot's topic."""
    run = flyer.fly(survey, content(), simulated_time=True)
    assert run.recording is not None
    folder = run.recording.with_name("flight-photos")
    with (folder / "photos.csv").open(newline="") as file:
        nadir, aside = csv.DictReader(file)
    assert (nadir["label"], aside["label"]) == ("nadir", "aside")
    assert float(nadir["pitch"]) == pytest.approx(-90, abs=3)
    assert float(aside["pitch"]) == pytest.approx(math.degrees(-0.5), abs=3)
    assert float(nadir["east"]) == pytest.approx(4, abs=0.6)
    assert float(nadir["latitude"]) == pytest.approx(47.397742, abs=1e-4)
    with Image.open(folder / nadir["file"]) as image:
        assert image.getexif().get_ifd(0x8825)
    with Recording.open(run.recording) as recording:
        photos = [one.value for one in recording.records(schemas=("aerodaas.Photo",))]
        calibrations = recording.records(schemas=("foxglove.CameraCalibration",))
        lenses = [one.value for one in calibrations]
        states = [one.value for one in recording.records(schemas=("aerodaas.VehicleState",))]
        plans = [one.value for one in recording.records(schemas=("aerodaas.Plan",))]
        alerts = [one.value for one in recording.records(schemas=("aerodaas.Alert",))]
    assert [keywords(one).video for one in plans[0].waypoints] == [True, None]
    assert not [one for one in alerts if one.kind == "video"]
    assert [photo.label for photo in photos] == ["nadir", "aside"]
    assert [photo.zoom for photo in photos] == [0.0, 50.0]
    assert [state.zoom for state in (states[0], states[-1])] == [0.0, 50.0]
    # Calibration of each frame: twice the focal length at half of a zoom of three.
    focal = 32 / math.tan(math.radians(82.6) / 2)
    assert {round(one.K[0] / focal, 3) for one in lenses} == {1.0, 2.0}
    assert min(state.gimbal.pitch for state in states) == pytest.approx(DOWN, abs=0.05)


@pytest.mark.slow
def test_a_bolted_camera_loses_pictures_that_need_a_gimbal(flyer: Flyer) -> None:
    """The survey is flown, and the loss is told."""
    run = flyer.fly(survey, content(settings={"width": 64, "height": 48}), simulated_time=True)
    assert run.recording is not None
    assert not run.recording.with_name("flight-photos").exists()
    with Recording.open(run.recording) as recording:
        missions = [one.value for one in recording.records(schemas=("aerodaas.MissionStatus",))]
    assert missions[-1].photos == (0, 2)
    assert missions[-1].visited == ("nadir", "aside")
