"""Building the graph of a mission document, as its application would have."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

from aerodaas.analytics.base import Analytics
from aerodaas.config.model import TaskConfig
from aerodaas.config.plugins import load_plugin, require_plugin
from aerodaas.dataflow.graph import AeroStreamData, NavigationEdge
from aerodaas.dataflow.mission_document import (
    AnalysisEntry,
    MissionDocument,
    NavigationDocument,
    TriggerEntry,
)
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.environment.document.values import ValueReader
from aerodaas.environment.environment import Environment
from aerodaas.types.errors import GraphError
from aerodaas.types.waypoints import NavigationType, SchedulingType

__all__ = ["build_mission"]


def build_mission(document: MissionDocument, environment: Environment, models: Path) -> None:
    """Build the graph of `document` in an `environment` that has none yet.

    Args:
        document: What is to be flown.
        environment: Where; its file alone says which drivers, addresses and paths there are.
        models: Folder of models beside those that are shipped.

    Raises:
        AeroDaaSError: For what is not to be had here, by the document's own names.
    """
    _Builder(environment, models).build(document)


class _Builder:
    """Builder of one graph."""

    def __init__(self, environment: Environment, models: Path) -> None:
        self._environment = environment
        self._values = ValueReader(environment, models)
        self._streams: dict[str, AeroStreamData[Any]] = {}
        self._works: dict[str, Analytics[Any]] = {}

    def build(self, document: MissionDocument) -> None:
        for sensor in document.sensors:
            handle = self._environment.get_env_sensor_by_id(sensor)
            self._streams[sensor] = handle.get_data_stream()
        for entry in document.analyses:
            self._analyse(entry)
        for entry in document.analyses:
            for trigger in entry.triggers:
                self._trigger(entry.id, trigger)
        if document.trajectory_scheduler is not None:
            wanted = document.trajectory_scheduler
            kind = partial(load_plugin("trajectory_schedulers", wanted.name), self._environment)
            scheduler = self._values.made(kind, wanted.settings, wanted.name)
            self._environment.set_trajectory_scheduler(scheduler)
        if document.analytics_scheduler is not None:
            require_plugin("analytics_schedulers", document.analytics_scheduler)
            self._environment.set_analytics_scheduler(document.analytics_scheduler)
        for one in document.navigation:
            self._navigate(one)

    def _analyse(self, entry: AnalysisEntry) -> None:
        work = self._values.analysis(entry.analysis, entry.settings)
        work.name = entry.id.rpartition("/")[2]
        if entry.rate is not None:
            work.rate = entry.rate
        if entry.task is not None:
            work.task = TaskConfig.model_validate(entry.task)
        if entry.compute is not None:
            work.deploy(self._environment.get_compute_resource_by_id(entry.compute))
        inputs = [self._stream(name, entry.id) for name in entry.reads]
        stream = work.analyse(inputs[0]) if inputs else work.instantiate()
        for further in inputs[1:]:
            work.analyse(further)
        if stream.name != entry.id:
            raise GraphError(f"{entry.id} would be called {stream.name} here: the name is taken")
        self._streams[entry.id], self._works[entry.id] = stream, work

    def _stream(self, name: str, reader: str) -> AeroStreamData[Any]:
        if name not in self._streams:
            graph = self._environment.graph
            if name not in graph.nodes:
                raise GraphError(f"{reader} reads {name}, which the document does not have")
            # Of an analysis that another one has started for itself.
            self._streams[name] = AeroStreamData(graph, name, graph.nodes[name].item)
        return self._streams[name]

    def _trigger(self, source: str, trigger: TriggerEntry) -> None:
        when = None if trigger.when is None else self._values.value(trigger.when, source)
        if trigger.command is not None:
            robot = self._environment.get_robot_by_id(trigger.target)
            self._works[source].trigger(getattr(robot, trigger.command), when)
        elif trigger.target in self._works:
            self._works[source].trigger(self._works[trigger.target], when)
        else:
            raise GraphError(f"{source} wakes {trigger.target}, which the document does not have")

    def _navigate(self, entry: NavigationDocument) -> None:
        ordering = SchedulingType.ORDERED if entry.ordered else SchedulingType.UNORDERED
        self._environment.get_robot_by_id(entry.robot)
        if entry.stream is not None:
            stream = self._stream(entry.stream, entry.robot)
            if not issubclass(stream.item, AeroNavigation):
                raise GraphError(f"{entry.robot} cannot navigate by {entry.stream}")
            source: Any = stream
        else:
            source = [one.waypoint() for one in entry.waypoints]
        driven = NavigationType.ANALYTICS_DRIVEN if entry.stream else NavigationType.DISTANCE_DRIVEN
        navigation = AeroNavigation(driven, source, ordering, priority=entry.priority)
        if entry.clear_on is not None:
            self._stream(entry.clear_on, entry.robot)
        self._environment.fly_by(
            NavigationEdge(entry.robot, navigation, entry.index, entry.deadline, entry.clear_on)
        )
