"""What the endurance benchmark flies: a drone with a small camera, round after round."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any, ClassVar

import aerodaas.actors  # noqa: F401 - sets what Ray reads as it is imported

# isort: split
import ray

from aerodaas import AeroNavigation, Analytics, Environment, Frame, NavigationType, Waypoint
from aerodaas.analytics.base import Context
from aerodaas.clock import seconds
from aerodaas.config.options import RunOptions, current_options

TASKS = "Events of tasks kept by Ray's head"
SIZE = (320, 180)
RATE = 5.0
_ROUND = ((8.0, 0.0), (8.0, 8.0), (0.0, 8.0), (0.0, 0.0))
_EVERY = 30.0
"""Mission seconds from round to round; one takes about 25."""


class Patrol(Analytics[AeroNavigation]):
    """Looks at each frame, and orders a round by the clock until `until` mission seconds."""

    accepts: ClassVar[tuple[type, ...]] = (Frame,)
    produces: ClassVar[type] = AeroNavigation

    def __init__(self, until: float) -> None:
        self._until = until
        self._rounds = 0

    def process(self, item: Frame, context: Context) -> AeroNavigation | None:
        """Return the next round when it is due."""
        now = seconds(context.now())
        assert item.image.any()  # noqa: S101 - the picture is read, as an analysis does
        if now > self._until or now < self._rounds * _EVERY:
            return None
        self._rounds += 1
        stops = [
            Waypoint(f"round{self._rounds}-{number}", x, y, 2.0)
            for number, (x, y) in enumerate(_ROUND)
        ]
        return AeroNavigation(NavigationType.DISTANCE_DRIVEN, stops)


def environment() -> dict[str, Any]:
    """The environment file's content: a battery for days, and patience between two rounds."""
    width, height = SIZE
    camera = {"id": "camera", "rate": RATE, "settings": {"width": width, "height": height}}
    odometry = {"id": "odometry", "type": "odometry", "rate": 10}
    return {
        "name": "endurance",
        "robots": [
            {
                "id": "drone",
                "settings": {"capacity": 1e4},
                "limits": {"endurance": 1e6, "silence_return": 2 * _EVERY},
                "sensors": [camera, odometry],
            }
        ],
        "compute": [{"id": "edge", "kind": "edge"}],
        "simulation": {"world": "empty", "wind": [0.5, 0.2, 0.0], "gust": 0.3},
    }


def main() -> None:
    """Fly for the given time, in real time or in simulated time."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seconds", type=float, required=True)
    parser.add_argument("--simulated", action="store_true")
    words = parser.parse_args()
    path = words.folder / "environment.json"
    path.write_text(json.dumps(environment()), encoding="utf-8")
    speed = None if words.simulated else 1.0
    options = RunOptions(
        speed=speed,
        simulated_time=words.simulated,
        view=False,
        record=words.folder / "flight",
        seed=1,
    )
    current_options.set(options)
    env = Environment(path)
    drone = env.get_robot_by_id("drone")
    frames = drone.get_sensor_by_id("camera").get_data_stream()
    drone.get_sensor_by_id("odometry").get_data_stream()
    drone.navigate(Patrol(words.seconds).analyse(frames))
    try:
        drone.start_mission()
    finally:
        print(f"{TASKS}: {len(ray.timeline() or ())}", flush=True)


if __name__ == "__main__":
    main()
