"""Building the graph of a mission document, as its application would have."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

from aerodaas.analytics.base import Analytics
from aerodaas.analytics.here.analysis import (
    AnsweredCondition,
    HereAnalysis,
    HereConditions,
    HereSite,
)
from aerodaas.config.checked import checked
from aerodaas.config.model import TaskConfig
from aerodaas.config.options import current_options
from aerodaas.config.plugins import load_plugin, require_plugin
from aerodaas.dataflow.graph import AeroStreamData, NavigationEdge
from aerodaas.dataflow.mission_document import (
    HERE_ITEMS,
    AnalysisEntry,
    MissionDocument,
    NavigationDocument,
    TriggerEntry,
)
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.environment.document.values import ValueReader
from aerodaas.environment.environment import Environment
from aerodaas.errors import AeroDaaSError, GraphError

__all__ = ["build_mission"]

_LONGEST = 64
"""Characters of a name."""


def build_mission(
    document: MissionDocument,
    environment: Environment,
    models: Path,
    here: HereSite | None = None,
) -> None:
    """Build the graph of `document` in an `environment` that has none yet.

    Args:
        document: What is to be flown.
        environment: Where; its file alone says which drivers, addresses and paths there are.
        models: Folder of models beside those that are shipped.
        here: Relay to the user's side; None where there is none.

    Raises:
        AeroDaaSError: For what is not to be had here, by the document's own names.
    """
    if document.here and here is None:
        raise GraphError(
            f"{', '.join(document.here)}: code of the application, which stays at its user's side, "
            "and there is none here: fly the application itself, or submit it from there"
        )
    options = current_options.get()
    if not (document.navigation or options.senses_only or options.provider.attach is not None):
        raise GraphError(
            "its navigation is empty: it senses only, by the cameras of another mission in flight "
            "at a provider (`aerodaas submit … --attach MISSION`)"
        )
    _Builder(environment, models, here).build(document)


class _Builder:
    """Builder of one graph."""

    def __init__(self, environment: Environment, models: Path, here: HereSite | None) -> None:
        self._environment = environment
        self._here = here
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
            self._triggers(entry)
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
        work = self._work(entry)
        work.name = entry.id.rpartition("/")[2]
        if entry.rate is not None:
            work.rate = entry.rate
        if entry.task is not None:
            work.task = checked(TaskConfig, entry.task, f"{entry.id}: task")
        if entry.compute is not None:
            work.deploy(self._environment.get_compute_resource_by_id(entry.compute))
        inputs = [self._stream(name, entry.id) for name in entry.reads]
        try:
            stream = work.analyse(inputs[0]) if inputs else work.instantiate()
            for further in inputs[1:]:
                work.analyse(further)
        except AeroDaaSError:
            raise
        except Exception as error:  # noqa: BLE001 - a stranger's values in any analysis
            raise GraphError(f"{entry.id} does not take these settings: {error}"[:300]) from None
        if stream.name != entry.id:
            raise GraphError(f"{entry.id} would be called {stream.name} here: the name is taken")
        if isinstance(work, HereAnalysis) and (node := work.node) is not None:
            node.item = work.item
            work.sees_vehicle = node.robot is not None
            stream = AeroStreamData(stream.graph, stream.name, node.item)
        self._streams[entry.id], self._works[entry.id] = stream, work

    def _work(self, entry: AnalysisEntry) -> Analytics[Any]:
        if entry.analysis is not None:
            return self._values.analysis(entry.analysis, entry.settings)
        assert entry.here is not None and self._here is not None  # noqa: S101, PT018 - checked
        work = HereAnalysis(entry.id, self._here, HERE_ITEMS[entry.here.produces])
        return work.deploy(self._environment.here)

    def _stream(self, name: str, reader: str) -> AeroStreamData[Any]:
        if name not in self._streams:
            graph = self._environment.graph
            if name not in graph.nodes:
                raise GraphError(f"{reader} reads {name}, which the document does not have")
            # Of an analysis that another one has started for itself.
            self._streams[name] = AeroStreamData(graph, name, graph.nodes[name].item)
        return self._streams[name]

    def _triggers(self, entry: AnalysisEntry) -> None:
        """Give an analysis its triggers; those by conditions elsewhere go by way of a stand-in."""
        source = self._works[entry.id]
        watch: HereAnalysis | None = source if isinstance(source, HereAnalysis) else None
        for number, one in enumerate(entry.triggers):
            if one.at_users_side:
                watch = watch or self._conditions(entry.id)
                watch.trigger(self._target(entry.id, one), AnsweredCondition(entry.id, number))
            else:
                when = None if one.when is None else self._values.value(one.when, entry.id)
                source.trigger(self._target(entry.id, one), when)

    def _conditions(self, source: str) -> HereConditions:
        assert self._here is not None  # noqa: S101 - checked
        work = HereConditions(source, self._here)
        work.name = f"{source.rpartition('/')[2]}_conditions"[:_LONGEST]
        work.deploy(self._environment.here).analyse(self._streams[source])
        return work

    def _target(self, source: str, trigger: TriggerEntry) -> Any:  # noqa: ANN401 - as `trigger` takes
        if trigger.command is not None:
            robot = self._environment.get_robot_by_id(trigger.target)
            return getattr(robot, trigger.command)
        if trigger.target not in self._works:
            raise GraphError(f"{source} wakes {trigger.target}, which the document does not have")
        return self._works[trigger.target]

    def _navigate(self, entry: NavigationDocument) -> None:
        self._environment.get_robot_by_id(entry.robot)
        source = None if entry.stream is None else self._stream(entry.stream, entry.robot)
        if source is not None and not issubclass(source.item, AeroNavigation):
            raise GraphError(f"{entry.robot} cannot navigate by {entry.stream}")
        navigation = entry.navigation(source)
        if entry.clear_on is not None:
            self._stream(entry.clear_on, entry.robot)
        self._environment.fly_by(
            NavigationEdge(entry.robot, navigation, entry.index, entry.deadline, entry.clear_on)
        )
