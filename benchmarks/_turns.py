"""Processor time of one turn of a simulated drone: physics of 50 ms, mission, setpoint, readings.

    python benchmarks/_turns.py

One process flies the square of Farm Survey without streams, so that nothing waits and other work on
the machine matters little. Prints microseconds a turn.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any, cast

from aerodaas import AeroNavigation, NavigationType, Waypoint
from aerodaas.actors.drone.background_publisher import BackgroundPublisher
from aerodaas.actors.drone.vehicle_controller import RobotSpec, VehicleController
from aerodaas.config.model import EnvironmentConfig
from aerodaas.mission.commands import AddNavigation
from aerodaas.mission.planner import InlinePlanner, Planner
from aerodaas.runtime.session import CONTROL_PERIOD_NS, Session
from aerodaas.schedulers.trajectory.base import TrajectoryScheduler
from aerodaas.schedulers.trajectory.ordered import OrderedScheduler
from aerodaas.types.clock import LockstepClock

_ENVIRONMENT = Path(__file__).parents[1] / "apps" / "environments" / "farm.json"
_CORNERS = ((0, 0), (0, 10), (10, 10), (10, 0))


class _Controller(VehicleController):
    def make_planner(self, scheduler: TrajectoryScheduler) -> Planner:
        return InlinePlanner(scheduler)


class _Nowhere:
    """A publisher without readers."""

    def __init__(self, stream: str) -> None:
        self.stream = stream
        self.sent = 0

    def measure(self, *_: Any) -> None:  # noqa: ANN401 - as a publisher's
        self.sent += 1


def turn_cost() -> float:
    """Microseconds of the processor for a turn, the mean over one flight."""
    config = EnvironmentConfig.model_validate_json(_ENVIRONMENT.read_text())
    robot = config.robots[0]
    stops = [Waypoint(f"wp{n}", x, y, 1.5, hover_duration=5) for n, (x, y) in enumerate(_CORNERS)]
    survey = AddNavigation(AeroNavigation(NavigationType.DISTANCE_DRIVEN, stops), 0, None)
    sensors = tuple(sensor for sensor in robot.sensors if sensor.type != "camera")
    spec = RobotSpec(robot, sensors, (), (), (), (survey,), OrderedScheduler())
    controller = _Controller(spec, Session(config, None), BackgroundPublisher())
    controller.connect()
    controller.open({stream: cast("Any", _Nowhere(stream)) for stream in controller.streams(spec)})
    controller.start(LockstepClock())
    now = turns = 0
    began = time.process_time()
    while not controller.over:
        now += CONTROL_PERIOD_NS
        controller.advance_to(now)
        controller.turn(now, ())
        controller.observe(now)
        turns += 1
    return (time.process_time() - began) / turns * 1e6


if __name__ == "__main__":
    print(f"{min(turn_cost() for _ in range(3)):.0f}")
