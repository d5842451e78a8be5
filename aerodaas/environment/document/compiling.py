"""Writing an application as a mission document: its file runs up to `start_mission()`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from aerodaas.analytics.base import Analytics
from aerodaas.analytics.remote import RemoteAnalytics
from aerodaas.config.checked import explained
from aerodaas.config.model import TaskConfig
from aerodaas.config.options import current_options
from aerodaas.config.plugins import PluginKind
from aerodaas.dataflow.graph import NavigationEdge, Node, Trigger
from aerodaas.dataflow.mission_document import (
    HERE_CONDITION,
    HERE_ITEMS,
    MissionDocument,
)
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.environment.document.values import ValueWriter, registered_name
from aerodaas.environment.environment import Environment
from aerodaas.environment.offering import require_no_more
from aerodaas.errors import GraphError
from aerodaas.messages.frames import Frame
from aerodaas.messages.waypoints import SchedulingType

__all__ = ["WrittenMission", "compile_mission", "write_mission"]


@dataclass(frozen=True)
class WrittenMission:
    """A document and the files that it names."""

    document: MissionDocument
    models: Mapping[str, Path]
    """Files of models by SHA-256."""


def write_mission(environment: Environment, name: str, *, here: bool = False) -> MissionDocument:
    """The graph of an application as a document.

    Args:
        environment: The application's, ready to start.
        name: Name of the application.
        here: Whether the user's side is there in flight: then analyses that are not registered
            and not deployed elsewhere, and conditions that are code, stay there, as do hooks and
            callbacks. Without it, analyses that are deployed on `env.here` do.

    Raises:
        GraphError: For what no document can hold, by name and with the remedy.
    """
    return compile_mission(environment, name, here=here).document


def compile_mission(environment: Environment, name: str, *, here: bool = False) -> WrittenMission:
    """The graph of an application as a document, with the models that it names.

    Args:
        environment: The application's, ready to start.
        name: Name of the application.
        here: Whether the user's side is there in flight, as for `write_mission`.

    Raises:
        GraphError: For what no document can hold, by name and with the remedy.
    """
    compiler = _Compiler(environment, here=here)
    return WrittenMission(compiler.document(name), compiler.models)


class _Compiler:
    """Writer of one application."""

    def __init__(self, environment: Environment, *, here: bool) -> None:
        self._environment = environment
        self._here = here
        self._graph = environment.graph
        self._values = ValueWriter(environment)
        self._works = list(dict.fromkeys(call.work for call in self._graph.calls))

    @property
    def models(self) -> Mapping[str, Path]:
        return self._values.models

    def document(self, name: str) -> MissionDocument:
        self._require_data()
        self._environment.place_entries()
        content = {
            "format": "aerodaas-mission",
            "version": 1,
            "name": name,
            "environment": self._environment.path.name,
            "sensors": [one.id for one in self._graph.nodes.values() if one.kind == "sensor"],
            "analyses": [entry for work in self._works for entry in self._entries(work)],
            "navigation": [self._navigation(edge) for edge in self._graph.navigation],
            "trajectory_scheduler": self._trajectory(),
            "analytics_scheduler": self._analytics(),
        }
        try:
            return MissionDocument.model_validate(content)
        except ValidationError as error:
            raise GraphError(explained(error, MissionDocument, content)) from None

    def _require_data(self) -> None:
        """Raise GraphError for functions of the application that would run in its process."""
        require_no_more(self._environment)
        hooks = self._environment.has_hooks
        # Where the user's side is there, the application runs its own functions.
        if not self._here and (hooks or self._graph.on_launch):
            kinds = "hooks of on_start, on_end or start_mission"
            what = kinds if hooks else "callbacks of subscribe()"
            raise GraphError(f"a document has no {what}, which are the application's own code")
        edges = self._graph.navigation
        attached = current_options.get().provider.attach is not None
        if not (edges or attached or self._environment.navigation_waiting()):
            raise GraphError("nothing flies: call navigate() before start_mission()")

    def _entries(self, work: Analytics[Any]) -> Iterator[dict[str, Any]]:
        """The entry of an analysis, after those of analyses that it has started for itself."""
        node = work.node
        if node is None:
            raise GraphError(f"{type(work).__name__} was taken out of the graph again")
        if node.runtime_env is not None:
            raise GraphError(
                f"{node.id}: a document has no runtime_env; the environment file of whoever flies "
                "it may give one"
            )
        if self._stays_here(work):
            yield from self._at_users_side(node)
        else:
            yield self._analysis(work, node)

    def _stays_here(self, work: Analytics[Any]) -> bool:
        if work.deployed_here:
            return True
        by_default = self._here and work.node is not None and work.node.compute is None
        return by_default and registered_name("analytics", type(work)) is None

    def _at_users_side(self, node: Node) -> Iterator[dict[str, Any]]:
        if isinstance(node.work, RemoteAnalytics):
            raise GraphError(
                f"{node.id} commands the drone, and cannot stay at the user's side: deploy it on "
                "a compute resource of the environment"
            )
        given = {work.node.id for work in self._works if work.node is not None}
        for name in node.inputs:
            inner = self._graph.nodes[name]
            if inner.kind != "sensor" and name not in given:
                yield from self._at_users_side(inner)
        yield {
            "id": node.id,
            "here": {"produces": _produced(node)},
            "reads": list(node.inputs),
            "rate": float(node.work.rate) if node.kind == "external" else None,
            "triggers": [
                _at_users_side(one, number) for number, one in enumerate(node.work.given_triggers)
            ],
        }

    def _analysis(self, work: Analytics[Any], node: Node) -> dict[str, Any]:
        name, settings = self._values.analysis(work)
        calls = [call.stream for call in self._graph.calls if call.work is work]
        task = vars(work).get("task")
        return {
            "id": node.id,
            "analysis": name,
            "settings": settings,
            "reads": [stream for stream in calls if stream is not None],
            "compute": node.compute,
            "rate": float(work.rate) if node.kind == "external" else None,
            "task": task.model_dump(exclude_defaults=True)
            if isinstance(task, TaskConfig)
            else None,
            "triggers": [
                self._trigger(work, one, number) for number, one in enumerate(work.given_triggers)
            ],
        }

    def _trigger(self, work: Analytics[Any], trigger: Trigger, number: int) -> dict[str, Any]:
        place = f"{type(work).__name__}.trigger(when=…)"
        try:
            when = None if trigger.when is None else self._values.value(trigger.when, place)
        except GraphError as error:
            if self._here:
                return _at_users_side(trigger, number)
            remedy = "aerodaas.analytics has conditions that are data: Near, Above, Below"
            raise GraphError(f"{error}; {remedy}") from None
        return {"target": trigger.target, "command": trigger.method, "when": when}

    def _navigation(self, edge: NavigationEdge) -> dict[str, Any]:
        navigation = edge.navigation
        if navigation.commands:
            raise GraphError(f"{edge.robot}: velocity commands in a document come from analyses")
        return {
            "robot": edge.robot,
            "stream": navigation.stream.name if navigation.stream is not None else None,
            "waypoints": list(navigation.waypoints),
            "ordered": navigation.scheduling_type is SchedulingType.ORDERED,
            "priority": navigation.priority,
            "index": edge.index,
            "deadline": edge.deadline,
            "clear_on": edge.clear_on,
        }

    def _trajectory(self) -> dict[str, Any] | None:
        scheduler = self._environment.chosen_trajectory
        if scheduler is None:
            return None
        name = registered_name("trajectory_schedulers", type(scheduler))
        if name is None:
            raise _own_code(type(scheduler).__name__, "trajectory_schedulers")
        given = scheduler.given_settings()
        settings = {key: one for key, one in given.items() if one is not self._environment}
        return {"name": name, "settings": self._values.settings(settings, {}, name)}

    def _analytics(self) -> str | None:
        chosen = self._environment.chosen_dispatch
        if chosen is None or (isinstance(chosen, str) and ":" not in chosen):
            return chosen
        raise _own_code(str(chosen), "analytics_schedulers")


def _produced(node: Node) -> str:
    """Name of what an analysis at the user's side produces; raises GraphError for pictures."""
    if issubclass(node.item, Frame):
        raise GraphError(
            f"{node.id} produces pictures, which do not go back from the user's side: let it "
            "produce what it finds in them"
        )
    known = {kind: name for name, kind in HERE_ITEMS.items()}
    # A subclass of navigation goes over the wire as navigation; any other class is its own.
    if issubclass(node.item, AeroNavigation):
        return known[AeroNavigation]
    return known.get(node.item, known[object])


def _at_users_side(trigger: Trigger, number: int) -> dict[str, Any]:
    when = None if trigger.when is None else {HERE_CONDITION: number}
    return {"target": trigger.target, "command": trigger.method, "when": when}


def _own_code(what: str, kind: PluginKind) -> GraphError:
    return GraphError(
        f"{what} is the application's own code, and a document holds registered schedulers by "
        f"name only: register it as an entry point of `aerodaas.{kind}`, or fly the application"
    )
