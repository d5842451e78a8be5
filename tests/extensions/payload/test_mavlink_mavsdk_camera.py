"""A camera that nobody here wrote: MAVSDK's, beside an emulated autopilot on one link."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest
from autopilot import robot_of
from emulated import LOOPBACK, free_port
from required import needs_peer, peer
from router import Router
from surveyors import payload_of
from waiting import until

from aerodaas.config.model import EnvironmentConfig
from aerodaas.drivers.mavlink.vehicle import MavlinkVehicle
from aerodaas.extensions.payload.equipment import LensCamera, LensTarget, PhotoOutcome
from aerodaas.messages.payload import Photo, PhotoPlace
from tools.mavlink_vehicle import AutopilotOptions, EmulatedAutopilot

PYTHON = peer("AERODAAS_MAVSDK")

pytestmark = [pytest.mark.slow, needs_peer("AERODAAS_MAVSDK"), pytest.mark.wall_clock]


@contextmanager
def _camera(port: int) -> Iterator[subprocess.Popen[str]]:
    """MAVSDK's camera, component 100 of system 1, which speaks to `port`."""
    command = [PYTHON, str(Path(__file__).with_name("mavsdk_camera.py")), str(port), "1", "100"]
    process = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def test_its_pictures_its_lens_and_its_card() -> None:
    """Found by itself; what it is told to do is what it does, and what it says is understood."""
    port = free_port()
    robot = robot_of(port, failsafes="ignore", fallback="ignore")
    with ExitStack() as opened:
        router = opened.enter_context(Router(port))
        options = AutopilotOptions(peer=(LOOPBACK, router.port))
        opened.enter_context(EmulatedAutopilot(options))
        camera = opened.enter_context(_camera(router.port))
        vehicle = MavlinkVehicle(robot, EnvironmentConfig(robots=[robot]))
        opened.callback(vehicle.close)
        vehicle.connect(20.0)
        payload = payload_of(vehicle)
        until(lambda: bool(payload.cameras()) and payload.photo_camera is not None)
        used = payload.photo_camera
        assert isinstance(used, LensCamera)
        number = used.take_photo("gate")
        said: list[PhotoOutcome] = []

        def look() -> bool:
            said.extend(used.outcomes())
            return bool(said)

        until(look)
        used.adjust(LensTarget(zoom=40.0, focus=60.0))
        until(lambda: used.adjusted)
        until(lambda: payload.cameras()[0].free is not None)
        (told,) = payload.cameras()
        did, _ = camera.communicate(timeout=10.0)
    (photo,) = said
    assert isinstance(photo, Photo)
    assert (photo.number, photo.label, photo.file) == (number, "gate", "IMG_0.JPG")
    assert photo.place == PhotoPlace(47.4, 8.5, 500.0, "sea")
    orders = [json.loads(line) for line in did.splitlines()]
    assert orders[:3] == [["photo", 1], ["zoom", 40.0], ["focus", 60.0]]
    assert (told.model, told.pixels) == ("MAVSDK Camera Server", (4000, 3000))
    assert told.view == pytest.approx(73.7, abs=0.1)
    assert told.free == 5000.0
    assert not told.trouble
