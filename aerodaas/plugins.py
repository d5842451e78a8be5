"""Plug-ins: found by registered name, by entry point, or by `module:Class`.

A package adds its own by an entry point in the group `aerodaas.<kind>`, such as
`aerodaas.cameras`; an application may name any importable class as `module:Class`.
"""

from __future__ import annotations

import importlib
from importlib.metadata import entry_points
from typing import Any, Literal

from aerodaas.errors import AeroDaaSError, ConfigError, UnknownIdError

__all__ = ["PluginKind", "load_plugin", "plugin_names", "require_plugin"]

PluginKind = Literal["drivers", "cameras", "waypoint_schedulers"]

_BUILT_IN: dict[PluginKind, dict[str, str]] = {
    "drivers": {
        "simulated": "aerodaas.drivers.simulated:SimulatedVehicle",
        "tello": "aerodaas.drivers.tello.vehicle:TelloVehicle",
    },
    "cameras": {
        "simulated": "aerodaas.cameras.simulated:SimulatedCamera",
        "tello": "aerodaas.cameras.tello:TelloCamera",
        "recorded": "aerodaas.cameras.recorded:recorded_camera",
        "folder": "aerodaas.cameras.folder:FolderCamera",
        "video": "aerodaas.cameras.video:VideoCamera",
        "mcap": "aerodaas.cameras.mcap:McapCamera",
        "replayed": "aerodaas.cameras.mcap:ReplayedCamera",
    },
    "waypoint_schedulers": {
        "ordered": "aerodaas.schedulers.waypoint.ordered:OrderedScheduler",
        "nearest_neighbor": (
            "aerodaas.schedulers.waypoint.nearest_neighbor:NearestNeighborScheduler"
        ),
        "priority": "aerodaas.schedulers.waypoint.priority:PriorityScheduler",
        "deadline": "aerodaas.schedulers.waypoint.deadline:DeadlineScheduler",
        "optimal": "aerodaas.schedulers.waypoint.optimal:OptimalScheduler",
    },
}


def plugin_names(kind: PluginKind) -> list[str]:
    """Names that `load_plugin` knows, sorted."""
    found = {point.name for point in entry_points(group=f"aerodaas.{kind}")}
    return sorted(found | set(_BUILT_IN[kind]))


def require_plugin(kind: PluginKind, name: str) -> None:
    """Import nothing, but raise UnknownIdError if nothing is called `name`."""
    _target(kind, name)


def load_plugin(kind: PluginKind, name: str) -> Any:  # noqa: ANN401 - a class of the caller's kind
    """Import the class called `name`.

    Raises UnknownIdError for an unknown name, ConfigError for one that cannot be imported.
    """
    target = _target(kind, name)
    module, _, attribute = target.partition(":")
    try:
        return getattr(importlib.import_module(module), attribute)
    except AeroDaaSError:
        raise
    except (ImportError, AttributeError) as error:
        raise ConfigError(f"cannot load {name!r} ({target}): {error}") from error


def _target(kind: PluginKind, name: str) -> str:
    if name in _BUILT_IN[kind]:
        return _BUILT_IN[kind][name]
    for point in entry_points(group=f"aerodaas.{kind}"):
        if point.name == name:
            return point.value
    if ":" in name:
        return name
    label = kind.replace("_", " ").removesuffix("s")
    raise UnknownIdError(label, name, plugin_names(kind))
