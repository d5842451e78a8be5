"""Extensions: features that the core flies without, each in a folder or a package of its own.

The project's own are the folders of `aerodaas/extensions/`. A package adds others by an entry
point in the group `aerodaas.extensions`, whose value names its `Extension`. The core imports no
extension: it asks `extensions()` what there is, and imports what an extension names when needed.
"""

from __future__ import annotations

import importlib
import logging
import pkgutil
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import entry_points
from typing import Any, Literal

from aerodaas.errors import ConfigError

__all__ = [
    "Command",
    "Extension",
    "Hook",
    "LiveView",
    "PluginKind",
    "SettingsSection",
    "VehicleDiscovery",
    "VehicleKind",
    "added",
    "extensions",
    "imported",
    "live_views",
    "section_models",
    "service",
]

_PACKAGE = "aerodaas.extensions"
_log = logging.getLogger(__name__)

PluginKind = Literal[
    "drivers", "cameras", "analytics", "trajectory_schedulers", "analytics_schedulers"
]
Hook = Literal[
    "actions",
    "action_executors",
    "handovers",
    "mavlink_components",
    "preflight_checks",
    "report_sections",
    "routes",
    "safety_rules",
    "sidecar_writers",
    "simulated_equipment",
]
"""A field of `Extension` that names code which the core calls for every flight or server."""
SettingsSection = Literal["environment", "robot", "limits", "mission", "preflight"]
"""A part of an environment file to which extensions add: the whole file, a robot, or a part of a
robot."""


@dataclass(frozen=True)
class Command:
    """One command of the command line."""

    name: str
    """The word by which it is called."""
    place: str
    """`module:attribute` of its function, or of a Typer application of several commands."""
    summary: str
    """The first sentence of its help."""
    panel: str | None = None
    """Title above it in the list of commands; None for the list's own."""
    words: bool = False
    """Whether words after `--` are an application's own."""


@dataclass(frozen=True)
class LiveView:
    """A way to show a flight's recorded messages in another program while it flies."""

    name: str
    """The word after `aerodaas run --show`."""
    summary: str
    """What it shows, and where."""
    prepare: str
    """`module:function` without arguments, called by the application before the flight. It returns
    the place that `open` gets, and raises a ConfigError with the remedy if nothing can be shown."""
    open: str
    """`module:callable` that opens the view beside the recorder. It gets the place, the start of
    the mission clock (Unix, nanoseconds) and the quality of JPEG pictures (1 to 100). What it
    returns has `put(message)`, called with each recorded message, and `close()`."""


@dataclass(frozen=True)
class VehicleDiscovery:
    """Result of a search for a vehicle of one kind."""

    address: str | None = None
    """Where a vehicle is; None if none was found."""
    notes: tuple[str, ...] = ()
    """Signs of a vehicle that was not found, and what hindered the search."""


@dataclass(frozen=True)
class VehicleKind:
    """A kind of vehicle for which `aerodaas init` writes an environment file."""

    name: str
    driver: str
    limits: Mapping[str, Any]
    """Limits of a first flight, as an environment file has them."""
    fence: tuple[float, float]
    """Geofence of a first flight: metres from the take-off to each side, and up."""
    address: str | None = None
    """Where the vehicle is by default; None if it has no address."""
    address_setting: str = ""
    """The driver's setting for the address."""
    camera: Mapping[str, Any] | None = None
    """Settings of the camera that the vehicle brings along; None if it brings none."""
    find: str = ""
    """`module:function` that searches for such a vehicle: it gets how many seconds to listen and
    an address to ask or None, and returns a `VehicleDiscovery`. Empty if nothing searches."""


