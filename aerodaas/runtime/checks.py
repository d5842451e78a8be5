"""Checks of an environment and a graph before a run; each error names its remedy.

Errors that a node would raise when it opens are raised here first, if possible: models take
seconds to load, and a typing error should be found before the fleet is in the field.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aerodaas.analytics.base import Analytics
from aerodaas.config.checked import checked, near
from aerodaas.config.extensions import service
from aerodaas.config.plugins import (
    PluginKind,
    is_built_in,
    load_plugin,
    require_plugin,
    settings_model,
)
from aerodaas.config.secrets import SecretUrl, plain, shown_text
from aerodaas.dataflow.names import snake_case
from aerodaas.drivers.loading import check_links, load_vehicle
from aerodaas.errors import ConfigError, GraphError
from aerodaas.identifiers import find_scoped

if TYPE_CHECKING:
    from aerodaas.config.model import EnvironmentConfig, RobotConfig, SensorConfig
    from aerodaas.dataflow.graph import Graph, Node

__all__ = [
    "check_environment",
    "check_graph",
    "check_places",
    "check_plugins",
    "check_served",
    "check_tasks",
    "sensor_properties",
]

_PLAYED = {"folder", "mcap", "recorded", "video"}
"""Camera drivers that read the file or folder of the setting `path`."""
_CAMERA = ("open", "capture", "close")
_VEHICLE = (
    "connect", "read", "preflight", "take_off", "send", "hold", "return_home", "land", "close"
)  # fmt: skip
_OWN_CAMERA = 'give the sensor a "driver" of its own, such as "simulated", "video" or module:Class'
_LAST_PORT = 65535
_NAMED = 200
"""Most files of a folder that are searched for a similar name."""


def check_environment(config: EnvironmentConfig, place: str) -> None:
    """Check the names and settings of an environment's plug-ins.

    Plug-ins of the application are not imported, because they may be in its own file;
    `check_plugins` checks them.

    Args:
        config: The environment.
        place: Its file, for errors.

    Raises:
        ConfigError: If a setting is unknown or invalid.
        UnknownIdError: If a name is unknown.
    """
    require_plugin("trajectory_schedulers", config.schedulers.trajectory)
    for robot in config.robots:
        require_plugin("drivers", robot.driver)
        if is_built_in("drivers", robot.driver):
            _check_settings("drivers", robot.driver, robot.settings, f"{place}: robot {robot.id}")
            _check_actuators(robot, f"{place}: robot {robot.id}")
    try:
        check_links([one for one in config.robots if is_built_in("drivers", one.driver)])
    except ConfigError as error:
        raise ConfigError(f"{place}: {error}") from None
    for sensor in (one for one in config.all_sensors() if one.type == "camera"):
        driver = config.camera_driver(sensor)
        require_plugin("cameras", driver)
        if is_built_in("cameras", driver):
            _check_settings("cameras", driver, sensor.settings, f"{place}: sensor {sensor.full_id}")


def check_plugins(
    config: EnvironmentConfig,
    robots: Iterable[RobotConfig],
    cameras: Iterable[SensorConfig],
    *,
    here: bool,
) -> None:
    """Check drivers and cameras for what would keep them from being opened.

    Settings of any plug-in are validated by the pydantic model `settings_model` of its class, if it
    has one; built-in plug-ins are also constructed, which opens nothing. The project's errors are
    raised.

    Args:
        config: The environment.
        robots: Robots that fly.
        cameras: Cameras that are opened.
        here: Whether all actors run on this machine: then files to be played must exist on it.
    """
    robots = list(robots)
    for robot in robots:
        _require_methods("drivers", robot.driver, _VEHICLE, f"robot {robot.id}")
        _check_settings("drivers", robot.driver, robot.settings, f"robot {robot.id}")
        _check_actuators(robot, f"robot {robot.id}")
        if is_built_in("drivers", robot.driver):
            load_vehicle(robot, config)
    check_links(robots)
    for sensor in cameras:
        driver = config.camera_driver(sensor)
        hint = "" if sensor.driver else f"; its robot's driver was taken: {_OWN_CAMERA}"
        _require_methods("cameras", driver, _CAMERA, f"sensor {sensor.full_id}", hint)
        _check_settings("cameras", driver, sensor.settings, f"sensor {sensor.full_id}")
        if is_built_in("cameras", driver):
            load_plugin("cameras", driver)(sensor, config)
        if here and driver in _PLAYED:
            _check_path(sensor)


def check_graph(graph: Graph, config: EnvironmentConfig, flying: Collection[str]) -> None:
    """Raise the project's errors for a graph that would fail only at run time.

    Args:
        graph: The graph.
        config: The environment, whose `runtime_env` names analyses.
        flying: Ids of the robots that navigate.
    """
    for node in graph.nodes.values():
        if node.kind == "sensor":
            continue
        if node.kind == "external" and not _is_rate(node.work.rate):
            raise GraphError(
                f"{node.id}: its rate must be a positive number of Hz, not {node.work.rate!r}"
            )
        _check_process(node)
        for trigger in node.triggers:
            if trigger.method is not None and trigger.target not in flying:
                raise GraphError(
                    f"{node.id} triggers {trigger.target}.{trigger.method}, but {trigger.target} "
                    f"does not fly: call {trigger.target}.navigate(…), or leave the trigger out"
                )
            if trigger.method is None and trigger.target not in graph.nodes:
                raise GraphError(f"{node.id} wakes {trigger.target}, which is not in its graph")
    _check_names("runtime_env", config.runtime_env, graph)


def _check_process(node: Node) -> None:
    process, name = node.work.process, type(node.work).__name__
    if hasattr(node.work, "postprocess"):
        return  # an endpoint's, whose parts are called instead
    if getattr(process, "__func__", None) is Analytics.process:
        raise GraphError(f"{name} ({node.id}) has no process(self, item, context), so does nothing")
    try:
        inspect.signature(process).bind(None, None)
    except TypeError as error:
        raise GraphError(
            f"{name} ({node.id}): process must take an item and a context, as in "
            f"process(self, item, context): {error}"
        ) from None


def check_places(graph: Graph, compute: Collection[str]) -> None:
    """Check that no analysis is deployed on a simulated resource.

    Args:
        graph: The graph.
        compute: Ids of the resources that analyses may be deployed on.

    Raises:
        GraphError: If an analysis is on another resource.
    """
    for node in graph.nodes.values():
        if node.compute is not None and node.compute not in compute:
            raise GraphError(
                f"{node.id} is deployed on {node.compute}, which is simulated: it is there with "
                "--speed max alone, if simulation.execution_times is set and an analytics "
                "scheduler sends tasks there; deploy it on an edge"
            )


def check_tasks(graph: Graph, config: EnvironmentConfig) -> None:
    """Check the analyses that tasks and tenants name.

    A file shared by several applications may name the analyses that ship with the project.

    Args:
        graph: The graph.
        config: The environment, whose `schedulers` name them.

    Raises:
        UnknownIdError: If an analysis is unknown, so that the task or tenant would have no effect.
    """
    from aerodaas import analytics  # noqa: PLC0415 - loads its modules on access

    shipped = {snake_case(name).removesuffix("_analytics") for name in dir(analytics)}
    told = [name for name in config.schedulers.tasks if name not in shipped]
    _check_names("schedulers.tasks", told, graph)
    for tenant, one in config.schedulers.tenants.items():
        told = [name for name in one.analyses if name not in shipped]
        _check_names(f"schedulers.tenants.{tenant}", told, graph)


def _check_names(section: str, told: Iterable[str], graph: Graph) -> None:
    known = [node.id for node in graph.nodes.values() if node.kind != "sensor"]
    for name in told:
        find_scoped(f"analysis (under {section})", name, known)


def _check_settings(kind: PluginKind, name: str, settings: dict[str, Any], place: str) -> None:
    model = settings_model(kind, name)
    if model is not None:
        checked(model, settings, f"{place}: settings")


def _check_actuators(robot: RobotConfig, place: str) -> None:
    """Raise ConfigError for actuators that the driver, or this installation, cannot move."""
    if not robot.actuators:
        return
    service("actuators.objection")
    known: Collection[str] = getattr(load_plugin("drivers", robot.driver), "actuator_types", ())
    for number, one in enumerate(robot.actuators):
        if one.type not in known:
            movable = f"it moves {', '.join(sorted(known))}" if known else "it moves none"
            raise ConfigError(
                f"{place}: actuators.{number} ({one.id}): the driver {robot.driver!r} cannot move "
                f"a {one.type}: {movable}"
            )


def sensor_properties(config: EnvironmentConfig, sensor: SensorConfig) -> dict[str, Any]:
    """Properties of a sensor by name; the settings of a camera's driver with their defaults.

    Args:
        config: The environment.
        sensor: One of its sensors.

    Raises:
        ConfigError: If a setting is invalid.
    """
    driver, settings = sensor.driver or "", sensor.settings
    if sensor.type == "camera":
        driver = config.camera_driver(sensor)
        model = settings_model("cameras", driver)
        if model is not None:
            place = f"sensor {sensor.full_id}: settings"
            settings = dict(checked(model, settings, place).model_dump())
    settings = {name: _told(value) for name, value in settings.items()}
    own = {"id": sensor.id, "type": sensor.type, "rate": sensor.rate, "robot": sensor.robot or ""}
    return {**own, "driver": driver, **settings}


def _told(value: object) -> object:
    """A property; a path or URL without its secrets."""
    return str(value) if isinstance(value, SecretUrl) else value


def _require_methods(
    kind: PluginKind, name: str, methods: Iterable[str], place: str, hint: str = ""
) -> None:
    plugin = load_plugin(kind, name)
    what = f"{place}: driver {name!r}"
    if not callable(plugin):
        raise ConfigError(f"{what} is no class but {plugin!r}{hint}")
    # The type of a factory function's result is unknown before the call.
    missing = [one for one in methods if isinstance(plugin, type) and not hasattr(plugin, one)]
    if missing:
        kinds = kind.removesuffix("s").replace("driver", "vehicle")
        raise ConfigError(f"{what} is no {kinds}, for it has no {', '.join(missing)}{hint}")


def _check_path(sensor: SensorConfig) -> None:
    path = str(plain(sensor.settings.get("path") or ""))
    if "://" in path or Path(path).exists():
        return
    beside = Path(path).parent
    names = [one.name for one in beside.iterdir()] if beside.is_dir() else []
    raise ConfigError(
        f"sensor {sensor.full_id}: settings.path: there is no {shown_text(path)}"
        f"{near(Path(path).name, names[:_NAMED])}"
    )


def check_served(option: str, address: str | None) -> None:
    """Check the address of a server.

    Args:
        option: Option that gives it, for the error.
        address: host:port; None is valid.

    Raises:
        ConfigError: If the address is malformed.
    """
    if address is None:
        return
    host, _, port = address.rpartition(":")
    if not host or not port.isdigit() or int(port) > _LAST_PORT:
        raise ConfigError(f"{option} takes host:port, such as 127.0.0.1:8765, not {address!r}")


def _is_rate(rate: object) -> bool:
    return isinstance(rate, int | float) and math.isfinite(rate) and rate > 0
