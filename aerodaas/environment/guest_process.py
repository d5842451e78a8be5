"""The inside of a guest's process: builds the guest's dataflow, or runs its analyses.

Its owner asks over a channel. What the owner sends may be pickled, for this process is the one
that is not trusted; what it answers is JSON, with the program as a blob that only another process
of the same guest decodes.
"""

from __future__ import annotations

import pickle
import sys
import traceback
import types
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aerodaas.analytics.commanding import CommandingAnalytics
from aerodaas.analytics.guests.channel import LARGEST_TEXT, Channel
from aerodaas.analytics.guests.document import (
    GuestDocument,
    GuestNavigation,
    GuestNode,
    GuestTrigger,
)
from aerodaas.analytics.guests.works import Works
from aerodaas.analytics.item_json import encoded
from aerodaas.config.options import RunOptions
from aerodaas.dataflow.graph import NavigationEdge, Node, application_line
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.environment.application_file import run_file
from aerodaas.environment.offering import offered, require_no_more, the_only
from aerodaas.errors import AeroDaaSError, GraphError, failure_line
from aerodaas.messages.guest_item import GuestItem
from aerodaas.messages.waypoints import SchedulingType
from aerodaas.recording.encoding import plain

if TYPE_CHECKING:
    from aerodaas.config.grants import Catalogue
    from aerodaas.environment.environment import Environment

__all__ = ["serve"]


def serve(channel: Channel) -> None:
    """Answer the owner's requests until it closes the channel."""
    server = _Server()
    while True:
        request, blob = channel.receive()
        answer, result = server.answer(request, blob)
        channel.send(answer, result)


class _Server:
    """The guest's program, once it is built or decoded."""

    def __init__(self) -> None:
        self._works = Works({}, {}, _opaque, _revealed)

    def answer(self, request: dict[str, Any], blob: bytes) -> tuple[dict[str, Any], bytes]:
        if request["do"] == "build":
            return _built(pickle.loads(blob), Path(request["application"]))  # noqa: S301 - the owner's
        if request["do"] == "open":
            self._open(blob)
            return {}, b""
        return self._process(request, blob), b""

    def _open(self, program: bytes) -> None:
        application, content = pickle.loads(program)  # noqa: S301 - the guest's own
        pickle.loads(application)  # noqa: S301 - makes its modules available
        works, conditions = pickle.loads(content)  # noqa: S301
        self._works = Works(works, conditions, _opaque, _revealed)
        self._works.open()

    def _process(self, request: dict[str, Any], blob: bytes) -> dict[str, Any]:
        item, vehicle = pickle.loads(blob)  # noqa: S301 - the owner's
        return self._works.process(request["key"], item, request["now"], vehicle, request["on"])


def _opaque(item: object) -> GuestItem:
    from aerodaas.actors.streams.definitions import pickled_class  # noqa: PLC0415 - loads Ray's

    return GuestItem(type(item).__name__, plain(item), pickled_class(item))


def _revealed(item: GuestItem) -> object:
    return pickle.loads(item.data)  # noqa: S301 - the guest's own


def _built(catalogue: Catalogue, application: Path) -> tuple[dict[str, Any], bytes]:
    """Run the guest's file; returns its document and program, or what is wrong with it."""
    options = RunOptions(application=application, catalogue=catalogue, view=False)
    try:
        with offered() as found:
            namespace = run_file(application, [], options)
        environment = the_only(found)
        document = _document(environment)
        program = _program(environment, namespace)
    except SystemExit as error:
        return {"refused": f"it called sys.exit({error.code!r}) before start_mission()"}, b""
    except AeroDaaSError as error:
        line = _line(error, application)
        place = f"\n  at {line}" if line and "\n  at " not in str(error) else ""
        return {"refused": f"{error}{place}"}, b""
    except BaseException as error:  # noqa: BLE001 - a guest's file may raise anything
        return {"refused": failure_line(error)}, b""
    text = document.model_dump(mode="json")
    if len(str(text)) > LARGEST_TEXT:
        return {"refused": "its dataflow is too large"}, b""
    return {"document": text}, program


def _line(error: BaseException, application: Path) -> str:
    for frame in reversed(traceback.extract_tb(error.__traceback__)):
        if Path(frame.filename) == application:
            return f"{application.name}:{frame.lineno}: {frame.line}"
    return application_line()


def _document(environment: Environment) -> GuestDocument:
    require_no_more(environment)
    graph = environment.graph
    if graph.on_launch:
        raise GraphError(
            "a guest's file ends before the flight, so subscribe() would never be called back: "
            "make an analysis of it"
        )
    if environment.has_hooks:
        raise GraphError(
            "a guest's file ends before the flight, so hooks of on_start, on_end or start_mission "
            "would never run: leave them out"
        )
    environment.place_entries()
    nodes = [_node(one) for one in graph.nodes.values() if one.kind != "sensor"]
    return GuestDocument(
        version=1, nodes=nodes, navigation=[_navigation(one) for one in graph.navigation]
    )


def _node(node: Node) -> GuestNode:
    if isinstance(node.work, CommandingAnalytics):
        raise GraphError(f"a guest may not command the drone by {node.id}; leave it out")
    if node.runtime_env is not None:
        raise GraphError(f"{node.id}: a guest's analyses have no runtime_env of their own")
    return GuestNode(
        id=node.id,
        robot=node.robot,
        inputs=node.inputs,
        external=node.kind == "external",
        rate=float(node.work.rate),
        compute=node.compute,
        navigation=issubclass(node.item, AeroNavigation),
        scheduled=bool(node.work.scheduled) and not node.triggers,
        dormant=node.dormant,
        triggers=[
            GuestTrigger.model_validate({"target": one.target, "method": one.method})
            for one in node.triggers
        ],
    )


def _navigation(edge: NavigationEdge) -> GuestNavigation:
    navigation = edge.navigation
    return GuestNavigation(
        robot=edge.robot,
        stream=navigation.stream.name if navigation.stream is not None else None,
        waypoints=[encoded(one, _opaque) for one in navigation],
        ordered=navigation.scheduling_type is SchedulingType.ORDERED,
        priority=navigation.priority,
        index=edge.index,
        deadline=edge.deadline,
        clear_on=edge.clear_on,
    )


def _program(environment: Environment, namespace: dict[str, Any]) -> bytes:
    """The guest's analyses and conditions, with the modules that they come from."""
    from aerodaas.actors.run.application import capture  # noqa: PLC0415
    from aerodaas.actors.streams.definitions import pickled_class  # noqa: PLC0415
    from aerodaas.runtime.sending import require_sendable  # noqa: PLC0415

    graph = environment.graph
    require_sendable(graph)
    # The file has run as `__main__`: what it imports later is found by its namespace.
    main = types.ModuleType("__main__")
    vars(main).update(namespace)
    sys.modules["__main__"] = main
    application = pickle.dumps(capture(graph, environment.config, by_value=True))
    nodes = [one for one in graph.nodes.values() if one.kind != "sensor"]
    works = {one.id: one.work for one in nodes}
    conditions = {one.id: [trigger.when for trigger in one.triggers] for one in nodes}
    return pickle.dumps((application, pickled_class((works, conditions))))
