"""A mission document as the Python application that a person would write for it."""

from __future__ import annotations

import json
import keyword
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields, replace
from typing import Any

from aerodaas.analytics.models.registry import REGISTRY
from aerodaas.config.plugins import load_plugin
from aerodaas.dataflow.mission_document import (
    AnalysisEntry,
    MissionDocument,
    NavigationDocument,
    TriggerEntry,
)
from aerodaas.dataflow.names import snake_case
from aerodaas.documents.arguments import CONDITIONS, SETTINGS
from aerodaas.errors import GraphError
from aerodaas.messages.waypoints import DEFAULT_PRIORITY, Waypoint

__all__ = ["application_text"]

_WIDTH = 100
"""Characters of a line at most."""
_LINES = 40
_INDENT = "    "
_MANY = 3
"""Waypoints from which on they are written as a table."""
_EXACT = 1e15
"""Whole numbers up to which floats hold each."""


def application_text(document: MissionDocument, environment: str | None = None) -> str:
    """Write a mission document as a Python application, which flies the same mission.

    Args:
        document: The mission document.
        environment: Path of the environment file; None for the name that the document has.

    Returns:
        The application's file, at most 40 lines.

    Raises:
        GraphError: For what is longer, or what no application can say, with the remedy.
        AeroDaaSError: For an analysis or a scheduler that is not registered here.
    """
    if document.here:
        raise GraphError(
            f"{', '.join(document.here)}: code at the user's side, which the document does not "
            "hold: take the application that it was compiled from"
        )
    text = _Writer(document, environment or document.environment or "environment.json").text()
    count = text.count("\n")
    if count > _LINES:
        raise GraphError(
            f"the application would have {count} lines, more than {_LINES}: fly the document "
            "itself by `aerodaas run`, or write its waypoints by a loop of your own"
        )
    return text


class _Code(str):
    """A Python expression, which stands as it is."""

    __slots__ = ()


