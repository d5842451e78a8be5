"""The application as a graph: what `analyse()` and `navigate()` record, and nothing else.

Nodes are sensors and analytics; edges are streams. Building checks types and shapes at once and
points at the application's own line; nothing runs before the mission starts. The runtime reads
the finished graph and attaches itself, after which the same stream objects are live.
"""

from __future__ import annotations

import contextlib
import inspect
import linecache
import typing
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar

from aerodaas.config.model import RuntimeEnvConfig
from aerodaas.dataflow.interfaces import IAeroData
from aerodaas.dataflow.names import PaperNames
from aerodaas.errors import GraphError

if TYPE_CHECKING:
    from aerodaas.dataflow.navigation import AeroNavigation

__all__ = [
    "AeroStreamData",
    "AnalysisCall",
    "Graph",
    "NavigationEdge",
    "Node",
    "NodeKind",
    "StreamReader",
    "Trigger",
    "application_line",
    "refusal",
]

E = TypeVar("E")
E_co = TypeVar("E_co", covariant=True)
NodeKind = typing.Literal["sensor", "analytics", "external"]
_PACKAGE = Path(__file__).resolve().parents[1]
# Folders of the package may stand elsewhere, behind links.
_OURS = (_PACKAGE, *((_PACKAGE / name).resolve() for name in ("actors", "schedulers")))
_APPLICATIONS = (_PACKAGE / "apps").resolve()


def application_line() -> str:
    """The application's line that called into this package, as `file:line: code`, or empty."""
    frame = inspect.currentframe()
    while frame is not None:
        path = Path(frame.f_code.co_filename).resolve()
        ours = any(path.is_relative_to(folder) for folder in _OURS)
        if not ours or path.is_relative_to(_APPLICATIONS):
            code = linecache.getline(str(path), frame.f_lineno).strip()
            return f"{path.name}:{frame.f_lineno}: {code}"
        frame = frame.f_back
    return ""


def refusal(message: str) -> GraphError:
    """An error that names the application's own line."""
    line = application_line()
    return GraphError(f"{message}\n  at {line}" if line else message)


class StreamReader(Protocol[E_co]):
    """A live subscription, provided by the runtime."""

    def next(self, timeout: float | None) -> E_co:
        """The next item; raises TimeoutError, or StopIteration once the mission has ended."""
        ...

    def newest(self, timeout: float | None) -> E_co:
        """The newest item, seen before or not; waits for the first one, and raises as `next`."""
        ...


@dataclass(frozen=True)
class Trigger:
    """Wakes an analysis, or calls a robot's method, when a result satisfies `when`."""

    target: str
    """Id of the node or of the robot."""
    method: str | None = None
    """Name of the robot's method; None for a node."""
    when: Callable[[Any], bool] | None = None


@dataclass
class Node:
    """One sensor or analysis."""

    id: str
    """Unique; also the name of its stream."""
    kind: NodeKind
    item: type
    """Type of the items in its stream."""
    work: Any
    """The node's work: a sensor's configuration or an analysis."""
    robot: str | None = None
    inputs: list[str] = field(default_factory=list)
    compute: str | None = None
    runtime_env: RuntimeEnvConfig | None = None
    """Its own packages, if the application names any."""
    triggers: list[Trigger] = field(default_factory=list)
    dormant: bool = False
    """Runs only once triggered."""


@dataclass(frozen=True)
class NavigationEdge:
    """Navigation that reaches a robot: waypoints known beforehand, or a stream."""

    robot: str
    navigation: AeroNavigation
    index: int | None = None
    deadline: float | None = None
    clear_on: str | None = None
    """Stream whose first item empties the queue."""


@dataclass(frozen=True)
class AnalysisCall:
    """One `analyse` or `instantiate` in the application."""

    work: Any
    """The analysis."""
    stream: str | None
    """Name of the stream that it was to analyse; None for `instantiate`."""


