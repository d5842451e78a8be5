"""Plug-ins: found by registered name, by entry point, or by `module:Class`.

An extension adds the plug-ins that its `Extension` lists. A package adds its own by an entry point
in the group `aerodaas.<kind>`, such as `aerodaas.cameras`; an application may name any importable
class as `module:Class`.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Mapping
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType
from typing import Any

from pydantic import BaseModel

from aerodaas.config.extensions import PluginKind, extensions
from aerodaas.errors import AeroDaaSError, ConfigError, UnknownIdError

__all__ = [
    "is_built_in",
    "load_plugin",
    "main_name",
    "plugin_names",
    "require_plugin",
    "settings_model",
]

_CORE: dict[PluginKind, dict[str, str]] = {
    "drivers": {
        "simulated": "aerodaas.drivers.simulated:SimulatedVehicle",
        "mavlink": "aerodaas.drivers.mavlink.vehicle:MavlinkVehicle",
        "replayed": "aerodaas.recording.replay.vehicle:ReplayedVehicle",
    },
    "cameras": {
        "simulated": "aerodaas.cameras.simulated:SimulatedCamera",
        "recorded": "aerodaas.cameras.recorded:recorded_camera",
        "folder": "aerodaas.cameras.folder:FolderCamera",
        "video": "aerodaas.cameras.video:VideoCamera",
        "mavlink": "aerodaas.cameras.video:VideoCamera",
        "mcap": "aerodaas.recording.replay.mcap_camera:McapCamera",
        "replayed": "aerodaas.recording.replay.mcap_camera:ReplayedCamera",
    },
    "analytics": {
        name: f"aerodaas.analytics:{name}"
        for name in (
            "BodyPoseEmergencyAnalytics",
            "CarFollowAnalytics",
            "CombinedDetector",
            "CrowdDensityAnalytics",
            "DistanceAnalytics",
            "FollowAnalytics",
            "GpsLoggerAnalytics",
            "MonitoringAnalytics",
            "OnnxDetector",
            "PersonFollowAnalytics",
            "PoseAnalytics",
            "RemoteAnalytics",
            "SyntheticAnalytics",
            "TowerInspectionAnalytics",
            "TrackingAnalytics",
            "VipDetectionAnalytics",
            "VipFollowAnalytics",
        )
    },
    "trajectory_schedulers": {
        "ordered": "aerodaas.schedulers.trajectory.ordered:OrderedScheduler",
        "nearest_neighbor": (
            "aerodaas.schedulers.trajectory.nearest_neighbor:NearestNeighborScheduler"
        ),
        "priority": "aerodaas.schedulers.trajectory.priority:PriorityScheduler",
        "deadline": "aerodaas.schedulers.trajectory.deadline:DeadlineScheduler",
        "optimal": "aerodaas.schedulers.trajectory.optimal:OptimalScheduler",
    },
    "analytics_schedulers": {
        "fifo": "aerodaas.schedulers.analytics.published.edge_only:Fifo",
        "edf": "aerodaas.schedulers.analytics.published.edge_only:Edf",
        "sjf": "aerodaas.schedulers.analytics.published.edge_only:Sjf",
        "hbf": "aerodaas.schedulers.analytics.published.edge_only:Hbf",
        "huf": "aerodaas.schedulers.analytics.published.edge_only:Huf",
        "hpf": "aerodaas.schedulers.analytics.published.edge_only:Hpf",
        "cld": "aerodaas.schedulers.analytics.published.cloud_only:CloudOnly",
        "ec_edf": "aerodaas.schedulers.analytics.published.edge_cloud:EdgeCloudEdf",
        "ec_sjf": "aerodaas.schedulers.analytics.published.edge_cloud:EdgeCloudSjf",
        "dem": "aerodaas.schedulers.analytics.published.dem:Dem",
        "dems": "aerodaas.schedulers.analytics.published.dems:Dems",
        "dems_a": "aerodaas.schedulers.analytics.published.dems_a:DemsA",
        "gems": "aerodaas.schedulers.analytics.published.gems:Gems",
        "sfq_dems": "aerodaas.schedulers.analytics.sfq_dems:SfqDems",
        "kalmia": "aerodaas.schedulers.analytics.published.kalmia:Kalmia",
        "dedas": "aerodaas.schedulers.analytics.published.dedas:Dedas",
        "margin": "aerodaas.schedulers.analytics.margin:Margin",
    },
}


def plugin_names(kind: PluginKind) -> list[str]:
    """Names that `load_plugin` resolves, sorted."""
    found = {point.name for point in entry_points(group=f"aerodaas.{kind}")}
    return sorted(found | set(_CORE[kind]) | set(_of_extensions(kind)))


def require_plugin(kind: PluginKind, name: str) -> None:
    """Require that there is a plug-in of some name; imports nothing.

    Args:
        kind: Kind of plug-in.
        name: Its name.

    Raises:
        UnknownIdError: If there is none.
    """
    _target(kind, name)


def is_built_in(kind: PluginKind, name: str) -> bool:
    """Whether a plug-in is one of the project's own.

    Args:
        kind: Kind of plug-in.
        name: Its name.
    """
    own = _of_extensions(kind).get(name, "")
    return name in _CORE[kind] or own.startswith("aerodaas.extensions.")


def load_plugin(kind: PluginKind, name: str) -> Any:  # noqa: ANN401 - a class of the caller's kind
    """Import the class of a plug-in.

    Args:
        kind: Kind of plug-in.
        name: Registered name, or `module:Class`.

    Raises:
        UnknownIdError: For an unknown name.
        ConfigError: For a class that cannot be imported.
    """
    target = _target(kind, name)
    module, _, attribute = target.partition(":")
    try:
        return getattr(_imported(module), attribute)
    except AeroDaaSError:
        raise
    except (ImportError, AttributeError) as error:
        raise ConfigError(f"cannot load {name!r} ({target}): {error}") from error


def settings_model(kind: PluginKind, name: str) -> type[BaseModel] | None:
    """The pydantic model of a plug-in's settings; None if it has none.

    Args:
        kind: Kind of plug-in.
        name: Its name.

    Raises:
        AeroDaaSError: What `load_plugin` raises.
    """
    model = getattr(load_plugin(kind, name), "settings_model", None)
    return model if isinstance(model, type) and issubclass(model, BaseModel) else None


def main_name(namespace: Mapping[str, Any]) -> str | None:
    """The name by which others would import the file that runs as `__main__`; None without one."""
    spec, file = namespace.get("__spec__"), namespace.get("__file__")
    if spec is not None:
        return str(spec.name)
    return Path(file).stem if file else None


def _imported(name: str) -> ModuleType:
    # Imported again, the application's own file would start its mission again.
    main = sys.modules.get("__main__")
    if main is not None and name == main_name(vars(main)):
        return main
    return importlib.import_module(name)


def _of_extensions(kind: PluginKind) -> dict[str, str]:
    """`module:attribute` of the plug-ins of one kind that extensions add, by name."""
    return {
        name: place
        for extension in extensions().values()
        for name, place in extension.plugins.get(kind, {}).items()
    }


def _target(kind: PluginKind, name: str) -> str:
    known = _CORE[kind].get(name) or _of_extensions(kind).get(name)
    if known is not None:
        return known
    for point in entry_points(group=f"aerodaas.{kind}"):
        if point.name == name:
            return point.value
    if ":" in name:
        return name
    label = kind.replace("_", " ").removesuffix("s")
    raise UnknownIdError(label, name, plugin_names(kind))