class _Writer:
    """Writer of one application."""

    def __init__(self, document: MissionDocument, environment: str) -> None:
        self._document = document
        self._environment = environment
        self._imports: dict[str, set[str]] = {"aerodaas": {"Environment"}}
        self._names: dict[str, str] = {}
        """Variables by what they hold: `stream …`, `analysis …`, `robot …` or `compute …`."""
        self._taken = {"env", "main", "scheduler", "x", "y", "z", "i"}
        self._lines: list[str] = []
        self._scheduled: set[str] = set()
        """Robots with navigation that the scheduler adds."""

    def text(self) -> str:
        self._put(f"env = Environment({_text(self._environment)})")
        self._resources()
        self._schedulers()
        self._lines.append("")
        self._sensors()
        for entry in self._document.analyses:
            self._analysis(entry)
        for entry in self._document.analyses:
            for trigger in entry.triggers:
                self._trigger(entry, trigger)
        if self._lines[-1]:
            self._lines.append("")
        for one in self._document.navigation:
            self._navigation(one)
        flying = list(dict.fromkeys(one.robot for one in self._document.navigation))
        starter = self._names[f"robot {flying[0]}"] if len(flying) == 1 else "env"
        self._put(f"{starter}.start_mission()")
        name = re.sub(r"[^\w .-]", "", self._document.name).strip() or "Mission"
        return "\n".join(
            [
                f'"""{name}: written from a mission document."""'[:_WIDTH],
                "",
                *self._import_lines(),
                "",
                "",
                "def main() -> None:",
                f'{_INDENT}"""Build the dataflow and fly it."""',
                *self._lines,
                "",
                "",
                'if __name__ == "__main__":',
                f"{_INDENT}main()",
                "",
            ]
        )

    def _import_lines(self) -> Iterator[str]:
        for module, names in sorted(self._imports.items()):
            yield from _wrapped(f"from {module} import ", sorted(names), "")

    def _put(self, statement: str) -> None:
        self._lines.append(f"{_INDENT}{statement}")

    def _put_call(self, opening: str, arguments: Iterable[str], closing: str = ")") -> None:
        self._lines += _wrapped(f"{_INDENT}{opening}", list(arguments), closing)

    def _variable(self, key: str, wanted: str) -> str:
        """A fresh variable for `key`, called about as `wanted`."""
        base = re.sub(r"\W", "_", wanted, flags=re.ASCII).lower().strip("_") or "it"
        base = f"{base}_" if keyword.iskeyword(base) or base[0].isdigit() else base
        name, count = base, 2
        while name in self._taken or name in self._imports["aerodaas"]:
            name, count = f"{base}_{count}", count + 1
        self._taken.add(name)
        self._names[key] = name
        return name

    def _import(self, kind: Any, module: str | None = None) -> str:  # noqa: ANN401 - a class or a function
        name: str = kind.__name__
        self._imports.setdefault(module or kind.__module__, set()).add(name)
        return name

    def _resources(self) -> None:
        """Robots and compute resources, each in a variable."""
        document = self._document
        robots = [one.robot for one in document.navigation]
        robots += [one.rpartition("/")[0] for one in document.sensors if "/" in one]
        robots += [t.target for one in document.analyses for t in one.triggers if t.command]
        names = list(dict.fromkeys(robots))
        for robot in names:
            name = self._variable(f"robot {robot}", "drone" if len(names) == 1 else robot)
            self._put(f"{name} = env.get_robot_by_id({_text(robot)})")
        for compute in dict.fromkeys(one.compute for one in document.analyses if one.compute):
            name = self._variable(f"compute {compute}", compute)
            self._put(f"{name} = env.get_compute_resource_by_id({_text(compute)})")

    def _schedulers(self) -> None:
        document = self._document
        wanted = document.trajectory_scheduler
        if wanted is not None and not wanted.settings:
            self._put(f"env.set_trajectory_scheduler({_text(wanted.name)})")
        elif wanted is not None:
            kind = self._import(load_plugin("trajectory_schedulers", wanted.name))
            arguments = [_Code("env"), *self._arguments(wanted.settings)]
            self._put_call(f"env.set_trajectory_scheduler({kind}(", arguments, "))")
        if document.analytics_scheduler is not None:
            self._put(f"env.set_analytics_scheduler({_text(document.analytics_scheduler)})")
        if any(_needs_scheduler(one) for one in document.navigation):
            self._put("scheduler = env.trajectory_scheduler()")

    def _sensors(self) -> None:
        for sensor in self._document.sensors:
            robot, _, name = sensor.rpartition("/")
            call = (
                f"{self._names[f'robot {robot}']}.get_sensor_by_id"
                if robot
                else ("env.get_env_sensor_by_id")
            )
            stream = f"{call}({_text(name)}).get_data_stream()"
            used = self._is_read(sensor)
            self._put(f"{self._variable(f'stream {sensor}', name)} = {stream}" if used else stream)

    def _is_read(self, stream: str) -> bool:
        document = self._document
        reads = [name for one in document.analyses for name in one.reads]
        flown = [name for one in document.navigation for name in (one.stream, one.clear_on)]
        return stream in (*reads, *flown)

    def _analysis(self, entry: AnalysisEntry) -> None:
        """Statements of one analysis; its triggers come when all analyses are there."""
        assert entry.analysis is not None  # noqa: S101 - none is at the user's side
        kind = load_plugin("analytics", entry.analysis)
        short = entry.id.rpartition("/")[2]
        changes = list(self._changes(entry, kind, short))
        woken = any(
            one.target == entry.id and not one.command
            for other in self._document.analyses
            for one in other.triggers
        )
        made = f"{self._import(kind, _home_of(kind))}("
        deploy = f".deploy({self._names[f'compute {entry.compute}']})" if entry.compute else ""
        calls = [f".analyse({self._stream(one, entry.id)})" for one in entry.reads]
        calls = calls or [".instantiate()"]
        read = self._is_read(entry.id)
        arguments = list(self._arguments(entry.settings))
        if not (changes or woken or entry.triggers or len(calls) > 1):
            target = f"{self._variable(f'stream {entry.id}', short)} = " if read else ""
            self._put_call(f"{target}{made}", arguments, f"){deploy}{calls[0]}")
            return
        work = self._variable(f"analysis {entry.id}", f"{short}_analysis" if read else short)
        self._put_call(f"{work} = {made}", arguments, f"){deploy}")
        for change in changes:
            self._put(f"{work}.{change}")
        target = f"{self._variable(f'stream {entry.id}', short)} = " if read else ""
        self._put(f"{target}{work}{calls[0]}")
        for call in calls[1:]:
            self._put(f"{work}{call}")

    def _changes(self, entry: AnalysisEntry, kind: Any, short: str) -> Iterator[str]:  # noqa: ANN401
        """Attributes of an analysis that its constructor does not set."""
        usual = entry.settings.get("name") or kind.name
        if short != (usual or snake_case(kind.__name__).removesuffix("_analytics")):
            yield f"name = {_text(short)}"
        if entry.rate is not None and entry.rate != entry.settings.get("rate", kind.rate):
            yield f"rate = {_number(entry.rate)}"
        if entry.task is not None:
            self._imports.setdefault("aerodaas.config.model", set()).add("TaskConfig")
            yield f"task = TaskConfig({', '.join(self._arguments(entry.task))})"

    def _stream(self, name: str, reader: str) -> str:
        if f"stream {name}" not in self._names:
            raise GraphError(
                f"{reader} reads {name}, which another analysis starts for itself: give that "
                "analysis an entry of its own"
            )
        return self._names[f"stream {name}"]

    def _trigger(self, entry: AnalysisEntry, trigger: TriggerEntry) -> None:
        if trigger.command is not None:
            target = f"{self._names[f'robot {trigger.target}']}.{trigger.command}"
        elif f"analysis {trigger.target}" in self._names:
            target = self._names[f"analysis {trigger.target}"]
        else:
            raise GraphError(f"{entry.id} wakes {trigger.target}, which the document does not have")
        when = [] if trigger.when is None else [f"when={self._value(trigger.when)}"]
        self._put_call(f"{self._names[f'analysis {entry.id}']}.trigger(", [target, *when])

    def _navigation(self, entry: NavigationDocument) -> None:
        """Statements by which a robot navigates: its own, or the scheduler's from the first on."""
        robot = self._names[f"robot {entry.robot}"]
        source = None if entry.stream is None else self._stream(entry.stream, entry.robot)
        if entry.clear_on is not None and entry.clear_on != entry.stream:
            raise GraphError(
                f"{entry.robot}: an application empties the queue by the stream that it then flies "
                f"by, not by {entry.clear_on}: fly the document itself by `aerodaas run`"
            )
        if source is None:
            source = self._route(entry)
        navigation = self._made_navigation(entry, source)
        more = {"index": entry.index, "deadline": entry.deadline, "robot": _Code(robot)}
        given = [f"{key}={self._value(one)}" for key, one in more.items() if one is not None]
        if entry.clear_on is not None:
            if entry.robot in self._scheduled:
                raise GraphError(
                    f"{entry.robot}: an application that empties the queue forgets what the "
                    "scheduler added before: have this navigation first in the document"
                )
            self._put(f"scheduler.clear_navigation(robot={robot})")
        if _needs_scheduler(entry) or self._scheduled:
            self._scheduled.add(entry.robot)
            self._put_call("scheduler.add_navigation(", [navigation, *given])
        else:
            self._put_call(f"{robot}.navigate(", [navigation])

    def _made_navigation(self, entry: NavigationDocument, source: str) -> str:
        """The expression of a navigation; a plain stream stands for itself."""
        if entry.stream is not None and entry.ordered and entry.priority is None:
            return source
        self._imports["aerodaas"].add("AeroNavigation")
        arguments = [f"data={source}"]
        if entry.stream is not None:
            self._imports["aerodaas"].add("NavigationType")
            arguments = ["NavigationType.ANALYTICS_DRIVEN", source]
        if not entry.ordered:
            self._imports["aerodaas"].add("SchedulingType")
            named = "" if entry.stream is not None else "scheduling_type="
            arguments.append(f"{named}SchedulingType.UNORDERED")
        if entry.priority is not None:
            arguments.append(f"priority={entry.priority}")
        return f"AeroNavigation({', '.join(arguments)})"

    def _route(self, entry: NavigationDocument) -> str:
        """Statements that make waypoints, of many by a table; the variable that holds them."""
        # The navigation's priority is that of each.
        given = {} if entry.priority is None else {"priority": DEFAULT_PRIORITY}
        waypoints = [replace(one, **given) for one in entry.waypoints]
        self._imports["aerodaas"].add("Waypoint")
        if len(waypoints) < _MANY:
            route = self._variable("", "route")
            made = [f"Waypoint({', '.join(self._waypoint(one))})" for one in waypoints]
            self._put_call(f"{route} = [", made, "]")
            return route
        numbered, level = _numbering(waypoints), len({one.z for one in waypoints}) == 1
        further = [_further(one) for one in waypoints]
        names = list(dict.fromkeys(key for one in further for key in one))
        varied = [
            key for key in names if any(one.get(key) != further[0].get(key) for one in further)
        ]
        axes = ["x", "y"] if level else ["x", "y", "z"]
        columns = [*([] if numbered else ["name"]), *axes, *varied]
        rows = []
        for one in waypoints:
            own = [] if numbered else [_text(one.id)]
            own += _place(one)[: len(axes)]
            own += [self._attribute(key, getattr(one, key)) for key in varied]
            rows.append(f"({', '.join(own)})")
        places, route = self._variable("", "places"), self._variable("", "route")
        self._put_call(f"{places} = [", rows, "]")
        name = f'f"{numbered[0]}{{i}}"' if numbered else "name"
        arguments = [name, "x", "y", _number(waypoints[0].z) if level else "z"]
        arguments += [
            f"{key}={key if key in varied else self._attribute(key, further[0][key])}"
            for key in names
        ]
        loop = f"for {', '.join(columns)} in {places}"
        if numbered:
            loop = f"for i, ({', '.join(columns)}) in enumerate({places}, {numbered[1]})"
        self._put_call(f"{route} = [", [f"Waypoint({', '.join(arguments)})", loop], "]")
        return route

    def _waypoint(self, waypoint: Waypoint) -> Iterator[str]:
        """Arguments of one waypoint."""
        yield from (_text(waypoint.id), *_place(waypoint))
        for key, value in _further(waypoint).items():
            yield f"{key}={self._attribute(key, value)}"

    def _attribute(self, key: str, value: Any) -> str:  # noqa: ANN401 - of a waypoint
        if key != "actions":
            return self._value(getattr(value, "value", value))
        for one in value:
            self._import(type(one))
        return f"[{', '.join(map(repr, value))}]"

    def _arguments(self, settings: Mapping[str, Any]) -> Iterator[str]:
        for name, value in settings.items():
            # Names come from a stranger, and what is written here is run.
            if not name.isidentifier() or keyword.iskeyword(name):
                raise GraphError(f"{name[:60]!r} is no name of an argument: take a known one")
            yield f"{name}={self._value(value)}"

    def _value(self, value: Any) -> str:  # noqa: ANN401 - any value of a document
        """A value of the document as Python."""
        if isinstance(value, _Code):
            return value
        if isinstance(value, list):
            inner = [self._value(one) for one in value]
            if value and all(isinstance(one, int | float) for one in value):
                return f"({', '.join(inner)}{',' if len(inner) == 1 else ''})"
            return f"[{', '.join(inner)}]"
        if isinstance(value, dict):
            return self._object(value)
        if isinstance(value, str):
            return _text(value)
        return _number(value) if isinstance(value, float) else repr(value)

    def _object(self, value: Mapping[str, Any]) -> str:
        """A value with a key that begins with a dollar sign, or a plain mapping."""
        match value:
            case {"$analysis": str(name), "settings": settings}:
                kind = load_plugin("analytics", name)
                made = self._import(kind, _home_of(kind))
                code = f"{made}({', '.join(self._arguments(settings))})"
            case {"$settings": str(name), "of": of} if name in SETTINGS:
                self._imports.setdefault(_module(SETTINGS[name]), set()).add(name)
                code = f"{name}({', '.join(self._arguments(of))})"
            case {"$condition": str(name)} if name in CONDITIONS:
                self._imports.setdefault(_module(CONDITIONS[name]), set()).add(name)
                code = name
            case {"$environment": str(form)}:
                code = "env.env_data" if form == "data" else "env"
            case {"$output": str(name)}:
                code = _text(f"runs/{name}")
            case {"$property": [str(sensor), str(name)]}:
                code = (
                    f"env.get_env_sensor_by_id({_text(sensor)}).get_sensor_property({_text(name)})"
                )
            case {"$model": str(name), "sha256": sha256}:
                known = [key for key, model in REGISTRY.items() if model.sha256 == sha256]
                code = _text(known[0] if known else f"models/{name}")
            case _:
                if unknown := [key for key in value if key.startswith("$")]:
                    raise GraphError(f"there is no {unknown[0]} here: take a value that is known")
                pairs = [f"{_text(key)}: {self._value(one)}" for key, one in value.items()]
                code = f"{{{', '.join(pairs)}}}"
        return code


