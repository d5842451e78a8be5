"""Actuators in a mission: moved at waypoints and by command, and what follows where one fails.

It only asks and looks, and never waits: the setpoint loop goes on while the drone hovers. A command
that a waypoint has given is withdrawn as soon as the drone no longer stays there for it, so that
nothing is dropped elsewhere by a late repetition. What has a position of rest is given it once the
drone comes home, so that nothing goes on spraying on the way.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from aerodaas.clock import NANOSECONDS, seconds
from aerodaas.config.checked import added_settings
from aerodaas.config.sections.actuators import RelayConfig, ServoConfig
from aerodaas.config.sections.robot import RobotConfig
from aerodaas.errors import VehicleError, failure_line
from aerodaas.extensions.actuators.actions import MoveActuator
from aerodaas.extensions.actuators.equipment import Actuators, MoveResult
from aerodaas.extensions.actuators.objections import command_objection, waypoint_objection
from aerodaas.extensions.actuators.settings import ActuatorMission
from aerodaas.geometry.frames import Vector, length
from aerodaas.messages.mission import MissionState
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.vehicle import equipment_of
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.action_executor import ActionExecutor
from aerodaas.mission.commands import Actuate, Answer, Command, ReleaseParachute
from aerodaas.mission.log import MissionLog
from aerodaas.mission.navigation.queue import QueuedWaypoint
from aerodaas.mission.state_machine import TERMINAL

__all__ = ["Actuation"]

_ON_GROUND = frozenset({MissionState.IDLE, MissionState.PREFLIGHT})
_UNPLANNED = frozenset({MissionState.RETURNING, MissionState.LANDING, *TERMINAL})
"""States of a drone that flies by no plan any more."""
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


class Actuation(ActionExecutor):
    """Actuators of one mission."""

    order: ClassVar[int] = 2

    def __init__(self, vehicle: object, robot: RobotConfig, log: MissionLog) -> None:
        """Use the `Actuators` in the equipment of `vehicle`; alerts go to `log`."""
        self._carried = equipment_of(vehicle, Actuators)
        self._robot = robot
        self._settings = added_settings(robot.mission, ActuatorMission)
        self._log = log
        self._tasks: dict[str, _Task] = {}
        self._asked: dict[int, str] = {}
        """What was asked for by command, by the command's number."""
        self._release: _Release | None = None
        self._released = ""
        """Parachute that was fired; empty for none."""
        self._failure = ""
        self._unplanned = False

    @classmethod
    def objection(cls, waypoint: Waypoint, robot: RobotConfig) -> str:
        """An actuator or a position that the robot has not."""
        return waypoint_objection(waypoint, robot)

    def handle(self, command: Command, state: MissionState, now: int) -> Answer | None:
        """Move an actuator, or fire a parachute in the air; a failure becomes an alert."""
        del now
        if not isinstance(command, Actuate | ReleaseParachute):
            return None
        if isinstance(command, ReleaseParachute) and state in _ON_GROUND:
            text = f"a parachute is fired in the air only, and the drone is {state.value}"
            return Answer(accepted=False, text=text)
        if text := command_objection(self._robot, command):
            return Answer(accepted=False, text=text)
        try:
            if isinstance(command, Actuate):
                self._move(command.actuator, command.position)
            else:
                number = self._actuators().release_parachute(command.parachute)
                self._release = _Release(command.parachute, number)
        except VehicleError as error:
            return Answer(accepted=False, text=str(error))
        return Answer(accepted=True)

    def _move(self, actuator: str, position: str) -> None:
        number = self._actuators().move(actuator, position)
        self._asked[number] = f"{actuator}: {position}"

    def ending(self) -> tuple[MissionState, str] | None:
        """A parachute has the drone land, and ends the flight once it is known to be out."""
        if self._released:
            return MissionState.ABORTED, f"the parachute {self._released} was released"
        if self._release is not None:
            return MissionState.LANDING, f"the parachute {self._release.name} is to open"
        return None

    def interruption(self) -> tuple[MissionState, str] | None:
        """A failure, where the environment file has the mission pause or return for it."""
        failure, self._failure = self._failure, ""
        follows = self._settings.on_actuator_failure
        if not failure or follows == "continue":
            return None
        return MissionState.PAUSED if follows == "pause" else MissionState.RETURNING, failure

    def poll(self, now: int) -> None:
        """Process the results of commands, and withdraw those of a stop that was left.

        `now` is the mission clock, nanoseconds.
        """
        try:
            actuators = self._carried
            for result in () if actuators is None else actuators.results():
                self._on_result(result, now)
            for task in self._tasks.values():
                if actuators is not None and now - task.attended > _INTERRUPTED:
                    self._withdraw(task, actuators)
        except Exception as error:  # noqa: BLE001 - a driver's actuators must not end a flight
            self._log.alert(now, _KIND, f"the actuators: {failure_line(error)}")

    def on_state(self, state: MissionState, now: int) -> None:
        """Give its rest to all that has one, if the drone flies by no plan from now on."""
        begins, self._unplanned = state in _UNPLANNED and not self._unplanned, state in _UNPLANNED
        if not begins:
            return
        for one in self._robot.actuators:
            if isinstance(one, RelayConfig | ServoConfig) and one.rest is not None:
                self._rest(one.id, one.rest, now)

    def _rest(self, name: str, position: str, now: int) -> None:
        try:
            # What a stop asked for might be repeated after it.
            for task in self._tasks.values():
                self._withdraw(task, self._actuators())
            self._move(name, position)
        except VehicleError as error:
            self._log.alert(now, _KIND, f"{name}: {position}: not done: {error}")
        except Exception as error:  # noqa: BLE001 - a driver's actuators must not end a flight
            self._log.alert(now, _KIND, f"{name}: {position}: not done: {failure_line(error)}")

    @staticmethod
    def _withdraw(task: _Task, actuators: Actuators) -> None:
        if task.number is not None:
            actuators.withdraw(task.number)
            task.number = task.since = None

    def _on_result(self, result: MoveResult, now: int) -> None:
        release, asked = self._release, self._asked.pop(result.number, None)
        if release is not None and release.number == result.number:
            self._release = None
            self._released = release.name if result.accepted else ""
            text = f"the parachute {release.name} was released"
            if not result.accepted:
                text = f"the parachute {release.name} was not released: {result.reason}"
            self._log.alert(now, "parachute", text)
        elif asked is not None:
            if not result.accepted:
                self._log.alert(now, _KIND, f"{asked}: not done: {result.reason}")
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
            self._log.alert(now, _KIND, text)
            task.left = []
            self._failure = text

    def attend(self, stop: QueuedWaypoint, odometry: Odometry, now: int) -> bool:
        """Move what is due at a stop; no actuator keeps the drone there beyond its time-out."""
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
        near = away <= self._robot.limits.arrival_radius
        timeout = self._settings.actuator_timeout
        if seconds(now - task.since) > timeout:
            if task.number is None:
                raise VehicleError(f"the drone did not stay at its place within {timeout:g} s")
            actuators.withdraw(task.number)
            raise VehicleError(f"not told within {timeout:g} s that it is done")
        if task.number is None and near:
            task.number = actuators.move(*task.left[0].names)

    def _actuators(self) -> Actuators:
        if self._carried is None:
            raise VehicleError("the vehicle has no actuators")
        return self._carried
