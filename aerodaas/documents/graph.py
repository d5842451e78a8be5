"""Check of a document's graph: names, settings and streams, without making an analysis."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from pydantic import ValidationError

from aerodaas.analytics.follow.analytics import FollowAnalytics
from aerodaas.analytics.follow.followers import PersonFollowAnalytics, VipFollowAnalytics
from aerodaas.analytics.inspection.tower_inspection import TowerInspectionAnalytics
from aerodaas.config.checked import checked, near
from aerodaas.config.model import EnvironmentConfig, TaskConfig
from aerodaas.config.plugins import PluginKind, load_plugin, require_plugin
from aerodaas.dataflow.handles import SENSOR_ITEMS
from aerodaas.dataflow.mission_document import AnalysisEntry, MissionDocument
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.documents.arguments import argument_model, check_arguments, condition_adapter
from aerodaas.errors import AeroDaaSError, UnknownIdError
from aerodaas.protocol.proposals import Finding

__all__ = ["GraphCheck"]

_NEAREST, _NEAREST_TO_CARS = 1.5, 3.0
"""Metres that a drone which follows people, or cars, keeps from them at least. A follower comes
up to half a metre nearer than it is set to, and a car brakes harder than a drone."""
_HEIGHTS: Sequence[tuple[type, str]] = (
    (FollowAnalytics, "height"),
    (TowerInspectionAnalytics, "top"),
)
"""Arguments of navigating analyses that are heights above home, metres."""
_KNOWN = "take one of the known names"


class GraphCheck:
    """Check of everything in a document but its waypoints."""

    def __init__(self, document: MissionDocument, config: EnvironmentConfig) -> None:
        """Check `document` against what `config` and this installation have."""
        self._document = document
        self._config = config
        self._robots = [robot.id for robot in config.robots]
        self._sensors = {one.full_id: one for one in config.all_sensors()}
        self._analyses = {entry.id: entry for entry in document.analyses}
        self._kinds: dict[str, Any] = {}
        """Classes of the analyses that are registered here, by id."""

    def run(self) -> Iterator[Finding]:
        """All findings about names, settings and streams."""
        document = self._document
        if not document.navigation:
            text = "the navigation is empty: no drone flies"
            yield _finding(text, "give a robot waypoints, or the stream of an analysis")
        yield from self._unknown("sensor", document.sensors, self._sensors)
        if self._config.compute != "auto":
            wanted = [entry.compute for entry in document.analyses if entry.compute is not None]
            known = [node.id for node in self._config.compute]
            yield from self._unknown("compute resource", wanted, known)
        yield from self._schedulers()
        for entry in document.analyses:
            yield from self._analysis(entry)
        for entry in document.analyses:
            yield from self._streams(entry)
            yield from self._triggers(entry)
        yield from self._navigation()

    def _unknown(self, what: str, wanted: Iterable[str], known: Iterable[str]) -> Iterator[Finding]:
        choices = sorted(known)
        for name in sorted(set(wanted) - set(choices)):
            yield _unknown(what, name, choices)

    def _schedulers(self) -> Iterator[Finding]:
        wanted = self._document.trajectory_scheduler
        if wanted is not None:
            yield from _plugin("trajectory_schedulers", wanted.name, wanted.settings)
        if self._document.analytics_scheduler is not None:
            yield from _plugin("analytics_schedulers", self._document.analytics_scheduler, {})

    def _analysis(self, entry: AnalysisEntry) -> Iterator[Finding]:
        if entry.analysis is None:
            text = f"{entry.id} is code at the user's side, and nobody is there"
            yield _finding(text, "take a registered analysis in its place")
            return
        findings = list(_plugin("analytics", entry.analysis, entry.settings))
        yield from findings
        if entry.task is not None:
            try:
                checked(TaskConfig, entry.task, f"{entry.id}: task")
            except AeroDaaSError as error:
                yield _finding(str(error), "mend this setting, or leave it out")
        yield from self._properties(entry.id, entry.settings)
        if not findings:
            self._kinds[entry.id] = load_plugin("analytics", entry.analysis)
            yield from self._followed(entry)

    def _properties(self, analysis: str, value: object) -> Iterator[Finding]:
        """References to sensors' properties that this environment does not have."""
        if isinstance(value, list):
            for one in value:
                yield from self._properties(analysis, one)
        if not isinstance(value, Mapping):
            return
        match value.get("$property"):
            case [str(name), str()] if name not in self._sensors:
                yield _unknown(f"sensor (of {analysis})", name, self._sensors)
            case [str(name), str(key)] if key not in self._sensors[name].settings:
                yield _unknown(f"setting of {name}", key, self._sensors[name].settings)
        for one in value.values():
            yield from self._properties(analysis, one)

    def _followed(self, entry: AnalysisEntry) -> Iterator[Finding]:
        kind = self._kinds[entry.id]
        if not issubclass(kind, FollowAnalytics):
            return
        cars = not issubclass(kind, PersonFollowAnalytics | VipFollowAnalytics)
        nearest = _NEAREST_TO_CARS if cars else _NEAREST
        distance = _argument(entry, "distance")
        if distance < nearest:
            yield Finding(
                check="follow_distance",
                text=f"{entry.id} follows at {distance:g} m, and {nearest:g} m are the least from "
                f"{'cars' if cars else 'people'}",
                remedy=f"set its distance to {nearest:g} or more",
                measured=distance,
                limit=nearest,
                unit="m",
            )

    def _streams(self, entry: AnalysisEntry) -> Iterator[Finding]:
        known = [*self._document.sensors, *self._analyses]
        earlier = list(self._analyses)[: list(self._analyses).index(entry.id)]
        for name in entry.reads:
            # Sensors that the environment lacks have their finding.
            if name not in known:
                yield _unknown(f"stream (that {entry.id} reads)", name, known)
            elif name in self._analyses and name not in earlier:
                text = f"{entry.id} reads {name}, which stands after it"
                yield _finding(text, f"have {name} before {entry.id}")
            elif entry.id in self._kinds:
                yield from self._carried(entry, name)
        if not entry.reads and entry.compute is None and entry.here is None:
            text = f"{entry.id} reads no stream, and is deployed nowhere"
            yield _finding(text, "have it read a sensor, or give it a `compute` as a source")
        prefix = self._robot_of(entry.reads[0]) if entry.reads else None
        name = entry.id.rpartition("/")[2]
        expected = f"{prefix}/{name}" if prefix else name
        if entry.id != expected and all(one in known for one in entry.reads):
            text = f"the analysis {entry.id} has to be called {expected}, after what it reads first"
            yield _finding(text, f"call it {expected}, here and where others read it")

    def _carried(self, entry: AnalysisEntry, source: str) -> Iterator[Finding]:
        accepts, item = self._kinds[entry.id].accepts, self._item(source)
        if item is not None and not issubclass(item, accepts):
            wanted = " or ".join(kind.__name__ for kind in accepts)
            text = f"{entry.id} takes a stream of {wanted}, and {source} carries {item.__name__}"
            yield _finding(text, "have it read another stream")

    def _item(self, stream: str) -> type | None:
        """Class of the items of a stream; None where it is not known."""
        if stream in self._sensors:
            return SENSOR_ITEMS[self._sensors[stream].type]
        kind = self._kinds.get(stream)
        return None if kind is None else kind.produces

    def _robot_of(self, stream: str) -> str | None:
        sensor = self._sensors.get(stream)
        return sensor.robot if sensor is not None else stream.rpartition("/")[0] or None

    def _triggers(self, entry: AnalysisEntry) -> Iterator[Finding]:
        flying = [one.robot for one in self._document.navigation]
        for number, trigger in enumerate(entry.triggers):
            known = flying if trigger.command else self._analyses
            what = "flying robot" if trigger.command else "analysis"
            if trigger.target not in known:
                yield _unknown(f"{what} (that {entry.id} triggers)", trigger.target, known)
            try:
                condition_adapter().validate_json(json.dumps(trigger.when))
            except ValidationError:
                text = f"{entry.id}: trigger {number} has a condition that is code, or not known"
                yield _finding(text, "take a condition that is data: Near, Above or Below")

    def _navigation(self) -> Iterator[Finding]:
        known = [*self._document.sensors, *self._analyses]
        for entry in self._document.navigation:
            if entry.robot not in self._robots:
                yield _unknown("robot", entry.robot, self._robots)
            for name in (entry.stream, entry.clear_on):
                if name is not None and name not in known:
                    yield _unknown(f"stream (for {entry.robot})", name, known)
            if entry.stream is not None:
                yield from self._steering(entry.robot, entry.stream)
            elif not entry.waypoints:
                text = f"{entry.robot} has neither waypoints nor a stream to fly by"
                yield _finding(text, "give it one of both")

    def _steering(self, robot: str, stream: str) -> Iterator[Finding]:
        """Findings about an analysis that commands a robot."""
        kind, entry = self._kinds.get(stream), self._analyses.get(stream)
        limits = next((one.limits for one in self._config.robots if one.id == robot), None)
        item = self._item(stream)
        if item is not None and not issubclass(item, AeroNavigation):
            text = f"{robot} cannot navigate by {stream}, which carries no navigation"
            yield _finding(text, "take the stream of an analysis that navigates")
        if kind is None or entry is None or limits is None:
            return
        for navigating, argument in _HEIGHTS:
            if not issubclass(kind, navigating):
                continue
            height, fence = _argument(entry, argument), limits.geofence
            if not fence.floor <= height <= fence.ceiling:
                above = height > fence.ceiling
                limit = fence.ceiling if above else fence.floor
                yield Finding(
                    check="ceiling" if above else "floor",
                    text=f"{stream} flies {robot} at {height:g} m ({argument}), "
                    f"{'above the ceiling' if above else 'below the floor'} of {limit:g} m",
                    remedy=f"set its {argument} to {limit:g} or {'less' if above else 'more'}",
                    robot=robot,
                    measured=height,
                    limit=limit,
                    unit="m",
                )