@dataclass(frozen=True)
class Extension:
    """All that one extension adds to the core.

    Its module is imported by every command, so it imports nothing slow: code is named as
    `module:attribute`.
    """

    name: str
    """The folder's or the entry point's name."""
    summary: str
    """One sentence for a list of extensions."""
    plugins: Mapping[PluginKind, Mapping[str, str]] = field(default_factory=dict)
    """`module:attribute` of each plug-in by its registered name."""
    settings: Mapping[SettingsSection, str] = field(default_factory=dict)
    """`module:Model` by section of the environment file: the fields of this pydantic model become
    settings of the section. Code of the extension reads them by `config.checked.added_settings`."""
    recorded_settings: tuple[str, ...] = ()
    """Dotted names of those settings that a replay reads of a recording, a stranger's data: numbers
    and words that describe the flight. `[]` follows the name of a list, `*` is any key:
    `robots[].limits.towing.rope`."""
    mavlink_components: tuple[str, ...] = ()
    """`module:Class` of each `drivers.mavlink.component.MavlinkComponent` of every MAVLink
    vehicle: equipment by messages of its own, or a service of the autopilot."""
    simulated_equipment: tuple[str, ...] = ()
    """`module:Class` of each `simulation.equipment.SimulatedEquipment` of every simulated drone."""
    sidecar_writers: tuple[str, ...] = ()
    """`module:Class` of each `recording.sidecar.SidecarWriter` of files beside a recording."""
    safety_rules: tuple[str, ...] = ()
    """`module:Class` of each `mission.safety.supervisor.SafetyRule` of every drone, made with the
    robot's limits."""
    actions: tuple[str, ...] = ()
    """`module:Class` of each further kind of `messages.actions.Action` of a waypoint."""
    action_executors: tuple[str, ...] = ()
    """`module:Class` of each `mission.action_executor.ActionExecutor` that performs them."""
    handovers: tuple[str, ...] = ()
    """`module:Class` of a `mission.handover.Handover` of waypoints; the first of all is used."""
    preflight_checks: tuple[str, ...] = ()
    """`module:function` of items of the list before take-off: each gets a robot's limits and its
    preflight settings, and returns a `mission.safety.checklist.PreflightCheck`."""
    commands: tuple[Command, ...] = ()
    exports: tuple[Command, ...] = ()
    """Formats of `aerodaas export`."""
    lab: tuple[Command, ...] = ()
    """Commands of `aerodaas lab`."""
    views: tuple[LiveView, ...] = ()
    services: Mapping[str, str] = field(default_factory=dict)
    """`module:function` by name, such as `plans.read`, of each function that the core calls by
    `service`: what a method of the core's promises and an extension does."""
    decoders: Mapping[str, str] = field(default_factory=dict)
    """By an encoding of recorded messages: `module:function` that gets the name of a schema and
    returns the function that decodes its messages, or None for a schema that it does not know."""
    vehicles: tuple[VehicleKind, ...] = ()
    elevation_formats: Mapping[str, str] = field(default_factory=dict)
    """By the suffix of an elevation file, such as `.hgt`: `module:function` that gets its path and
    returns a `terrain.tile.Tile`."""
    routes: tuple[str, ...] = ()
    """`module:function` of what is added to a service's API: each gets the missions, of the class
    `Missions`, and the access to them, an `Admission`, and returns a FastAPI router."""
    report_sections: tuple[str, ...] = ()
    """`module:function` of what is added to the report of a recording: each gets an open
    `Recording`, and returns a list of `ReportSection`."""
    ports: Mapping[int, str] = field(default_factory=dict)
    """UDP ports that `aerodaas doctor` tries, and what listens there."""
    requires: tuple[str, ...] = ()
    """Names of the extensions, theirs included, without which it is left out."""


@cache
def extensions() -> Mapping[str, Extension]:
    """Every extension by its name: the project's own first, each group in order of the alphabet.

    One that requires another that is missing, and an installed package's that cannot be imported,
    is left out with a warning, so that everything else still works.

    Raises:
        ConfigError: If two extensions have one name, or add one plug-in.
    """
    found: dict[str, Extension] = {}
    owner: dict[tuple[str, str], str] = {}
    for name, extension in (*_own(), *_installed()):
        if name in found:
            raise ConfigError(f"two extensions are called {name!r}: uninstall one of them")
        found[name] = extension
        for kind, plugins in extension.plugins.items():
            for plugin in plugins:
                other = owner.setdefault((kind, plugin), name)
                if other != name:
                    raise ConfigError(
                        f"the extensions {other!r} and {name!r} both add {plugin!r} to {kind}: "
                        "uninstall one of them"
                    )
    for name, extension in list(found.items()):
        if missing := [other for other in extension.requires if other not in found]:
            _log.warning("the extension %r is left out without %s", name, ", ".join(missing))
            del found[name]
    return found


def live_views() -> dict[str, LiveView]:
    """Live views that extensions add, by name."""
    return {view.name: view for extension in extensions().values() for view in extension.views}


def added(hook: Hook) -> list[Any]:
    """Import what all extensions name in one field, in the order of the extensions."""
    return [
        imported(place) for extension in extensions().values() for place in getattr(extension, hook)
    ]


def section_models(section: SettingsSection) -> dict[str, Any]:
    """Models of the settings that extensions add to a section, by the extension's name."""
    return {
        name: imported(extension.settings[section])
        for name, extension in extensions().items()
        if section in extension.settings
    }


def service(name: str) -> Callable[..., Any]:
    """Import the function that an extension gives as a service.

    Args:
        name: Name of the service; the part before its dot is the extension's.

    Raises:
        ConfigError: If no extension gives it.
    """
    for extension in extensions().values():
        if name in extension.services:
            found: Callable[..., Any] = imported(extension.services[name])
            return found
    raise ConfigError(
        f"this installation has no extension {name.partition('.')[0]!r}, which does this: "
        "install aerodaas anew, whole"
    )


def imported(place: str) -> Any:  # noqa: ANN401 - whatever is named
    """Import what an extension names.

    Args:
        place: `module:attribute`.
    """
    module, _, attribute = place.partition(":")
    return getattr(importlib.import_module(module), attribute)


def _own() -> Iterator[tuple[str, Extension]]:
    try:
        package = importlib.import_module(_PACKAGE)
    except ModuleNotFoundError:
        return
    for module in sorted(pkgutil.iter_modules(package.__path__), key=lambda module: module.name):
        yield module.name, imported(f"{_PACKAGE}.{module.name}.extension:EXTENSION")


def _installed() -> Iterator[tuple[str, Extension]]:
    for point in sorted(entry_points(group=_PACKAGE), key=lambda point: point.name):
        try:
            extension = point.load()
        except Exception as error:  # noqa: BLE001 - a stranger's module may raise anything
            _log.warning("the extension %r cannot be imported: %s", point.name, error)
            continue
        if not isinstance(extension, Extension):
            _log.warning("the extension %r is no Extension: %s", point.name, point.value)
            continue
        yield point.name, extension
