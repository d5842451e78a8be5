"""Started by benchmarks/tello.py: our camera on an emulated Tello's video."""

from __future__ import annotations

import json
import sys
import time

from aerodaas.clock import NANOSECONDS
from aerodaas.config.model import EnvironmentConfig, RobotConfig
from aerodaas.extensions.tello.camera import TelloCamera
from tools.tello_vehicle.stamp import read_age

_WARM_UP = 2.0
"""Seconds, as for the other reader."""


def main() -> None:
    """Poll the newest frame; print its ages and the CPU taken as JSON."""
    port, seconds, rate = int(sys.argv[1]), float(sys.argv[2]), float(sys.argv[3])
    robot = RobotConfig.model_validate(
        {
            "id": "tello",
            "driver": "tello",
            "settings": {"address": "127.0.0.1"},
            "sensors": [{"id": "camera", "settings": {"video_port": port}}],
        }
    )
    camera = TelloCamera(robot.sensors[0], EnvironmentConfig(robots=[robot]))
    camera.open()
    image = None
    while image is None:
        time.sleep(0.01)
        picture = camera.capture(NANOSECONDS, None)
        image = picture.image if picture is not None else None
    time.sleep(_WARM_UP)
    began, cpu = time.monotonic(), time.process_time()
    ages: list[float] = []
    unreadable = 0
    while time.monotonic() - began < seconds:
        time.sleep(1.0 / rate)
        picture = camera.capture(NANOSECONDS, None)
        image = picture.image if picture is not None else image
        age = read_age(image, time.time_ns() // 1_000_000)
        if age is None:
            unreadable += 1
        else:
            ages.append(age)
    load = (time.process_time() - cpu) / (time.monotonic() - began)
    camera.close()
    print(json.dumps({"ages": ages, "cpu": load, "unreadable": unreadable}), flush=True)


if __name__ == "__main__":
    main()
