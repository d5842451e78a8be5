"""Plans of one mission: when they are asked for, and how long the drone waits for the first."""

from __future__ import annotations

from dataclasses import dataclass

from aerodaas.clock import seconds
from aerodaas.config.sections.robot import RobotConfig
from aerodaas.geometry.energy import EnergyMeter
from aerodaas.geometry.frames import Vector
from aerodaas.messages.vehicle import VehicleState
from aerodaas.mission.log import MissionLog
from aerodaas.mission.navigation.navigator import Navigator
from aerodaas.mission.navigation.queue import QueuedWaypoint
from aerodaas.mission.safety.supervisor import has_position
from aerodaas.schedulers.trajectory.base import PlanningContext

__all__ = ["Planning"]


@dataclass(slots=True)
class Planning:
    """Has the navigator plan in the situation of a turn, and tells what its plans leave out."""

    navigator: Navigator
    robot: RobotConfig
    home: Vector
    """Place of take-off, ENU metres."""
    meter: EnergyMeter
    log: MissionLog

    def plan(self, state: VehicleState, now: int) -> None:
        """Request a plan if one is due, and apply one that has come.

        Args:
            state: The vehicle's state; nothing is planned for one without a position.
            now: Mission clock, nanoseconds.
        """
        if not has_position(state):
            return
        limits, navigator = self.robot.limits, self.navigator
        situation = PlanningContext(
            seconds(now),
            state.odometry.position,
            self.home,
            state.battery.fraction,
            limits.cruise_speed,
            energy=self.meter.model,
            reserve=limits.battery_land,
        )
        fault = navigator.fault
        plan = navigator.plan(situation)
        if plan is None:
            return
        for waypoint_id in plan:
            self.log.give_up(now, waypoint_id, f"the scheduler left {waypoint_id} out of its plan")
        if navigator.fault and navigator.fault != fault:
            self.log.alert(now, "scheduler", navigator.fault)

    def awaited(self, stop: QueuedWaypoint, held_since: int | None, now: int) -> bool:
        """Whether to hold for the plan under way rather than set out for `stop`.

        Args:
            stop: The next stop.
            held_since: Mission clock since which the drone holds, nanoseconds; None if it does not.
            now: Mission clock, nanoseconds.
        """
        if not self.navigator.waits_for_plan or stop.under_way:
            return False
        timeout = self.robot.mission.plan_timeout
        if held_since is None or seconds(now - held_since) < timeout:
            return True
        text = f"no plan within {timeout:g} s: flying the order given"
        if self.navigator.fault != text:
            self.navigator.fault = text
            self.log.alert(now, "scheduler", text)
        return False
