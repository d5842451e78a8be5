"""What others may know of an environment: geometry, limits and calibration, and no way in.

Addresses, paths, nodes, drivers and their settings, plug-ins, packages and secrets are left out.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from aerodaas.config.model import ComputeConfig, EnvironmentConfig, SensorConfig

__all__ = ["calibration", "catalogue"]

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
