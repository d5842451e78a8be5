"""Planning of a run: from an application's graph to its actors."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from aerodaas.analytics.base import Analytics
from aerodaas.config.model import (
    ComputeConfig,
    RobotConfig,
    RuntimeEnvConfig,
    SensorConfig,
    TaskConfig,
)
from aerodaas.config.plugins import load_plugin
from aerodaas.dataflow.graph import Graph, NavigationEdge, Node
from aerodaas.dataflow.handles import SENSOR_ITEMS
from aerodaas.errors import GraphError
from aerodaas.identifiers import told
from aerodaas.messages.frames import Frame
from aerodaas.mission.commands import TRIGGERED, initial_commands
from aerodaas.runtime.checks import check_graph, check_places, check_plugins, check_tasks
from aerodaas.runtime.dispatch.dispatcher import Managed
from aerodaas.runtime.dispatch.offload import (
    CloudProcess,
    allowed,
    cloud_processes,
    priced,
    short_name,
)
from aerodaas.runtime.dispatch.simulated import Executions
from aerodaas.runtime.hosting import by_actor
from aerodaas.runtime.nodes.analysis import AnalysisSpec, Wake
from aerodaas.runtime.nodes.camera import CameraNode
from aerodaas.runtime.nodes.controller import RobotSpec, VehicleController
from aerodaas.runtime.nodes.triggers import TriggerSpec
from aerodaas.runtime.placement import Placement
from aerodaas.runtime.session import FRAME_DEPTH, MESSAGE_DEPTH, Session
from aerodaas.runtime.stream_names import (
    DECISIONS,
    alert_stream,
    done_stream,
    end_stream,
    state_stream,
    task_stream,
    trigger_stream,
)
from aerodaas.schedulers.analytics.base import AnalyticsScheduler, Resources
from aerodaas.schedulers.analytics.published.profiles import told_profile
from aerodaas.schedulers.trajectory.base import TrajectoryScheduler

__all__ = ["ActorPlan", "CameraSpec", "DispatchPlan", "FlightPlan", "make_plan"]


@dataclass(frozen=True)
class CameraSpec:
    """Specification of one camera for its node."""

    stream: str
    sensor: SensorConfig
    state: str
    ends: bool
    place: Placement
    niceness: int = 5
    """Of its process: images must not wait for analyses."""

    def make(self, session: Session) -> CameraNode:
        """Make the node."""
        return CameraNode(session, self.stream, self.sensor, self.state, ends=self.ends)


@dataclass(frozen=True)
class ActorPlan:
    """Nodes that share a process, as in ROS 2's component containers.

    A frame is looked at, and recorded, where it was captured.
    """

    name: str
    place: Placement
    cameras: tuple[CameraSpec, ...] = ()
    analyses: tuple[AnalysisSpec, ...] = ()
    runtime_env: RuntimeEnvConfig | None = None
    records: bool = False
    """Whether the recorder is one of them."""


@dataclass(frozen=True)
class DispatchPlan:
    """Plan of the dispatcher's actor and the executors in the cloud."""

    scheduler: AnalyticsScheduler
    managed: tuple[Managed, ...]
    resources: Resources
    cloud: tuple[CloudProcess, ...]


@dataclass(frozen=True)
class FlightPlan:
    """Plan of all actors of a run."""

    session: Session
    drones: tuple[tuple[RobotSpec, ...], ...]
    """Robots by drone actor."""
    edges: tuple[Placement, ...]
    """Place of each drone actor."""
    actors: tuple[ActorPlan, ...]
    """Cameras, analyses and recorder, by process."""
    dispatch: DispatchPlan | None
    observed: dict[str, float] | None
    """Rates in Hz of what measures a simulated vehicle, by source; None in real time."""
    recorded: dict[str, int]
    """Streams for the recorder and their queue depths; empty without a recorder."""

    @property
    def cameras(self) -> tuple[CameraSpec, ...]:
        """The cameras of all actors."""
        return tuple(camera for actor in self.actors for camera in actor.cameras)

    @property
    def analyses(self) -> tuple[AnalysisSpec, ...]:
        """The analyses of all actors."""
        return tuple(spec for actor in self.actors for spec in actor.analyses)

    @property
    def recorder_actor(self) -> str:
        """Name of the actor that records; empty without one."""
        return next((actor.name for actor in self.actors if actor.records), "")

    @property
    def drone_actors(self) -> tuple[str, ...]:
        """Names of the drone actors, in the order of `drones`."""
        return _names(self.drones)


