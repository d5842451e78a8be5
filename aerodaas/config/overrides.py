"""Overrides of an environment file's settings: `camera.rate=5`, `simulation.seed=3`."""

from __future__ import annotations

import copy
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from aerodaas.config.model import EnvironmentConfig, SensorConfig, validated
from aerodaas.errors import AmbiguousIdError, ConfigError, UnknownIdError
from aerodaas.text.json_text import parse_json

__all__ = ["located", "overridden", "parse_setting"]

_FILES = ("path", "signing_key")
"""Settings of cameras and drivers that name a file."""


def parse_setting(text: str) -> tuple[str, Any]:
    """Split `id.setting=value`; the value is JSON, or else a string. Raises ConfigError."""
    name, equals, value = text.partition("=")
    if not equals or "." not in name:
        # The value may be a secret.
        raise ConfigError(f"a setting is written id.setting=value, not {name + equals!r}…")
    try:
        json.loads(value)
    except (ValueError, RecursionError):
        return name, value
    return name, parse_json(value, name)


def overridden(config: EnvironmentConfig, settings: Mapping[str, Any]) -> EnvironmentConfig:
    """Return an environment with settings laid over it.

    The part of a name before the first dot is the id of a robot, a sensor (or `robot/sensor`) or a
    compute resource, or a section of the file such as `simulation`. Parts with ambiguous ids are
    named `robots/…`, `sensors/…` or `compute/…`.

    Args:
        config: The environment.
        settings: Values by dotted name.

    Raises:
        ConfigError: For an unknown setting.
        UnknownIdError: For an unknown id.
        AmbiguousIdError: For an id that fits several.
    """
    if not settings:
        return config
    content = config.model_dump(by_alias=True)
    for name, value in settings.items():
        owner, _, path = name.partition(".")
        _assign(_find(content, owner), path.split("."), copy.deepcopy(value))
    return validated(content, "environment with overrides")


def located(config: EnvironmentConfig, folder: Path) -> EnvironmentConfig:
    """Return an environment with the relative paths in its settings made absolute.

    Actors have other working directories than the application. A path to no file stays as it is.

    Args:
        config: The environment.
        folder: Folder that paths are relative to, or else the working directory.
    """
    content = config.model_dump(by_alias=True)
    places: list[dict[str, Any]] = [*content["robots"], *content["sensors"]]
    places += [sensor for robot in content["robots"] for sensor in robot["sensors"]]
    for settings in (place["settings"] for place in places):
        for name in _FILES:
            if isinstance(settings.get(name), str):
                settings[name] = _absolute(settings[name], folder)
    for env in content["runtime_env"].values():
        env["packages"] = [
            _absolute(package, folder) if package.endswith(".whl") else package
            for package in env["packages"]
        ]
    if content["terrain"] is not None:
        files = content["terrain"]["files"]
        content["terrain"]["files"] = [_absolute(file, folder) for file in files]
    if config.map_tiles is not None and config.map_tiles.file is not None:
        content["map_tiles"]["url"] = _absolute(content["map_tiles"]["url"], folder)
    if content["simulation"]["world"].endswith(".json"):
        content["simulation"]["world"] = _absolute(content["simulation"]["world"], folder)
    content["simulation"]["network"] = "+".join(
        f"trace:{_absolute(part.removeprefix('trace:'), folder)}"
        if part.startswith("trace:")
        else part
        for part in content["simulation"]["network"].split("+")
    )
    return validated(content, "environment")


def _absolute(path: str, folder: Path) -> str:
    for place in (folder / path, Path(path)):
        if os.path.exists(place):  # noqa: PTH110 - Path.exists raises for a name too long
            return str(place.resolve())
    return path


def _find(content: dict[str, Any], owner: str) -> dict[str, Any]:
    places = _places(content)
    section = content.get(owner)
    if isinstance(section, dict):
        places[owner] = section
    fitting = [name for name in places if owner in {name, *_shorter(name, places[name])}]
    if len(fitting) > 1:
        raise AmbiguousIdError("part of the environment", owner, fitting)
    if fitting:
        return places[fitting[0]]
    known = sorted(places[name].get("id", name) for name in places)
    raise UnknownIdError("robot, sensor, compute resource or section", owner, known)


def _places(content: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """The objects with an id, by unique names."""
    compute = [] if content["compute"] == "auto" else content["compute"]
    sections = {"robots": content["robots"], "sensors": content["sensors"], "compute": compute}
    places = {
        f"{section}/{place['id']}": place for section, many in sections.items() for place in many
    }
    for robot in content["robots"]:
        for sensor in robot["sensors"]:
            places[f"robots/{robot['id']}/{sensor['id']}"] = sensor
    return places


def _shorter(name: str, place: dict[str, Any]) -> list[str]:
    """Other names of a part: its id, and that with its robot's."""
    return [name.partition("/")[2], str(place["id"])] if "id" in place else []


def _assign(place: dict[str, Any], path: list[str], value: Any) -> None:  # noqa: ANN401
    for key in path[:-1]:
        place = place.setdefault(key, {})
    if path[-1] not in place and "settings" in place and path[-1] not in SensorConfig.model_fields:
        place = place["settings"]
    place[path[-1]] = value
