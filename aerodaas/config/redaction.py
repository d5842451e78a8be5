"""What others may know of an environment: for its fleet's users, and for recordings.

A catalogue has geometry, limits and calibration, and no way in: addresses, paths, nodes, drivers
and their settings, plug-ins, packages and secrets are left out.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any

from aerodaas.config.model import ComputeConfig, EnvironmentConfig, SensorConfig
from aerodaas.config.plugins import PluginKind, settings_model
from aerodaas.config.secrets import HIDDEN, shown

__all__ = ["calibration", "catalogue", "public_document"]


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


_CALIBRATION = (
    *("width", "height", "horizontal_fov", "mount", "pitch", "yaw", "depth_range"),
    *("gimbal", "photo_interval", "zoom"),
)
_NOWHERE = "http://{}.invalid"
"""An address that leads nowhere, for whatever has one at its owner's (RFC 2606, section 2)."""


def calibration(sensor: SensorConfig) -> dict[str, Any]:
    """Settings of a sensor that anybody may know, and that a simulated twin of it has as well."""
    return {key: sensor.settings[key] for key in _CALIBRATION if key in sensor.settings}


def catalogue(config: EnvironmentConfig) -> EnvironmentConfig:
    """The environment that users build their applications against.

    It has all robots, sensors and compute resources, and compiles to the same mission documents.
    The `path` of a sensor that is no camera, such as the log of a GPS logger, and the address of
    an endpoint stand in it as words that name the setting and lead nowhere. A camera without a
    source of pictures is left out.
    """
    whole = config.model_dump(mode="json", by_alias=True)
    ids = {"start", "start_yaw", "limits", "mission", "id"}

    def shown(sensors: Iterable[SensorConfig]) -> list[dict[str, Any]]:
        return [_sensor(one) for one in sensors if one.type != "camera" or config.has_pictures(one)]

    robots = [
        {key: value for key, value in one.items() if key in ids} | {"sensors": shown(robot.sensors)}
        for one, robot in zip(whole["robots"], config.robots, strict=True)
    ]
    return EnvironmentConfig.model_validate(
        {
            "name": config.name,
            "home": whole["home"],
            "robots": robots,
            "sensors": shown(config.sensors),
            "compute": "auto"
            if config.compute == "auto"
            else [_resource(one) for one in config.compute],
        }
    )


def _sensor(sensor: SensorConfig) -> dict[str, Any]:
    settings = calibration(sensor)
    camera = sensor.type == "camera"
    if not camera and sensor.settings.get("path"):
        settings["path"] = _NOWHERE.format(f"{sensor.full_id.replace('/', '-')}.path")
    return {
        "id": sensor.id,
        "type": sensor.type,
        "rate": sensor.rate,
        "driver": "simulated" if camera else None,
        "settings": settings,
    }


def _resource(resource: ComputeConfig) -> dict[str, Any]:
    content: dict[str, Any] = {"id": resource.id, "kind": resource.kind}
    if resource.endpoint is not None:
        models = {name: name for name in resource.endpoint.models}
        protocol = resource.endpoint.protocol
        url = _NOWHERE.format(resource.id)
        content["endpoint"] = {"url": url, "protocol": protocol, "models": models}
    return content