class _Planner:
    """Planner of one graph's actors."""

    def __init__(
        self,
        session: Session,
        graph: Graph,
        compute: list[ComputeConfig],
        scheduler: TrajectoryScheduler,
        dispatch_with: AnalyticsScheduler | None,
    ) -> None:
        self.session = session
        self.graph = graph
        self.scheduler = scheduler
        self.dispatch_with = dispatch_with
        self.compute = {
            one.id: one for one in compute if session.simulates_executions or not one.simulated
        }
        named = {edge.robot for edge in graph.navigation}
        self.robots = [r for r in session.environment.robots if r.id in named]
        self.recorded = session.environment.recording.enabled
        self._add_sensors()
        self.steering = {name for edge in graph.navigation for name in _streams_of(edge)}

    def _add_sensors(self) -> None:
        """Add sensors that the application does not read; cameras only if recorded."""
        for robot in self.robots:
            for sensor in robot.sensors:
                stream = f"{robot.id}/{sensor.id}"
                shows = self.recorded and self.session.environment.has_pictures(sensor)
                wanted = shows or sensor.type != "camera"
                if sensor.driver == "replayed" or not wanted or stream in self.graph.nodes:
                    continue
                item = SENSOR_ITEMS[sensor.type]
                self.graph.add(Node(stream, "sensor", item, sensor, robot.id))

    def sensors(self) -> list[Node]:
        return [node for node in self.graph.nodes.values() if node.kind == "sensor"]

    def analyses(self) -> list[Node]:
        return [node for node in self.graph.nodes.values() if node.kind != "sensor"]

    def robot_of(self, node: Node) -> str:
        return node.robot or (self.robots or self.session.environment.robots)[0].id

    def state_of(self, node: Node) -> str:
        return state_stream(self.robot_of(node))

    def reaches_a_drone(self, stream: str, asked: frozenset[str] = frozenset()) -> bool:
        """Return whether items of `stream` can affect a drone.

        By navigation, by a trigger's command, or by waking an analysis that can; `asked` are the
        streams visited by the recursion.
        """
        if stream in self.steering:
            return True
        node = self.graph.nodes.get(stream)
        triggers = node.triggers if node is not None else []
        further = {trigger.target for trigger in triggers if trigger.method is None}
        further |= {reader.id for reader in self.graph.downstream(stream)}
        return any(trigger.method is not None for trigger in triggers) or any(
            self.reaches_a_drone(one, asked | {stream}) for one in further - asked
        )

    def cameras(self) -> tuple[CameraSpec, ...]:
        return tuple(
            CameraSpec(
                node.id,
                node.work,
                self.state_of(node),
                self.reaches_a_drone(node.id),
                self.edge_of(node.robot),
            )
            for node in self.sensors()
            if node.work.type == "camera"
        )

    def is_managed(self, node: Node) -> bool:
        """Whether the dispatcher manages `node`: an analysis of frames that is `scheduled`."""
        if self.dispatch_with is None or not node.work.scheduled or not node.inputs:
            return False
        return all(self.graph.nodes[name].item is Frame for name in node.inputs)

    def managed(self) -> list[Node]:
        return [node for node in self.analyses() if self.is_managed(node)]

    def dispatching(self) -> DispatchPlan | None:
        nodes = self.managed()
        if self.dispatch_with is None or not nodes:
            return None
        Executions.of(self.session.environment.simulation)  # so that a wrong one is told here
        # In simulated time the cloud has no processes: it is simulated, or of no benefit, because
        # time is held while an analysis runs.
        compute = {} if self.session.simulated else self.compute
        envs = {node.id: self.runtime_env_of(node) for node in nodes}
        return DispatchPlan(
            scheduler=self.dispatch_with,
            managed=tuple(self.managed_one(node) for node in nodes),
            resources=Resources(cloud_slots=self.cloud_slots(nodes)),
            cloud=cloud_processes(nodes, compute, envs),
        )

    def cloud_slots(self, nodes: list[Node]) -> int:
        """Executions that the cloud has room for at once."""
        if self.session.simulated and not self.session.simulates_executions:
            return 0
        sites = {one.id: one for node in nodes for one in allowed(node, self.compute)}
        return sum(one.executors for one in sites.values())

    def managed_one(self, node: Node) -> Managed:
        schedulers = self.session.environment.schedulers
        own = told(node.id, schedulers.tasks) or TaskConfig()
        times = ("edge_time", "cloud_time")
        profile = told_profile(node.id, schedulers)
        sites = allowed(node, self.compute)
        return Managed(
            stream=node.id,
            inputs=tuple(node.inputs),
            profile=priced(profile, sites),
            open_times=frozenset(time for time in times if getattr(own, time) is None),
            triggers=self.triggers_of(node),
            offloadable=bool(sites),
        )

    @staticmethod
    def triggers_of(node: Node) -> tuple[TriggerSpec, ...]:
        return tuple(
            TriggerSpec(
                trigger_stream(trigger.target, node.id),
                TRIGGERED[trigger.method] if trigger.method else Wake(),
                trigger.when,
            )
            for trigger in node.triggers
        )

    def analysis_spec(self, node: Node) -> AnalysisSpec:
        managed = self.is_managed(node)
        wakers = [n for n in self.analyses() if any(t.target == node.id for t in n.triggers)]
        return AnalysisSpec(
            stream=done_stream(node.id) if managed else node.id,
            work=self.work_of(node),
            inputs={
                name: self.depth(name) if self.session.simulated else 1
                for name in ([task_stream(node.id)] if managed else node.inputs)
            },
            robot=self.robot_of(node),
            state=self.state_of(node),
            external=node.kind == "external",
            dormant=node.dormant,
            # The dispatcher publishes the results of managed analyses, from edge and cloud.
            triggers=() if managed else self.triggers_of(node),
            kind=self.place_of(node).kind,
            answers_always=managed,
            wakes=tuple(trigger_stream(node.id, waker.id) for waker in wakers),
            frames=tuple(node.inputs) if managed else (),
        )

    def depth(self, stream: str) -> int:
        """Queue depth of `stream` for a reader of all messages."""
        node = self.graph.nodes.get(stream.removesuffix(task_stream("")))
        frames = stream.endswith(task_stream("")) or (node is not None and node.item is Frame)
        return FRAME_DEPTH if frames else MESSAGE_DEPTH

    def edge_of(self, robot: str | None) -> Placement:
        """Edge of a robot; the default one for a node without a robot."""
        named = next((r.edge for r in self.robots if r.id == robot), None)
        return Placement("edge", self.compute[named].node) if named is not None else Placement()

    def place_of(self, node: Node) -> Placement:
        resource = self.compute[node.compute] if node.compute is not None else None
        # A managed analysis always has an executor on the edge; an endpoint is called from the
        # edge.
        if resource is None or resource.kind == "http" or self.is_managed(node):
            return self.edge_of(node.robot)
        return Placement(resource.kind, resource.node)

    def work_of(self, node: Node) -> Analytics[Any]:
        """The analysis itself, or the client of the endpoint that it is deployed on."""
        resource = self.compute[node.compute] if node.compute is not None else None
        work: Analytics[Any] = node.work
        if resource is None or resource.kind != "http" or self.is_managed(node):
            return work
        from aerodaas.analytics.endpoint.analysis import (  # noqa: PLC0415 - loads HTTP
            endpoint_analysis,
        )

        return endpoint_analysis(work, short_name(node), resource, strict=False)

    def runtime_env_of(self, node: Node) -> RuntimeEnvConfig | None:
        """Runtime environment of an analysis; the environment file's overrides its own."""
        return told(node.id, self.session.environment.runtime_env) or node.runtime_env

    def actors(self) -> tuple[ActorPlan, ...]:
        """Actors of cameras, analyses and recorder.

        Those of one place share one. Apart are `isolated` analyses, those with an environment of
        their own, those that the dispatcher manages (an executor that hangs keeps no camera
        waiting), and cameras that decode what a stranger may send.
        """
        cameras: dict[Placement, list[CameraSpec]] = {}
        analyses: dict[Placement, list[AnalysisSpec]] = {}
        managed: dict[Placement, list[AnalysisSpec]] = {}
        apart = []
        for camera in self.cameras():
            if self.is_confined(camera):
                apart.append(ActorPlan(f"sensor/{camera.stream}", camera.place, (camera,)))
            else:
                cameras.setdefault(camera.place, []).append(camera)
        for node in self.analyses():
            env, spec, place = (
                self.runtime_env_of(node),
                self.analysis_spec(node),
                self.place_of(node),
            )
            if node.work.isolated or env is not None:
                apart.append(ActorPlan(f"analytics/{node.id}", place, (), (spec,), env))
            else:
                group = managed if self.is_managed(node) else analyses
                group.setdefault(place, []).append(spec)
        apart += [
            ActorPlan(f"analytics/{place.node or place.kind}", place, (), tuple(specs))
            for place, specs in managed.items()
        ]
        home = [Placement()] if self.recorded else []
        places: list[Placement] = list(dict.fromkeys([*cameras, *analyses, *home]))
        shared = [
            ActorPlan(
                place.node or place.kind,
                place,
                tuple(cameras.get(place, ())),
                tuple(analyses.get(place, ())),
                records=self.recorded and place == Placement(),
            )
            for place in places
        ]
        return (*apart, *shared)

    def is_confined(self, camera: CameraSpec) -> bool:
        """Whether a camera needs a process whose memory can be limited."""
        driver = self.session.environment.camera_driver(camera.sensor)
        return hasattr(load_plugin("cameras", driver), "most_memory")

    def robot_spec(self, robot: RobotConfig) -> RobotSpec:
        edges = [edge for edge in self.graph.navigation if edge.robot == robot.id]
        mine = [node for node in self.sensors() if node.robot == robot.id]
        commanding = [end_stream(camera.stream) for camera in self.cameras() if camera.ends]
        commanding += [
            trigger_stream(robot.id, node.id)
            for node in self.analyses()
            if any(trigger.target == robot.id for trigger in node.triggers)
        ]
        return RobotSpec(
            robot=robot,
            sensors=tuple(node.work for node in mine if node.work.type != "camera"),
            navigation=tuple(dict.fromkeys(n for edge in edges for n in _streams_of(edge))),
            commands=tuple(commanding),
            initial=tuple(initial_commands(edges)),
            scheduler=self.scheduler,
        )

    def observed(self, cameras: tuple[CameraSpec, ...]) -> dict[str, float]:
        """Rates of what measures a simulated vehicle: cameras and external sources."""
        rates = {camera.stream: camera.sensor.rate for camera in cameras}
        external = [node for node in self.analyses() if node.kind == "external"]
        return {**rates, **{node.id: node.work.rate for node in external}}


