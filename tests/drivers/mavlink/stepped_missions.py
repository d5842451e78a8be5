"""Missions of a MAVLink vehicle, by the clock of both ends."""

from __future__ import annotations

from collections.abc import Sequence

from stepped import Stepped

from aerodaas.config.model import MissionConfig
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.mission.commands import AddNavigation, Start
from aerodaas.mission.loop import SetpointLoop
from aerodaas.mission.mission import Mission
from aerodaas.mission.planner import InlinePlanner
from aerodaas.schedulers.trajectory.ordered import OrderedScheduler
from aerodaas.types.waypoints import Waypoint

__all__ = ["started"]


class _Clock:
    """The mission's clock: that of both ends."""

    def __init__(self, ends: Stepped) -> None:
        self._ends = ends

    def now(self) -> int:
        """Nanoseconds."""
        return round(self._ends.now * 1e9)


def started(
    ends: Stepped,
    stops: Sequence[Waypoint],
    options: MissionConfig | None = None,
    payload: object = None,
) -> SetpointLoop:
    """The loop of a mission to `stops` that has been started; `payload` as a mission takes it."""
    clock = _Clock(ends)
    ends.vehicle.use_clock(clock)  # type: ignore[arg-type]
    robot = ends.robot if options is None else ends.robot.model_copy(update={"mission": options})
    mission = Mission(
        robot,
        InlinePlanner(OrderedScheduler()),
        takeoff=ends.vehicle.read().odometry.position,
        payload=payload,
    )
    mission.handle(AddNavigation(AeroNavigation(data=list(stops))), clock.now())
    mission.handle(Start(), clock.now())
    return SetpointLoop(ends.vehicle, mission)
