"""Base classes of analyses: part of a graph in the application, work of a node in flight.

A user's analysis is one class::

    class Brightness(Analytics[float]):
        accepts = (Frame,)
        produces = float

        def process(self, item: Frame, context: Context) -> float:
            return float(item.image.mean())

The instance is copied to where it runs before `open` is called there, so a constructor stores
only state that is cheap to copy and validates only the user's settings.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import (
    Any,
    ClassVar,
    Literal,
    Protocol,
    TypeAlias,
    TypeVar,
    get_args,
    get_origin,
    overload,
    runtime_checkable,
)

from typing_extensions import Self

from aerodaas.analytics.single_item import process_item
from aerodaas.config.model import RuntimeEnvConfig, TaskConfig, as_runtime_env
from aerodaas.dataflow.containers import AeroData
from aerodaas.dataflow.given_settings import GivenSettings
from aerodaas.dataflow.graph import AeroStreamData, Graph, Node, Trigger, refusal
from aerodaas.dataflow.handles import Here
from aerodaas.dataflow.interfaces import IAeroData, IAnalyse, ICompute, INavigableAnalyse
from aerodaas.dataflow.names import PaperNames, snake_case
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.errors import GraphError
from aerodaas.identifiers import require_name
from aerodaas.messages.readings import Alert
from aerodaas.messages.vehicle import VehicleState
from aerodaas.mission.commands import TRIGGERED

__all__ = [
    "Analytics",
    "ComputeKind",
    "Context",
    "NavigableAnalytics",
    "ResourceUse",
    "TimedContext",
]

ComputeKind: TypeAlias = Literal["edge", "cloud"]
ResourceUse: TypeAlias = Literal["model", "input", "output", "environment"]
"""A model file, a file that is read, a folder written to, what the environment file alone says."""
O_co = TypeVar("O_co", covariant=True)


class Context(Protocol):
    """Services of the node to the analysis that it runs."""

    def now(self) -> int:
        """Mission time of the item being processed, in nanoseconds."""
        ...

    def vehicle(self) -> VehicleState | None:
        """Newest state of the robot whose data is processed; None before the first."""
        ...

    def alert(self, alert: Alert) -> None:
        """Publish an alert to the operator: displayed, logged and recorded."""
        ...

    @property
    def kind(self) -> ComputeKind:
        """Compute resource on which it runs: the edge node beside the vehicle, or the cloud."""
        ...


@runtime_checkable
class TimedContext(Protocol):
    """A context with a deadline for the result."""

    def time_left(self) -> float | None:
        """Wall-clock seconds until the deadline; None without a deadline."""
        ...


class Analytics(GivenSettings, PaperNames, IAnalyse[O_co]):
    """An analysis; subclasses declare the types they accept and produce, and implement `process`.

    Life cycle in flight: `open` once, `process` for one item at a time (the newest one; in
    simulated time, every one in order), `close` once.
    """

    accepts: ClassVar[tuple[type, ...]] = (object,)
    """Item types that `analyse` takes."""
    produces: ClassVar[type] = object
    """Type of the results; by default the type argument of the base, as in `Analytics[float]`."""
    isolated: bool = False
    """True for an analysis that needs its own process, such as a neural network."""
    scheduled: bool = False
    """True for an analysis of frames whose every run is decided by the analytics scheduler."""
    concurrent: bool = False
    """True if several threads may call `process` at once, as executors in the cloud do."""
    task: TaskConfig | None = None
    """Benefit and costs for the scheduler, unless `schedulers.tasks` in the environment file gives
    them."""
    rate: float = 1.0
    """Polling rate of an external source (`instantiate`), in Hz."""
    name: str = ""
    """Name of the stream; by default the class name in snake_case."""
    resources: ClassVar[Mapping[str, ResourceUse]] = {}
    """Constructor's arguments that reach beyond the analysis; a mission document binds them."""

    node: Node | None = None
    """Node in the graph, once `analyse` or `instantiate` was called."""
    _graph: Graph | None = None
    _compute: str | None = None
    _here: bool = False
    _took_item: bool = False
    _runtime_env: RuntimeEnvConfig | None = None
    _triggers: tuple[Trigger, ...] = ()

    def __init_subclass__(cls, **more: Any) -> None:  # noqa: ANN401 - of other bases
        """Set `produces` from the type argument of the base, unless the class sets it."""
        super().__init_subclass__(**more)
        if "produces" in vars(cls):
            return
        for base in vars(cls).get("__orig_bases__", ()):
            results = [one for one in get_args(base) if isinstance(one, type) and one is not Any]
            if results and issubclass(get_origin(base), Analytics):
                cls.produces = results[0]

    def open(self) -> None:
        """Load models and connect; called once where it runs, before the mission starts."""

    def process(self, item: Any, context: Context) -> O_co | None:  # noqa: ANN401
        """Compute the result of one item.

        Args:
            item: Newest item of an analysed stream; None for an external source.
            context: Services of its node.

        Returns:
            The result to publish, or None for no result.
        """
        raise NotImplementedError

    def close(self) -> None:
        """Release the resources that `open` acquired.

        In the cloud, processes end without it: what must be kept belongs into results.
        """

    def deploy(
        self, compute: ICompute, runtime_env: RuntimeEnvConfig | Mapping[str, Any] | None = None
    ) -> Self:
        """Run on `compute`.

        Args:
            compute: Edge or cloud node, or endpoint; or `env.here`, the user's own side.
            runtime_env: The analysis' own runtime environment: `{"packages": ["torch==2.4.1"]}`,
                `{"env_vars": {…}}` or `{"image_uri": "…"}`; the environment file may replace it.
                Such an analysis runs in its own process.

        Returns:
            The analysis itself.

        Raises:
            ConfigError: If `runtime_env` is invalid.
            GraphError: If the analysis is already running.
        """
        # In a flight of one's own, the user's side is the edge beside the drone, as by default.
        self._here = isinstance(compute, Here)
        self._compute = None if self._here else compute.get_compute_id()
        self._graph = getattr(compute, "graph", None)
        if self._graph is not None:
            self._graph.note_deployed(self)
        if runtime_env is not None:
            self._runtime_env = as_runtime_env(runtime_env, f"{type(self).__name__}.deploy")
        if self.node is not None:
            self._require_idle("deploy it elsewhere")
            self.node.compute = self._compute
            self.node.runtime_env = self._runtime_env
        return self

    def beside(self, other: Analytics[Any]) -> Self:
        """Run on the compute resource and in the runtime environment of `other`; returns itself."""
        self._compute, self._graph = other._compute, other._graph
        self._here = other._here
        self._runtime_env = other._runtime_env
        return self

    @overload
    def analyse(self, data: AeroStreamData[Any]) -> AeroStreamData[O_co]: ...
    @overload
    def analyse(self, data: AeroData[Any]) -> AeroData[O_co | None]: ...
    def analyse(self, data: IAeroData[Any]) -> AeroStreamData[O_co] | AeroData[O_co | None]:
        """Analyse a stream, or a single item at once.

        Called again with a stream, the same analysis reads that one, too. A single item, such as
        `AeroData(frame)`, is processed in the application's process, without a mission.

        Args:
            data: A stream of items that the analysis accepts, or one such item.

        Returns:
            The stream of results; of a single item its result, which may be None.

        Raises:
            GraphError: If `data` is neither, or carries another type, and for a stream in flight.
            Exception: What the analysis' `open` raises, for a single item.
        """
        if isinstance(data, AeroStreamData):
            with data.graph.calling(self, data.name):
                return self._analyse_stream(data)
        if not isinstance(data, AeroData):
            message = (
                f"{type(self).__name__} takes a stream or AeroData, not {type(data).__name__}; "
                "get one with sensor.get_data_stream() or another analysis"
            )
            raise GraphError(message)
        item = data.get_data()
        self._prepare_for(type(item))
        self._took_item = True
        return AeroData(process_item(self, item))

    def _prepare_for(self, item: type) -> None:
        """Prepare for items of this type; raises GraphError for one that needs something else."""

    def _analyse_stream(self, data: AeroStreamData[Any]) -> AeroStreamData[O_co]:
        self._prepare_for(data.item)
        graph = data.graph
        graph.require_idle(f"analyse {data.name}")
        node = self._node_in(graph, graph.nodes[data.name].robot)
        graph.connect(data, node, self.accepts)
        return AeroStreamData(graph, node.id, self.produces)

    def instantiate(self) -> AeroStreamData[O_co]:
        """Start as an external source: `process(None, …)` is called at `rate`, without input.

        Returns:
            The stream of results.

        Raises:
            GraphError: If it was not deployed, and so belongs to no environment; in flight.
        """
        if self._graph is None:
            message = f"{type(self).__name__}: call deploy(compute) before instantiate()"
            raise GraphError(message)
        self._graph.require_idle("instantiate it")
        with self._graph.calling(self, None):
            node = self._node_in(self._graph, None)
            node.kind = "external"
        return AeroStreamData(self._graph, node.id, self.produces)

    def trigger(
        self,
        target: IAnalyse[Any] | Callable[[], None],
        when: Callable[[Any], bool] | None = None,
    ) -> Self:
        """Wake an analysis or call a robot's method when a result meets a condition.

        An analysis that is a target stays dormant until it is woken.

        Args:
            target: Another analysis, or a method such as `drone.end_mission`.
            when: Condition on each result; by default every result that is not None triggers.

        Returns:
            The analysis itself.

        Raises:
            GraphError: For any other target, for a `when` that is not callable, and in flight.
        """
        if when is not None and not callable(when):
            raise refusal(f"a trigger's `when` is a function of a result, not {when!r}")
        if isinstance(target, Analytics):
            if target.node is None:
                message = f"{type(target).__name__}: call analyse() before it is a trigger's target"
                raise GraphError(message)
            target._require_idle("be woken")  # noqa: SLF001 - of the same class
            target.node.dormant = True
            trigger = Trigger(target.node.id, when=when)
        else:
            robot = getattr(getattr(target, "__self__", None), "robot_id", None)
            command = getattr(target, "__name__", "")
            if robot is None or command not in TRIGGERED:
                what = f"{robot}.{command}" if robot is not None else repr(target)
                methods = ", ".join(f"drone.{method}" for method in TRIGGERED)
                raise refusal(f"a trigger wakes an analysis or calls {methods}; not {what}")
            trigger = Trigger(robot, command, when)
        if self.node is not None:
            self._require_idle("give it triggers")
            self.node.triggers.append(trigger)
        self._triggers = (*self._triggers, trigger)
        return self

    @property
    def analyses(self) -> bool:
        """Whether it was given a stream or an item, or instantiated."""
        return self.node is not None or self._took_item

    @property
    def deployed_here(self) -> bool:
        """Whether it was deployed on `env.here`."""
        return self._here

    @property
    def given_triggers(self) -> tuple[Trigger, ...]:
        """Triggers that `trigger` has added, in order."""
        return self._triggers

    def _require_idle(self, what: str) -> None:
        if self._graph is not None:
            self._graph.require_idle(what)

    def _node_in(self, graph: Graph, robot: str | None) -> Node:
        self._graph = graph
        if self.node is None:
            own = snake_case(type(self).__name__).removesuffix("_analytics")
            name = require_name(self.name or own, type(self).__name__)
            self.node = graph.add(
                Node(
                    id=f"{robot}/{name}" if robot else name,
                    kind="analytics",
                    item=self.produces,
                    work=self,
                    robot=robot,
                    compute=self._compute,
                    runtime_env=self._runtime_env,
                    triggers=list(self._triggers),
                )
            )
        return self.node

    def __getstate__(self) -> dict[str, Any]:
        """State without the graph and the constructor's arguments, to be copied in flight."""
        hidden = {"node", "_graph", "_given"}
        return {key: value for key, value in self.__dict__.items() if key not in hidden}


class NavigableAnalytics(Analytics[AeroNavigation], INavigableAnalyse):
    """An analysis whose results are navigation: waypoints or velocity commands."""

    produces: ClassVar[type] = AeroNavigation

    def generate_navigation(self, data: IAeroData[Any]) -> AeroStreamData[AeroNavigation]:
        """Turn a stream of results into a stream of navigation; the same as `analyse`.

        Raises:
            GraphError: If `data` is no stream, or carries another type.
        """
        if not isinstance(data, AeroStreamData):
            name = type(self).__name__
            raise GraphError(f"{name}.generate_navigation takes a stream, not a single item")
        return self.analyse(data)
