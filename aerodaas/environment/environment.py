"""Environment: the handle by which an application builds its graph and flies it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, Literal

from aerodaas.config.model import ComputeConfig, EnvironmentConfig, SensorConfig
from aerodaas.config.options import Speed, current_options
from aerodaas.config.plugins import load_plugin
from aerodaas.dataflow.graph import Graph, NavigationEdge, application_line, refusal
from aerodaas.dataflow.handles import Compute, Here, Sensor
from aerodaas.dataflow.interfaces import IEnvironment, INavigate, IRobot, ISensor
from aerodaas.dataflow.names import PaperNames
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.environment.offering import BuildOnlyMission, note_built, offer
from aerodaas.environment.robot import Robot
from aerodaas.environment.run import Run
from aerodaas.environment.source import EnvironmentSource
from aerodaas.errors import ConfigError, GraphError, MissionError, UnknownIdError
from aerodaas.identifiers import find_scoped
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.action_executor import action_objection
from aerodaas.mission.commands import AddNavigation, Command, End, initial_commands
from aerodaas.runtime.checks import check_environment, sensor_properties
from aerodaas.runtime.placement import Placement
from aerodaas.schedulers.analytics.base import AnalyticsScheduler
from aerodaas.schedulers.analytics.registry import load_scheduler
from aerodaas.schedulers.trajectory.base import NavigationEntry, TrajectoryScheduler

if TYPE_CHECKING:
    from aerodaas.environment.provider.run import ProvidedRun
    from aerodaas.service.own.view import ConsoleView

__all__ = ["Environment"]


class Environment(PaperNames, IEnvironment):
    """Robots, sensors and compute resources of an environment file, and one application's graph.

    A relative path is looked up beside the application's file, then in the working directory.
    `overrides` lays settings over the file, by `id.setting`: `{"camera.rate": 5}`.
    Raises ConfigError for a file that is missing or malformed.

    `https://…` in the place of a path is the address of a provider's service: the application is
    built against the provider's catalogue and flown on its drones, as the account of `token`, of
    AERODAAS_TOKEN or of `aerodaas login`. Raises SourceError if the provider does not answer.
    """

    def __init__(
        self,
        path: str | Path = "environment.json",
        overrides: Mapping[str, Any] | None = None,
        *,
        token: str | None = None,
    ) -> None:
        source = EnvironmentSource.find(path, overrides, token, current_options.get())
        self.path, self.provider = source.path, source.client
        self.line = application_line()
        """The application's line that made it, as `file:line: code`."""
        self.config: EnvironmentConfig = source.config
        check_environment(self.config, source.place)
        self.env_data = self.config.model_dump(by_alias=True)
        """The environment file's content, for analyses that want it."""
        self.graph = Graph(sensor.full_id for sensor in self.config.all_sensors())
        self._mission: Run | ProvidedRun | BuildOnlyMission | None = None
        self._speed: Speed | None = None
        self._flights = 0
        self._flown = 0
        """Number of the graph's navigation edges that went to flights that have ended."""
        self._robots = {robot.id: Robot(self, robot) for robot in self.config.robots}
        self._start_hook: Callable[[], None] | None = None
        self._trajectory: TrajectoryScheduler | None = None
        self.chosen_trajectory: TrajectoryScheduler | None = None
        """The trajectory scheduler that the application plugged in, if any."""
        self.chosen_dispatch: object = None
        """The analytics scheduler as the application named it, if it did."""
        self._dispatch_with: AnalyticsScheduler | None = None
        self._compute: list[ComputeConfig] | None = None
        note_built(self)

    def _repr_mimebundle_(self, **_: object) -> dict[str, str]:
        """The graph as JupyterLab draws it, after the last line of a cell."""
        from aerodaas.dataflow.drawing import mermaid  # noqa: PLC0415 - only in notebooks

        return {"text/vnd.mermaid": mermaid(self.graph), "text/plain": repr(self)}

    @property
    def run(self) -> Run | None:
        """The flight of this process' own runtime; None before it, and where a provider flies.

        Raises GoesOnError in an application that is only built.
        """
        if self.unflown is not None:
            self.unflown.refuse()
        return self._mission if isinstance(self._mission, Run) else None

    @property
    def started(self) -> bool:
        """Whether `start_mission()` was called, of an application that is only built as well."""
        return self._flights > 0 or self.unflown is not None

    @property
    def unflown(self) -> BuildOnlyMission | None:
        """Mission of an application that is only built; None in a flight."""
        return self._mission if isinstance(self._mission, BuildOnlyMission) else None

    @property
    def has_hooks(self) -> bool:
        """Whether functions of the application are to run before or after its flight."""
        hooked = any(robot.start_hooks or robot.end_hooks for robot in self._robots.values())
        return hooked or self._start_hook is not None

    def has_env_sensors(self) -> bool:
        """Return True if the environment has sensors."""
        return bool(self.config.sensors)

    def get_env_sensors(self) -> list[ISensor[Any]]:
        """Return the sensors in the environment."""
        return [self.sensor(sensor) for sensor in self.config.sensors]

    def get_env_sensor_by_id(self, sensor_id: str) -> Sensor[Any]:
        """Return a sensor of the environment, or a robot's by `robot/sensor`.

        A robot's sensor may go by its short name where no other sensor has it. Raises
        UnknownIdError for one that there is not, AmbiguousIdError where several robots have it.
        """
        sensors = {sensor.full_id: sensor for sensor in self.config.all_sensors()}
        sensor = sensors[find_scoped("sensor", sensor_id, sensors)]
        return self.sensor(sensor)

    def get_env_robots(self) -> list[IRobot]:
        """Return all the robots available in the environment."""
        return list(self._robots.values())

    def get_robot_by_id(self, robot_id: str) -> Robot:
        """Return the requested robot; raises UnknownIdError."""
        if robot_id not in self._robots:
            raise UnknownIdError("robot", robot_id, list(self._robots))
        return self._robots[robot_id]

    def is_robot_sensor_available(self, sensor_id: str) -> bool:
        """Return True if a robot has the required onboard sensor, by `robot/sensor` or its id."""
        sensors = [sensor for robot in self.config.robots for sensor in robot.sensors]
        return any(sensor_id in {sensor.id, sensor.full_id} for sensor in sensors)

    def get_robot_sensors(self) -> list[ISensor[Any]]:
        """Return the sensors of all robots in the environment."""
        return [sensor for robot in self._robots.values() for sensor in robot.get_sensors()]

    def get_compute_resources(self) -> list[Any]:
        """Return all the compute resources available: of the file, or of the cluster if "auto"."""
        return [self._resource(resource) for resource in self.compute()]

    def get_compute_resource_by_id(self, compute_id: str) -> Compute:
        """Return the requested compute resource; raises UnknownIdError."""
        for resource in self.compute():
            if resource.id == compute_id:
                return self._resource(resource)
        raise UnknownIdError("compute resource", compute_id, [one.id for one in self.compute()])

    @property
    def here(self) -> Here:
        """The user's own side, to `deploy` analyses on whose code stays there.

        A provider flies such an analysis without its code: its items come to this process over
        the wire, and its results go back. In a flight of one's own it runs on the edge node beside
        the drone, as one that is not deployed.
        """
        return Here(self.graph)

    def share_out(
        self,
        waypoints: Sequence[Waypoint],
        *,
        objective: Literal["energy", "time"] = "energy",
        budget: float = 2.0,
    ) -> dict[str, list[Waypoint]]:
        """Share waypoints out over all robots; each flies its tour and comes home.

        A robot's charge less its reserve bounds its tour. Waypoints that no robot can serve, or
        not by their deadline, are left out.

        Args:
            waypoints: Local or global waypoints.
            objective: `energy` for the least energy of all robots together, `time` for the
                earliest return of the last robot.
            budget: Seconds to search for.

        Returns:
            The waypoints of each robot in order, local ENU, by the robot's id.

        Raises:
            InvalidWaypointError: For a relative waypoint, or a global one without a `home` in the
                environment file.
            SchedulerError: Without PyVRP (on Python 3.10).
        """
        from aerodaas.environment.fleet import shared_waypoints  # noqa: PLC0415 - loads PyVRP

        return shared_waypoints(self.config, waypoints, objective, budget)

    def start_mission(
        self,
        hook: Callable[[], None] | None = None,
        *,
        wait: bool = True,
        speed: Speed | None = None,
    ) -> None:
        """Start the mission of every robot that navigates, as `Robot.start_mission` does.

        An application that is only built, as by `aerodaas check`, ends here; with `wait=False`
        where it wants something of the flight. Its hooks do not run.

        Args:
            hook: Called before the flight, after the hooks of all robots' `on_start`.
            wait: Return when the mission has ended; if False, as soon as it flies.
            speed: Mission seconds per wall second, or `"max"`: as fast as the machine goes, which
                is the default where every robot is simulated. `aerodaas run --speed` goes before
                it; a provider flies by the clock.

        Raises:
            AeroDaaSError: What the mission ended with; the drones are landed and the recording is
                closed first.
        """
        self._start_hook = hook
        # Before any hook: what belongs to the flight does not run where it is only built.
        if self._only_built():
            if wait:
                self.wait()
            return
        robots = self._robots.values()
        for each in [one for robot in robots for one in robot.start_hooks]:
            each()
        if hook is not None:
            hook()
        self._speed = speed
        run = self.launch_again()
        run.on_end += [one for robot in robots for one in robot.end_hooks if one not in run.on_end]
        if wait:
            run.wait()

    def console(self, address: str = "127.0.0.1:0", *, viewer: bool = False) -> ConsoleView:
        """Serve the console of the flight under way, from which it is watched and commanded.

        On the last line of a notebook's cell its page is shown there; elsewhere, print it for the
        address. It ends with the flight.

        Args:
            address: `host:port` to listen at; port 0 takes a free one.
            viewer: Give the address of who only watches.

        Raises:
            MissionError: If nothing flies, or a provider does, whose own address has the console.
            ConfigError: If the extra `remote` is missing, or the address cannot be listened on.
        """
        from aerodaas.service.own.view import ConsoleView  # noqa: PLC0415 - only where asked for

        if self.provider is not None:
            raise MissionError(
                f"the provider serves the console: open {self.provider.address.base}"
            )
        if self.run is None:
            raise MissionError("nothing flies: call start_mission(wait=False) first")
        return ConsoleView(self.run.console(address, viewer=viewer))

    def end_mission(self) -> None:
        """End the mission: every flying robot lands where it is."""
        for robot in dict.fromkeys(edge.robot for edge in self.graph.navigation):
            self.command(robot, End())

    def wait(self) -> None:
        """Return when the mission has ended; raises the error that it ended with."""
        if self._mission is not None:
            self._mission.wait()

    def set_trajectory_scheduler(
        self, scheduler: INavigate | str | type[TrajectoryScheduler]
    ) -> None:
        """Plug in the trajectory scheduler: a name, `module:Class`, a class, or an instance.

        Raises UnknownIdError for a name that there is not, ConfigError for what is no scheduler,
        GraphError in flight.
        """
        self.graph.require_idle("plug in a trajectory scheduler")
        self._trajectory = self.chosen_trajectory = self._trajectory_scheduler(scheduler)

    def set_analytics_scheduler(self, scheduler: Any) -> None:  # noqa: ANN401 - as the interface
        """Plug in the analytics scheduler: a name, `module:Class`, or an instance.

        Raises UnknownIdError or SchedulerError if it cannot be used.
        """
        self._dispatch_with = load_scheduler(scheduler)
        self.chosen_dispatch = scheduler

    def sensor(self, sensor: SensorConfig) -> Sensor[Any]:
        """The handle of a sensor."""
        return Sensor(self.graph, sensor, partial(sensor_properties, self.config, sensor))

    def _resource(self, resource: ComputeConfig) -> Compute:
        return Compute(self.graph, resource, partial(self._hardware, resource))

    def _hardware(self, resource: ComputeConfig) -> dict[str, Any]:
        if resource.kind == "http" or self.provider is not None:
            return {}
        cluster = _connected_cluster()
        found: dict[str, Any] = cluster.hardware(Placement(resource.kind, resource.node))
        return found

    def compute(self) -> list[ComputeConfig]:
        """The compute resources; those of the cluster where the file says "auto"."""
        if self._compute is None:
            if self.config.compute == "auto" and self.provider is None:
                discovered: list[ComputeConfig] = _connected_cluster().discover()
                self._compute = discovered
            else:
                listed = self.config.compute
                self._compute = [] if listed == "auto" else list(listed)
        return self._compute

    def trajectory_scheduler(self) -> TrajectoryScheduler:
        """The scheduler plugged in, or the one that the environment file names."""
        if self._trajectory is None:
            self._trajectory = self._trajectory_scheduler(self.config.schedulers.trajectory)
        return self._trajectory

    def _trajectory_scheduler(self, wanted: object) -> TrajectoryScheduler:
        scheduler = wanted
        if isinstance(wanted, str):
            scheduler = load_plugin("trajectory_schedulers", wanted)(self)
        elif isinstance(wanted, type):
            scheduler = wanted(self)
        if not isinstance(scheduler, TrajectoryScheduler):
            kind = type(scheduler).__name__
            raise ConfigError(f"a trajectory scheduler is a TrajectoryScheduler, not {kind}")
        return scheduler

    def analytics_scheduler(self) -> AnalyticsScheduler | None:
        """The scheduler plugged in, or the one that the environment file names, if any."""
        override = current_options.get().scheduler
        if override is not None:
            return load_scheduler(override)
        if self._dispatch_with is None and self.config.schedulers.analytics is not None:
            self._dispatch_with = load_scheduler(self.config.schedulers.analytics)
        return self._dispatch_with

    def navigation_waiting(self) -> list[NavigationEntry]:
        """Navigation given to a scheduler before the mission."""
        return [] if self._trajectory is None else list(self._trajectory.entries)

    def navigation_added(self, entry: NavigationEntry) -> bool:
        """Take navigation that a scheduler was given; False before the mission starts."""
        if entry.robot is not None:
            self.get_robot_by_id(entry.robot)
        flying = list(dict.fromkeys(edge.robot for edge in self.graph.navigation))
        if not self.graph.flying:
            # Without a robot's name it may be for the only robot that will fly.
            if len(flying) > 1:
                _addressee(entry, flying)
            return False
        robot = _addressee(entry, flying)
        self._require_flying(robot, entry.navigation)
        self.command(
            robot,
            AddNavigation(
                entry.navigation, entry.index, entry.deadline, clear_first=entry.clear_first
            ),
        )
        return True

    def fly_by(self, edge: NavigationEdge) -> None:
        """Record navigation of a robot; in flight, have the robot take it at once.

        Raises GraphError for what cannot be added in flight, MissionError for what the mission
        refuses.
        """
        _require_actions(self.config, edge)
        self._require_flying(edge.robot, edge.navigation)
        if self.graph.flying:
            for command in initial_commands([edge]):
                self.command(edge.robot, command)
        self.graph.navigation.append(edge)

    def _require_flying(self, robot: str, navigation: AeroNavigation) -> None:
        """Raise GraphError for a robot or a stream that did not take off with the mission."""
        graph = self.graph
        if navigation.stream is not None:
            graph.require_idle(f"navigate by {navigation.stream.name}")
        if graph.flying and robot not in {one.robot for one in graph.navigation}:
            raise GraphError(
                f"{robot} cannot join a mission in flight: call navigate() for every robot "
                "that is to fly before start_mission(), or fly it when this mission has ended"
            )

    def command(self, robot: str, command: Command) -> None:
        """Send a flying robot a command.

        Args:
            robot: Id of the robot.
            command: The command, carried out as a whole.

        Raises:
            MissionError: If the robot does not fly or refuses.
        """
        mission = self._mission
        if mission is None or robot not in {one.robot for one in self.graph.navigation}:
            raise MissionError(f"{robot} is not flying: call start_mission(wait=False) first")
        answer = mission.command(robot, command)
        if not answer.accepted:
            raise MissionError(f"{robot}: {answer.text}")

    def launch(self) -> Run:
        """Start the mission of every robot that navigates, once, by this process' own runtime."""
        mission = self.launched()
        if self.unflown is not None:
            self.unflown.refuse()
        if not isinstance(mission, Run):
            raise MissionError(f"the provider at {self.path} flies it: call start_mission()")
        return mission

    def launched(self) -> Run | ProvidedRun | BuildOnlyMission:
        """Start the mission of every robot that navigates, once; returns it."""
        if self._mission is None and not self._only_built():
            return self._start()
        assert self._mission is not None  # noqa: S101 - it flies, or what stands in for it
        return self._mission

    def launch_again(self) -> Run | ProvidedRun | BuildOnlyMission:
        """Start the first mission, or the next one after its end; returns a running one.

        The next mission flies the navigation given since the last one ended, and the streams of
        those before; without new navigation, it flies the same again.
        """
        if self._mission is None or not self._mission.over:
            return self.launched()
        self._mission.wait()
        edges = self.graph.navigation
        if self._flown < len(edges) or self.trajectory_scheduler().entries:
            old, new = edges[: self._flown], edges[self._flown :]
            edges[:] = [edge for edge in old if edge.navigation.stream is not None] + new
        return self._start()

    def _only_built(self) -> bool:
        """Whether the application is not to fly; then its environment is offered instead."""
        unflown = offer(self)
        if unflown is None:
            return False
        if self.unflown is None:
            self._mission, self.graph.reader = unflown, unflown.read
        return True

    def _start(self) -> Run | ProvidedRun:
        self.place_entries()
        self._flights += 1
        mission = self._mission = self._prepared()
        mission.on_end.append(self._note_flown)
        try:
            mission.start()
        except BaseException:
            self._mission = None
            raise
        return mission

    def _prepared(self) -> Run | ProvidedRun:
        if self.provider is None:
            return Run(self, self._flights, self._speed)
        from aerodaas.environment.provider.run import ProvidedRun  # noqa: PLC0415 - only then

        return ProvidedRun(self, self.provider, self._flights)

    def _note_flown(self) -> None:
        self._flown = len(self.graph.navigation)

    def place_entries(self) -> None:
        """Assign the scheduler's navigation to its robots.

        Raises GraphError if several fly and none is named.
        """
        entries = self.trajectory_scheduler().entries
        named = [edge.robot for edge in self.graph.navigation]
        named += [entry.robot for entry in entries if entry.robot is not None]
        robots = list(dict.fromkeys(named))
        if robots:
            for one in entries:
                _require_actions(self.config, _edge(_addressee(one, robots), one), one.line)
            self.graph.navigation += [_edge(_addressee(one, robots), one) for one in entries]
            entries.clear()


