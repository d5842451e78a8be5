"""Actuators in a mission: moved at waypoints and by command, and what follows where one fails.

It only asks and looks, and never waits: the setpoint loop goes on while the drone hovers. A command
that a waypoint has given is withdrawn as soon as the drone no longer stays there for it, so that
nothing is dropped elsewhere by a late repetition. What has a position of rest is given it once the
drone comes home, so that nothing goes on spraying on the way.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from aerodaas.clock import NANOSECONDS, seconds
from aerodaas.config.sections.actuators import (
    RelayConfig,
    ServoConfig,
    actuator_objection,
    parachute_objection,
)
from aerodaas.config.sections.robot import RobotConfig
from aerodaas.errors import VehicleError, failure_line
from aerodaas.geometry.frames import Vector, length
from aerodaas.messages.actions import MoveActuator
from aerodaas.messages.actuators import ActuatedVehicle, Actuators, MoveResult
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.action_executor import ActionExecutor
from aerodaas.mission.commands import Actuate, Answer, ReleaseParachute
from aerodaas.mission.log import MissionLog
from aerodaas.mission.navigation.queue import QueuedWaypoint

__all__ = ["Actuation"]

_KIND = "actuator"
"""Kind of the alerts."""
_INTERRUPTED = NANOSECONDS // 4
"""Nanoseconds without a look at a waypoint after which the drone no longer stays there: some turns
of the setpoint loop."""


@dataclass(slots=True)
class _Task:
    """Actuator commands of one stop."""

    stop: QueuedWaypoint
    left: list[MoveActuator]
    """Moves that are still to be made, in order."""
    since: int | None = None
    """Mission clock since which the first of them is due, nanoseconds."""
    number: int | None = None
    """That of the command that is under way."""
    attended: int = 0
    """Mission clock of the latest look, nanoseconds."""


@dataclass(slots=True)
class _Release:
    """A parachute that was asked to open."""

    name: str
    number: int


@dataclass(slots=True)
class Actuation(ActionExecutor):
    """Actuators of one mission, called by it once a turn."""

    vehicle: ActuatedVehicle | None
    """Uses the actuators of this one; None for a vehicle that moves none."""
    robot: RobotConfig
    log: MissionLog
    released: str = ""
    """Parachute that was fired; empty for none."""
    _tasks: dict[str, _Task] = field(default_factory=dict)
    _asked: dict[int, str] = field(default_factory=dict)
    """What was asked for by command, by the command's number."""
    _release: _Release | None = None
    _failure: str = ""
    _home: bool = False

    def take_failure(self) -> str:
        """Failure after which the flight is not to go on; returned once, otherwise empty."""
        failure, self._failure = self._failure, ""
        return failure

    def objection(self, waypoint: Waypoint) -> str:
        """Why what a waypoint asks of actuators is not possible; empty if it is."""
        return actuator_objection(self.robot.actuators, waypoint.actions, by_waypoint=True)

    def move(self, command: Actuate) -> Answer:
        """Move an actuator by command, wherever the drone is; a failure becomes an alert."""
        actions = [MoveActuator(command.actuator, command.position)]
        if text := actuator_objection(self.robot.actuators, actions, by_waypoint=False):
            return Answer(accepted=False, text=text)
        try:
            number = self._actuators().move(command.actuator, command.position)
        except VehicleError as error:
            return Answer(accepted=False, text=str(error))
        self._asked[number] = f"{command.actuator}: {command.position}"
        return Answer(accepted=True)

    def release(self, command: ReleaseParachute) -> Answer:
        """Fire a parachute, where the environment file permits it."""
        if text := parachute_objection(self.robot.actuators, command.parachute):
            return Answer(accepted=False, text=text)
        try:
            number = self._actuators().release_parachute(command.parachute)
        except VehicleError as error:
            return Answer(accepted=False, text=str(error))
        self._release = _Release(command.parachute, number)
        return Answer(accepted=True)

    def poll(self, now: int) -> None:
        """Process the results of commands, and withdraw those of a stop that was left.

        `now` is the mission clock, nanoseconds.
        """
        try:
            actuators = None if self.vehicle is None else self.vehicle.actuators
            for result in () if actuators is None else actuators.results():
                self._on_result(result, now)
            for task in self._tasks.values():
                if actuators is not None and now - task.attended > _INTERRUPTED:
                    self._withdraw(task, actuators)
        except Exception as error:  # noqa: BLE001 - a driver's actuators must not end a flight
            self.log.alert(now, _KIND, f"the actuators: {failure_line(error)}")

    def step(self, now: int, *, home: bool) -> None:
        """Give its rest to all that has one, if the drone flies by no plan from now on.

        Args:
            now: Mission clock, nanoseconds.
            home: Whether the drone comes home, lands, or the mission is over.
        """
        begins, self._home = home and not self._home, home
        if not begins:
            return
        for one in self.robot.actuators:
            if isinstance(one, RelayConfig | ServoConfig) and one.rest is not None:
                self._rest(one.id, one.rest, now)

    def _rest(self, name: str, position: str, now: int) -> None:
        try:
            # What a stop asked for might be repeated after it.
            for task in self._tasks.values():
                self._withdraw(task, self._actuators())
            answer = self.move(Actuate(name, position))
            fault = "" if answer.accepted else answer.text
        except Exception as error:  # noqa: BLE001 - a driver's actuators must not end a flight
            fault = failure_line(error)
        if fault:
            self.log.alert(now, _KIND, f"{name}: {position}: not done: {fault}")

    @staticmethod
    def _withdraw(task: _Task, actuators: Actuators) -> None:
        if task.number is not None:
            actuators.withdraw(task.number)
            task.number = task.since = None

    def _on_result(self, result: MoveResult, now: int) -> None:
        release, asked = self._release, self._asked.pop(result.number, None)
        if release is not None and release.number == result.number:
            self._release = None
            self.released = release.name if result.accepted else ""
            if not result.accepted:
                text = f"the parachute {release.name} was not released: {result.reason}"
                self.log.alert(now, "parachute", text)
        elif asked is not None:
            if not result.accepted:
                self.log.alert(now, _KIND, f"{asked}: not done: {result.reason}")
        else:
            for task in self._tasks.values():
                if task.number == result.number:
                    self._finish(task, "" if result.accepted else result.reason, now)

    def _finish(self, task: _Task, fault: str, now: int) -> None:
        """Go on with the next actuator of a stop; with none after a fault."""
        move, task.left = task.left[0], task.left[1:]
        task.number = task.since = None
        if fault:
            more = f"; nor {', '.join(one.actuator for one in task.left)}" if task.left else ""
            text = f"{task.stop.id}: {move.actuator}: {move.position}: not done: {fault}{more}"
            self.log.alert(now, _KIND, text)
            task.left = []
            if self.robot.mission.on_actuator_failure != "continue":
                self._failure = text

    def attend(self, stop: QueuedWaypoint, odometry: Odometry, now: int) -> bool:
        """Do what is due for `stop`, at which the drone is.

        Args:
            stop: The stop whose moves are carried out.
            odometry: Where the drone is.
            now: Mission clock, nanoseconds.

        Returns:
            Whether the drone has to stay there for it; never for longer than the time-out of each
            actuator.
        """
        if stop.waypoint.action(MoveActuator) is None:
            return False
        task = self._tasks.get(stop.id)
        if task is None or task.stop is not stop:
            moves = [one for one in stop.waypoint.actions if isinstance(one, MoveActuator)]
            task = self._tasks[stop.id] = _Task(stop, moves)
        task.attended = now
        if not task.left or not stop.arrived:
            return bool(task.left)
        try:
            self._advance(task, odometry.position, now)
        except VehicleError as error:
            self._finish(task, str(error), now)
        except Exception as error:  # noqa: BLE001 - a driver's actuators must not end a flight
            self._finish(task, failure_line(error), now)
        return bool(task.left)

    def _advance(self, task: _Task, position: Vector, now: int) -> None:
        """Ask for what is due; raises what the driver raises."""
        actuators = self._actuators()
        task.since = now if task.since is None else task.since
        # The drone may have been blown away since it arrived.
        away = length(task.stop.waypoint.position - position)
        near = away <= self.robot.limits.arrival_radius
        timeout = self.robot.mission.actuator_timeout
        if seconds(now - task.since) > timeout:
            if task.number is None:
                raise VehicleError(f"the drone did not stay at its place within {timeout:g} s")
            actuators.withdraw(task.number)
            raise VehicleError(f"not told within {timeout:g} s that it is done")
        if task.number is None and near:
            task.number = actuators.move(*task.left[0].names)

    def _actuators(self) -> Actuators:
        actuators = None if self.vehicle is None else self.vehicle.actuators
        if actuators is None:
            raise VehicleError("the vehicle has no actuators")
        return actuators