def _needs_scheduler(entry: NavigationDocument) -> bool:
    return not (entry.index is None and entry.deadline is None and entry.clear_on is None)


def _home_of(kind: Any) -> str:  # noqa: ANN401 - a class
    """Module from which an analysis is imported, as the documentation has it."""
    from aerodaas import analytics  # noqa: PLC0415 - loads its modules on access

    return "aerodaas.analytics" if kind.__name__ in dir(analytics) else str(kind.__module__)


def _module(target: str) -> str:
    from aerodaas import analytics  # noqa: PLC0415 - loads its modules on access

    module, _, name = target.partition(":")
    return "aerodaas.analytics" if name in dir(analytics) else module


def _text(value: str) -> str:
    """A text as Python, in double quotes where nothing in it has to be escaped."""
    return json.dumps(value, ensure_ascii=False) if value.isprintable() else repr(value)


def _number(value: float) -> str:
    return str(int(value)) if float(value).is_integer() and abs(value) < _EXACT else repr(value)


def _place(waypoint: Waypoint) -> list[str]:
    return [_number(axis) for axis in (waypoint.x, waypoint.y, waypoint.z)]


def _further(waypoint: Waypoint) -> dict[str, Any]:
    """Fields of a waypoint beside id and place that are not the default."""
    return {
        one.name: getattr(waypoint, one.name)
        for one in fields(Waypoint)
        if one.name not in {"id", "x", "y", "z"} and getattr(waypoint, one.name) != one.default
    }