def make_plan(
    session: Session,
    graph: Graph,
    compute: list[ComputeConfig],
    scheduler: TrajectoryScheduler,
    dispatch_with: AnalyticsScheduler | None = None,
    *,
    here: bool = True,
    senses_only: bool = False,
) -> FlightPlan:
    """Plan the actors of a graph.

    Args:
        session: The flight's session, with its environment.
        graph: The graph.
        compute: Resources of the environment.
        scheduler: The trajectory scheduler.
        dispatch_with: The analytics scheduler, which decides when and where `scheduled` analyses
            run.
        here: Whether all actors run on this machine.
        senses_only: Whether the graph need not navigate.

    Raises:
        AeroDaaSError: If the graph cannot fly, with the remedy.
    """
    planner = _Planner(session, graph, compute, scheduler, dispatch_with)
    if not planner.robots and not senses_only:
        raise GraphError("no robot navigates: call drone.navigate(…) before start_mission()")
    check_graph(graph, session.environment, {robot.id for robot in planner.robots})
    check_places(graph, planner.compute)
    if dispatch_with is not None:
        check_tasks(graph, session.environment)
    lenses = [node.work for node in planner.sensors() if node.work.type == "camera"]
    check_plugins(session.environment, planner.robots, lenses, here=here)
    specs = tuple(planner.robot_spec(robot) for robot in planner.robots)
    cameras = planner.cameras()
    actors = planner.actors()
    streams = [stream for spec in specs for stream in VehicleController.streams(spec)]
    streams += [camera.stream for camera in cameras]
    streams += [node.id for node in planner.analyses()]
    dispatch = planner.dispatching()
    if dispatch is not None:
        streams.append(DECISIONS)
    drones = by_actor(specs, [planner.edge_of(one.robot.id) for one in specs], session)
    names = [*_names(drones)]
    names += [actor.name for actor in actors]
    names += ["dispatcher"] if dispatch is not None else []
    streams += [alert_stream(name) for name in names]
    return FlightPlan(
        session=replace(session, environment=session.environment.for_actors()),
        drones=drones,
        edges=tuple(planner.edge_of(group[0].robot.id) for group in drones),
        actors=actors,
        dispatch=dispatch,
        observed=planner.observed(cameras) if session.simulated else None,
        recorded={stream: planner.depth(stream) for stream in streams} if planner.recorded else {},
    )


def _names(drones: tuple[tuple[RobotSpec, ...], ...]) -> tuple[str, ...]:
    return tuple(f"drone/{'+'.join(spec.robot.id for spec in group)}" for group in drones)


def _streams_of(edge: NavigationEdge) -> list[str]:
    names = [edge.navigation.stream.name] if edge.navigation.stream is not None else []
    return [*names, edge.clear_on] if edge.clear_on else names