class Graph:
    """The dataflow of one application."""

    def __init__(self, sensors: Iterable[str] = ()) -> None:
        """Start empty; the ids of `sensors` are theirs, whether they are used or not."""
        self._sensors = frozenset(sensors)
        self.nodes: dict[str, Node] = {}
        self.navigation: list[NavigationEdge] = []
        self.calls: list[AnalysisCall] = []
        """What the application itself asked of analyses, in order."""
        self._deployed: list[tuple[Any, str]] = []
        self._calling = False
        self.reader: Callable[[str], StreamReader[Any]] | None = None
        """Opens a live subscription by stream; set by the runtime while a mission runs."""
        self.on_launch: list[Callable[[], None]] = []
        """Called once the streams are live."""
        self.flying = False
        """Whether a mission runs by this graph, which takes no additions then; set by the run."""

    def add(self, node: Node) -> Node:
        """Add a node, giving it a fresh id where its own is taken by another.

        Raises GraphError, with the application's line, while a mission flies.
        """
        self.require_idle(f"add {node.id}")
        base, count = node.id, 2
        while node.id in self.nodes or (node.kind != "sensor" and node.id in self._sensors):
            node.id = f"{base}_{count}"
            count += 1
        self.nodes[node.id] = node
        return node

    @contextlib.contextmanager
    def calling(self, work: Any, stream: str | None) -> Iterator[None]:  # noqa: ANN401 - an analysis
        """Record a call of the application; calls by an analysis within it are not its own.

        Args:
            work: The analysis that is called.
            stream: Name of the analysed stream; None for `instantiate`.
        """
        outer, self._calling = self._calling, True
        try:
            yield
        finally:
            self._calling = outer
        if not outer:
            self.calls.append(AnalysisCall(work, stream))

    def note_deployed(self, work: Any) -> None:  # noqa: ANN401 - an analysis
        """Record that an analysis is deployed, with the application's line."""
        self._deployed.append((work, application_line()))

    @property
    def unused(self) -> list[str]:
        """A text with the line for each analysis that is deployed and analyses nothing."""
        texts = [
            f"{type(work).__name__} is deployed and analyses nothing: call analyse() or "
            f"instantiate()\n  at {line}"
            for work, line in self._deployed
            if not work.analyses
        ]
        return list(dict.fromkeys(texts))

    def require_idle(self, what: str) -> None:
        """Raise GraphError, with the application's line, if it is too late to do `what`."""
        if self.flying:
            raise refusal(f"the mission flies, too late to {what}: do that before start_mission()")

    def connect(self, source: AeroStreamData[Any], target: Node, accepts: tuple[type, ...]) -> None:
        """Draw an edge.

        Args:
            source: Stream that is read.
            target: Node that reads it.
            accepts: Classes of items that the node takes.

        Raises:
            GraphError: For a wrong type, a foreign graph or a cycle.
        """
        if source.graph is not self:
            message = f"{source.name} belongs to another Environment than {target.id}"
            raise refusal(message)
        if not issubclass(source.item, accepts):
            wanted = " or ".join(kind.__name__ for kind in accepts)
            message = (
                f"{type(target.work).__name__} takes a stream of {wanted}, "
                f"but {source.name} carries {source.item.__name__}"
            )
            raise refusal(message)
        if target.id in self.upstream(source.name):
            message = f"{target.id} would analyse its own results by way of {source.name}"
            raise refusal(message)
        if source.name not in target.inputs:
            target.inputs.append(source.name)

    def upstream(self, name: str) -> set[str]:
        """Ids of `name` and of everything that it is made from."""
        found: set[str] = set()
        waiting = [name]
        while waiting:
            current = waiting.pop()
            if current not in found:
                found.add(current)
                waiting.extend(self.nodes[current].inputs)
        return found

    def downstream(self, name: str) -> list[Node]:
        """The nodes that read the stream `name`."""
        return [node for node in self.nodes.values() if name in node.inputs]


class AeroStreamData(PaperNames, IAeroData[E], Generic[E]):
    """The stream of one node: an edge while the graph is built, an iterator in flight."""

    def __init__(self, graph: Graph, name: str, item: type) -> None:
        """Name the stream of node `name`, which carries `item`."""
        self.graph = graph
        self.name = name
        self.item = item
        self._reader: StreamReader[E] | None = None
        self._opened_by: Callable[[str], StreamReader[Any]] | None = None

    @property
    def data(self) -> AeroStreamData[E]:
        """The stream itself: its data arrives in flight."""
        return self

    def get_data(self, timeout: float | None = None) -> E:
        """Return the next item in flight, waiting up to `timeout` seconds (None: for ever).

        Raises GraphError before the mission has started, TimeoutError when nothing came, and
        StopIteration once the mission has ended.
        """
        return self._live().next(timeout)

    def get_newest(self, timeout: float | None = None) -> E:
        """Return the newest item in flight, waiting up to `timeout` seconds for the first one.

        Raises what `get_data` raises.
        """
        return self._live().newest(timeout)

    def open_reader(self) -> StreamReader[E]:
        """Open a reader of its own in flight, which begins with what comes now.

        Raises GraphError before the mission has started.
        """
        return self._opener()(self.name)

    def _opener(self) -> Callable[[str], StreamReader[Any]]:
        opener = self.graph.reader
        if opener is None:
            message = (
                f"{self.name} has no data before the mission starts; "
                "call start_mission(wait=False) first"
            )
            raise refusal(message)
        return opener

    def _live(self) -> StreamReader[E]:
        opener = self._opener()
        if self._reader is None or self._opened_by is not opener:
            self._reader, self._opened_by = opener(self.name), opener
        return self._reader

    def set_data(self, data: E) -> None:
        """Refuse: a stream's data comes from its node."""
        message = f"{self.name} is a stream: its data comes from its node, not from {data!r}"
        raise refusal(message)

    def __iter__(self) -> Iterator[E]:
        """Iterate over items as they arrive."""
        return self

    def __next__(self) -> E:
        """Return the next item; ends with the mission."""
        return self.get_data()