def _numbering(waypoints: Sequence[Waypoint]) -> tuple[str, int] | None:
    """Prefix and first number of ids that count upwards; None if they do not."""
    found = re.fullmatch(r"([^{}\\\"\d]*)(\d+)", waypoints[0].id)
    if found is None or not found[1].isprintable():
        return None
    prefix, start = found[1], int(found[2])
    counted = [f"{prefix}{start + number}" for number in range(len(waypoints))]
    return (prefix, start) if [one.id for one in waypoints] == counted else None


def _wrapped(opening: str, items: Sequence[str], closing: str) -> list[str]:
    """A call, a list or an import on one line, or on several of them with as many items each."""
    loops = bool(items) and items[-1].startswith("for ")
    whole = f"{opening}{(' ' if loops else ', ').join(items)}{closing}"
    if len(whole) <= _WIDTH:
        return [whole]
    imported = opening.startswith("from ")
    indent = " " * (len(opening) - len(opening.lstrip()))
    rows = [""]
    for item in items:
        written = item if loops else f"{item},"
        if rows[-1] and (loops or len(f"{indent}{_INDENT}{rows[-1]} {written}") > _WIDTH):
            rows.append("")
        rows[-1] = f"{rows[-1]} {written}".strip()
    first, last = (f"{opening}(", ")") if imported else (opening, closing)
    return [first, *(f"{indent}{_INDENT}{row}" for row in rows), f"{indent}{last}"]