def _plugin(kind: PluginKind, name: str, settings: Mapping[str, Any]) -> Iterator[Finding]:
    """Findings about a plug-in's name and its arguments."""
    try:
        require_plugin(kind, name)
    except UnknownIdError as error:
        yield Finding(check="unknown_name", text=str(error), remedy=_KNOWN)
        return
    if kind == "analytics_schedulers":
        return  # A document names one without settings.
    try:
        check_arguments(kind, name, settings)
    except AeroDaaSError as error:
        known = argument_model(kind, name).model_fields
        check = "document" if set(settings) <= set(known) else "unknown_name"
        yield Finding(check=check, text=str(error), remedy="mend this setting, or leave it out")


def _argument(entry: AnalysisEntry, name: str) -> float:
    """An argument of a registered analysis: as given, or its default."""
    assert entry.analysis is not None  # noqa: S101 - of a registered one
    default = argument_model("analytics", entry.analysis).model_fields[name].default
    return float(entry.settings.get(name, default))


def _finding(text: str, remedy: str) -> Finding:
    return Finding(check="document", text=text, remedy=remedy)


def _unknown(what: str, name: str, known: Iterable[str]) -> Finding:
    return Finding(
        check="unknown_name",
        text=f"there is no {what} called {name!r}{near(name, known)}",
        remedy=_KNOWN,
    )