def _connected_cluster() -> ModuleType:
    """Module `ray_cluster`, connected to the cluster that is asked for."""
    from aerodaas.actors.cluster import ray_cluster  # noqa: PLC0415 - ray only where it is needed
    from aerodaas.actors.run.application import main_modules  # noqa: PLC0415
    from aerodaas.terminal.console import StartupView  # noqa: PLC0415 - slow to load

    options = current_options.get()
    with StartupView(options) as starting:
        ray_cluster.connect(options.address, starting.begin, main_modules())
    return ray_cluster


def _addressee(entry: NavigationEntry, flying: list[str]) -> str:
    """The robot of navigation without a robot's name; raises GraphError if there are several."""
    if entry.robot is not None:
        return entry.robot
    if len(flying) != 1:
        place = f"\n  at {entry.line}" if entry.line else ""
        raise GraphError(
            f"{' and '.join(flying)} fly, and nothing says which of them this is for: write "
            f"add_navigation(…, robot=drone), clear_navigation(robot=drone) or "
            f"drone.navigate(…){place}"
        )
    return flying[0]


def _edge(robot: str, entry: NavigationEntry) -> NavigationEdge:
    stream = entry.navigation.stream
    clear_on = stream.name if entry.clear_first and stream is not None else None
    return NavigationEdge(robot, entry.navigation, entry.index, entry.deadline, clear_on)


def _require_actions(config: EnvironmentConfig, edge: NavigationEdge, line: str = "") -> None:
    """Raise GraphError, by `line` or the line that calls, for actions that a robot cannot do."""
    robot = next((one for one in config.robots if one.id == edge.robot), None)
    if robot is None:
        return
    for waypoint in edge.navigation.waypoints:
        if text := action_objection(waypoint, robot):
            message = f"{edge.robot}: waypoint {waypoint.id!r}: {text}"
            raise GraphError(f"{message}\n  at {line}") if line else refusal(message)
