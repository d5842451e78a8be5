"""The environment as a document for recordings: what may be shown of it, as JSON."""

from __future__ import annotations

import json
from typing import Any

from aerodaas.config.model import EnvironmentConfig, SensorConfig
from aerodaas.config.plugins import PluginKind, settings_model
from aerodaas.config.secrets import HIDDEN, shown

__all__ = ["public_document"]


def public_document(config: EnvironmentConfig) -> str:
    """Return the environment as JSON without its secrets, a valid environment file again.

    Settings of a plug-in are shown as the `settings_model` of its class shows them, so that a
    `SecretStr` of its author's stays hidden; without a model, as `config.secrets.shown` does.
    """
    content = config.model_dump(mode="json", by_alias=True)
    for robot, place in zip(config.robots, content["robots"], strict=True):
        place["settings"] = _shown_settings("drivers", robot.driver, robot.settings)
        for sensor, inner in zip(robot.sensors, place["sensors"], strict=True):
            inner["settings"] = _of_sensor(config, sensor)
    for sensor, place in zip(config.sensors, content["sensors"], strict=True):
        place["settings"] = _of_sensor(config, sensor)
    return json.dumps(content, indent=2)


def _of_sensor(config: EnvironmentConfig, sensor: SensorConfig) -> dict[str, Any]:
    if sensor.type != "camera":
        return dict(shown(sensor.settings))
    return _shown_settings("cameras", config.camera_driver(sensor), sensor.settings)


def _shown_settings(kind: PluginKind, driver: str, settings: dict[str, Any]) -> dict[str, Any]:
    generic = dict(shown(settings))
    try:
        model = settings_model(kind, driver)
        if model is None:
            return generic
        checked = model.model_validate(settings)
        dumped = checked.model_dump(mode="json", by_alias=True, exclude_unset=True)
    except Exception:  # noqa: BLE001 - a plug-in's own code, which may raise anything
        # What cannot be judged may be a secret.
        return dict.fromkeys(generic, HIDDEN)
    return generic | {name: shown(value, name) for name, value in dumped.items()}
