"""A replayed camera's pictures come at the mission times at which they were recorded."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from aerodaas.cameras.base import Camera, Picture
from aerodaas.config.model import EnvironmentConfig, RecordingConfig, SensorConfig
from aerodaas.config.plugins import load_plugin
from aerodaas.recording.provenance import Provenance
from aerodaas.recording.recorder import FlightRecorder
from aerodaas.types.data import Frame, Header, Odometry
from aerodaas.types.status import Message

ENVIRONMENT = EnvironmentConfig.model_validate({"robots": [{"id": "drone"}]})
SECOND = 1_000_000_000
STAMPS = [2_000_000_000, 2_470_000_000, 3_010_000_000]
"""Mission time at which each picture was taken; it was published 40 ms later."""
PROVENANCE = Provenance(0, "flight", 0, "{}", app="app.py")


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A flight with one camera."""
    path = tmp_path_factory.mktemp("replayed") / "flight.mcap"
    with FlightRecorder(path, config=RecordingConfig(), provenance=PROVENANCE) as recorder:
        for number, stamp in enumerate(STAMPS):
            header = Header(number, stamp, "drone/cam")
            image = np.full((24, 32, 3), 60 * number, np.uint8)
            odometry = Odometry(np.array([number, 0.0, 2.0]), np.zeros(3), yaw=0.0)
            frame = Frame(header, image, None, odometry)
            published = stamp + 40_000_000
            recorder.write(Message("drone/cam", number, published, header, 0, (), frame))
    return path


@pytest.fixture(params=[False, True], ids=["once", "loop"])
def camera(recorded: Path, request: pytest.FixtureRequest) -> Iterator[Camera]:
    """An open camera that replays it."""
    settings = {"path": str(recorded), "topic": "/drone/cam/image", "loop": request.param}
    sensor = SensorConfig(id="cam", driver="replayed", settings=settings)
    made: Camera = load_plugin("cameras", "replayed")(sensor, ENVIRONMENT)
    made.open()
    yield made
    made.close()


def shown(picture: Picture | None) -> int | None:
    """Which picture it is, by its brightness."""
    return None if picture is None else round(float(picture.image.mean()) / 60)


def test_pictures_come_at_their_own_times(camera: Camera) -> None:
    """Not before, whenever the first was asked for; each bears its own stamp and odometry."""
    asked = [0, SECOND, *(stamp + late for stamp in STAMPS for late in (-1, 0)), 9 * SECOND]
    found = [camera.capture(stamp, None) for stamp in asked]
    assert [shown(one) for one in found] == [None, None, None, 0, None, 1, None, 2, None]
    pictures = [one for one in found if one is not None]
    assert [one.stamp for one in pictures] == STAMPS
    places = [one.odometry.position[0] for one in pictures if one.odometry is not None]
    assert places == [0.0, 1.0, 2.0]


def test_asked_late_it_shows_the_newest_that_is_due_with_its_own_stamp(camera: Camera) -> None:
    """What was taken at 2.47 s is of 2.47 s, though it is asked for at 2.9 s."""
    late = camera.capture(2_900_000_000, None)
    assert late is not None
    assert (shown(late), late.stamp) == (1, STAMPS[1])


@pytest.mark.timeout(20)  # one that began again would never be done
def test_mission_time_does_not_begin_again(camera: Camera, request: pytest.FixtureRequest) -> None:
    """After the last picture there is none; one that looped in flight never says so."""
    assert shown(camera.capture(3 * SECOND + SECOND // 2, None)) == 2
    assert [camera.capture(number * SECOND, None) for number in range(4, 20)] == [None] * 16
    assert camera.finished == ("once" in request.node.name)
