"""Drone nodes in simulated time, stepped by the inline executor as a test wants."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar

from aerodaas.clock import NANOSECONDS
from aerodaas.config.model import EnvironmentConfig, RobotConfig
from aerodaas.drivers.simulated import SimulatedVehicle
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Header
from aerodaas.messages.mission import MissionState, MissionStatus
from aerodaas.messages.readings import Alert
from aerodaas.messages.vehicle import VehicleState
from aerodaas.mission.commands import Answer, Command
from aerodaas.mission.navigation.planner import InlinePlanner
from aerodaas.runtime.inline import InlineExecutor
from aerodaas.runtime.node import Outlet
from aerodaas.runtime.nodes.controller import RobotSpec
from aerodaas.runtime.nodes.drone import DroneNode
from aerodaas.runtime.session import Session
from aerodaas.schedulers.trajectory.nearest_neighbor import NearestNeighborScheduler

__all__ = ["DroneFlight", "UnreadableVehicle", "robot_spec"]


class UnreadableVehicle(SimulatedVehicle):
    """A simulated vehicle whose plug-in has a bug that a test can trigger."""

    unreadable: ClassVar[set[str]] = set()
    """Names of the robots whose `read` raises."""
    landings: ClassVar[list[str]] = []
    """Names of the robots that were told to land, in order."""

    def __init__(self, robot: RobotConfig, environment: EnvironmentConfig) -> None:
        """Make the drone of `robot`."""
        super().__init__(robot, environment)
        self._robot = robot.id

    def read(self) -> VehicleState:
        """Return the state, or raise what no driver should."""
        if self._robot in self.unreadable:
            raise TypeError("a bug of the driver's")
        return super().read()

    def land(self) -> None:
        """Note it, and land."""
        self.landings.append(self._robot)
        super().land()


class _InThisProcess(NearestNeighborScheduler):
    isolated = False


def robot_spec(
    robot: RobotConfig,
    *initial: Command,
    navigation: tuple[str, ...] = (),
    commands: tuple[str, ...] = (),
) -> RobotSpec:
    """A robot without sensors, whose plans need no process of their own."""
    return RobotSpec(
        robot=robot,
        sensors=(),
        navigation=navigation,
        commands=commands,
        initial=tuple(initial),
        scheduler=_InThisProcess(),
    )


class DroneFlight:
    """Drone nodes of one flight; commands and messages come between two moments."""

    def __init__(
        self,
        *names: str,
        robots: Sequence[dict[str, Any]],
        initial: Mapping[str, Sequence[Command]],
        navigation: tuple[str, ...] = (),
    ) -> None:
        """Start the nodes.

        Args:
            names: Names of the nodes: those of their robots, with `+` between them.
            robots: Robots of the environment.
            initial: Commands before the start, by robot.
            navigation: Streams of navigation of each robot.
        """
        content = {"name": "nodes", "robots": robots, "simulation": {"world": "empty"}}
        environment = EnvironmentConfig.model_validate(content)
        session = Session(environment, None)
        configs = {one.id: one for one in environment.robots}
        self.executor = InlineExecutor()
        self.nodes: dict[str, DroneNode] = {}
        self._outlets: dict[str, Outlet] = {}
        for name in names:
            specs = tuple(
                robot_spec(configs[one], *initial[one], navigation=navigation)
                for one in name.split("+")
            )
            node = DroneNode(
                session,
                name,
                specs,
                lambda spec: InlinePlanner(spec.scheduler),
                neighbours=[other for other in names if other != name],
                observed={},
            )
            self.nodes[name] = node
            self.executor.add(name, [node], first=True)
        self.executor.open(self.nodes.values())
        self.executor.start(self.nodes.values())

    def _node_of(self, robot: str) -> DroneNode:
        return next(node for node in self.nodes.values() if robot in node.robots)

    def until(self, holds: Callable[[], bool], seconds: float = 120.0) -> None:
        """Fly until `holds`, for `seconds` of mission time at most."""
        end = self.executor.clock.now() + int(seconds * NANOSECONDS)
        while not holds():
            moment = self.executor.next_moment
            assert moment <= end, f"it never happened: {self.alerts()}"
            self.executor.advance_to(moment)

    def fly(self, seconds: float) -> None:
        """Fly for so many seconds of mission time."""
        end = self.executor.clock.now() + int(seconds * NANOSECONDS)
        while self.executor.next_moment <= end:
            self.executor.advance_to(self.executor.next_moment)

    def command(self, command: Command, robot: str = "drone") -> Answer:
        """Execute a command on a robot's mission."""
        return self._node_of(robot).command(robot, command, self.executor.clock.now())

    def send(self, stream: str, item: object) -> None:
        """Publish an item as an analysis does."""
        outlet = self._outlets.setdefault(stream, Outlet(stream))
        header = Header(outlet.sent, self.executor.clock.now(), stream)
        self.executor.post(outlet.measure(item, header, 0))

    def tap(self, stream: str) -> Callable[[], list[Message[Any]]]:
        """A function that returns the new messages of a stream."""
        tap = self.executor.tap(stream)
        return lambda: tap.receive(0.0)

    def status(self, robot: str = "drone") -> MissionStatus:
        """Status of a robot's mission."""
        return self._node_of(robot).reports()[robot].mission

    def position(self, robot: str = "drone") -> Any:  # noqa: ANN401
        """Where a robot is, local ENU."""
        state = self._node_of(robot).reports()[robot].vehicle
        assert state is not None
        return state.odometry.position

    def is_in(self, state: MissionState, robot: str = "drone") -> bool:
        """Whether a robot's mission is in `state`."""
        return self.status(robot).state is state

    def alerts(self, kind: str = "") -> list[Alert]:
        """Alerts of all nodes, or of one kind."""
        parts = self.executor.parts.values()
        found = [alert for part in parts for alert in part.report().alerts]
        return [alert for alert in found if kind in {"", alert.kind}]

    def errors(self) -> dict[str, str]:
        """What ended nodes, by name."""
        parts = self.executor.parts.items()
        return {name: str(part.error) for name, part in parts if part.error is not None}
