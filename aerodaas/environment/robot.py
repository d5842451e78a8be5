"""Robot: the handle of one drone of an environment."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from aerodaas.config.extensions import service
from aerodaas.config.model import RobotConfig
from aerodaas.config.options import Speed
from aerodaas.dataflow.graph import NavigationEdge, refusal
from aerodaas.dataflow.handles import Sensor
from aerodaas.dataflow.interfaces import IAeroData, IRobot, ISensor
from aerodaas.dataflow.names import PaperNames
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.drivers.loading import load_vehicle
from aerodaas.errors import GraphError, UnknownIdError
from aerodaas.mission.commands import (
    Actuate,
    End,
    HandOver,
    Pause,
    ReleaseParachute,
    Resume,
    TakeBack,
)

if TYPE_CHECKING:
    from aerodaas.environment.environment import Environment

__all__ = ["Robot"]


class Robot(PaperNames, IRobot):
    """One drone of an environment."""

    def __init__(self, environment: Environment, config: RobotConfig) -> None:
        self.environment = environment
        self.config = config
        self.robot_id = config.id
        self.start_hooks: list[Callable[[], None]] = []
        self.end_hooks: list[Callable[[], None]] = []

    def has_sensors(self) -> bool:
        """Return True if the robot has any onboard sensors."""
        return bool(self.config.sensors)

    def get_sensors(self) -> list[ISensor[Any]]:
        """Return all the sensors on board."""
        return [self.environment.sensor(sensor) for sensor in self.config.sensors]

    def get_sensor_by_id(self, sensor_id: str) -> Sensor[Any]:
        """Return the requested sensor; raises UnknownIdError."""
        for sensor in self.config.sensors:
            if sensor_id in {sensor.id, sensor.full_id}:
                return self.environment.sensor(sensor)
        known = [sensor.id for sensor in self.config.sensors]
        raise UnknownIdError(f"sensor of {self.robot_id}", sensor_id, known)

    def is_navigable(self) -> bool:
        """Return True if the robot is navigable: its driver takes setpoints."""
        capabilities = load_vehicle(self.config, self.environment.config).capabilities
        return bool(capabilities.position_setpoints or capabilities.velocity_setpoints)

    def navigate(self, data: IAeroData[Any]) -> None:
        """Fly by this navigation: waypoints, or a stream of navigation; in flight, from now on.

        Raises GraphError if `data` is neither, or if this robot is not in the mission that flies,
        and MissionError for what the mission refuses in flight.
        """
        navigation = data
        if not isinstance(data, IAeroData):
            raise refusal(
                f"{self.robot_id} navigates by AeroListData([Waypoint(…), …]), AeroNavigation or a "
                f"stream of navigation, not by {type(data).__name__}"
            )
        if not isinstance(navigation, AeroNavigation):
            navigation = self.environment.trajectory_scheduler().generate_navigation(data)
        stream = navigation.stream
        if stream is not None and not issubclass(stream.item, AeroNavigation):
            raise GraphError(
                f"{self.robot_id} cannot navigate by {stream.name}, which carries "
                f"{stream.item.__name__}; put a follow analysis between"
            )
        if stream is not None and stream.graph is not self.environment.graph:
            raise GraphError(f"{stream.name} belongs to another Environment than {self.robot_id}")
        self.environment.fly_by(NavigationEdge(self.robot_id, navigation))

    def start_mission(
        self,
        hook: Callable[[], None] | None = None,
        *,
        wait: bool = True,
        speed: Speed | None = None,
    ) -> None:
        """Run `hook` and those of `on_start`, fly, and return when the mission has ended.

        While the mission flies, this waits for it; after its end, it flies again: the navigation
        given to `navigate` since, or else the same.

        Args:
            hook: Called before the flight, after the hooks of all robots' `on_start`.
            wait: Return when the mission has ended; if False, as soon as it flies.
            speed: Mission seconds per wall second, or `"max"`, as for `Environment.start_mission`.

        Raises:
            AeroDaaSError: What the mission ended with; the drone is landed and the recording is
                closed first.
        """
        self.environment.start_mission(hook, wait=wait, speed=speed)

    def end_mission(self) -> None:
        """End the mission: land here; the hooks of `on_end` run once it is over."""
        self.environment.command(self.robot_id, End())

    def pause_mission(self) -> None:
        """Pause the ongoing mission by putting the drone in hover mode."""
        self.environment.command(self.robot_id, Pause())

    def resume_mission(self) -> None:
        """Resume the ongoing mission."""
        self.environment.command(self.robot_id, Resume())

    def hand_over(self) -> None:
        """Have the autopilot fly the waypoints ahead by its own mission mode, while we watch.

        It returns once the upload has begun; an alert of the kind `handover` tells what became of
        it. Pausing, coming home and new navigation take them back, as a failsafe does. Raises
        MissionError, with the reason, for what the autopilot cannot fly.
        """
        self.environment.command(self.robot_id, HandOver())

    def take_back(self) -> None:
        """Fly the waypoints that the autopilot has not reached ourselves again.

        Raises MissionError if it flies none.
        """
        self.environment.command(self.robot_id, TakeBack())

    def actuate(self, actuator: str, position: str) -> None:
        """Have an actuator of the environment file take a position now, wherever the drone is.

        It returns once the mission has accepted the command; a failure is an alert of the kind
        `actuator`.

        Args:
            actuator: Id of an actuator of the environment file.
            position: One of its positions.

        Raises:
            GraphError: For an unknown actuator or position.
            MissionError: If the robot does not fly or refuses.
        """
        self._move(Actuate(actuator, position))

    def release_parachute(self, parachute: str) -> None:
        """Fire a parachute: the mission is over, and the drone comes down where it is.

        The environment file has to permit it by the parachute's `may_release`. Raises GraphError
        if it does not, and MissionError if the robot is not in the air or flies at a provider.
        """
        self._move(ReleaseParachute(parachute))

    def _move(self, command: Actuate | ReleaseParachute) -> None:
        if text := service("actuators.objection")(self.config, command):
            raise refusal(f"{self.robot_id}: {text}")
        self.environment.command(self.robot_id, command)

    def wait(self) -> None:
        """Return when the mission has ended; raises the error that it ended with."""
        self.environment.wait()

    def on_start(self, hook: Callable[[], None]) -> Callable[[], None]:
        """Register a hook to run before take-off; usable as a decorator.

        It runs when the mission is to fly, never where the application is only built.
        """
        self.start_hooks.append(hook)
        return hook

    def on_end(self, hook: Callable[[], None]) -> Callable[[], None]:
        """Register a hook to run after the mission has ended; usable as a decorator."""
        self.end_hooks.append(hook)
        return hook
