"""Environment of a rehearsal: the provider's, with every driver and camera simulated."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from aerodaas.config.checked import checked
from aerodaas.config.model import EnvironmentConfig, RobotConfig, SensorConfig, validated
from aerodaas.config.preflight import PreflightConfig
from aerodaas.config.redaction import calibration
from aerodaas.simulation.airframe import GRAVITY, Airframe
from aerodaas.simulation.battery import flight_power

__all__ = ["rehearsal_config"]

_CELL_VOLTS = 3.9
"""Mean open-circuit voltage of the simulated battery's cells between full and their knee."""
_HOUR = 3600.0


def rehearsal_config(
    config: EnvironmentConfig, battery: Mapping[str, float], seed: int | None = None
) -> EnvironmentConfig:
    """The same environment with every driver and camera simulated.

    Limits, fences, starts, the world and its wind stay as they are. A robot with a driver of its
    own becomes a simulated drone whose full battery hovers for the `endurance` of its limits, and
    which need not know what only the vehicle can tell: `require` before take-off is `refuse` there.

    Args:
        config: Environment of the flight, see `aerodaas.service.limits.limited`.
        battery: Charge at the start by robot, 0 to 1; 1 for a robot that is not named.
        seed: Of wind and noise; None for the environment's own.

    Raises:
        ConfigError: If a charge or the seed is out of range.
    """
    content = config.model_dump(by_alias=True)
    for entry, robot in zip(content["robots"], config.robots, strict=True):
        settings = _airframe(robot)
        if robot.id in battery:
            settings["battery"] = battery[robot.id]
        checked(Airframe, settings, f"the rehearsal of {robot.id}")
        if robot.driver != "simulated":
            entry["preflight"] = _policy(robot.preflight)
        entry |= {"driver": "simulated", "settings": settings}
        entry["sensors"] = [_sensor(sensor) for sensor in robot.sensors]
    content["recording"]["images"] = "none"
    content["sensors"] = [_sensor(sensor) for sensor in config.sensors]
    if seed is not None:
        content["simulation"]["seed"] = seed
    return validated(content, "the rehearsal's environment")


def _airframe(robot: RobotConfig) -> dict[str, Any]:
    if robot.driver == "simulated":
        return dict(robot.settings)
    usual = Airframe()
    hover = flight_power(usual, (0.0, 0.0, GRAVITY), (0.0, 0.0, 0.0))
    hours = robot.limits.endurance / _HOUR
    return {"capacity": hover * hours / (usual.cells * _CELL_VOLTS)}


def _policy(preflight: PreflightConfig) -> dict[str, Any]:
    levels = preflight.model_dump()
    return {name: "refuse" if level == "require" else level for name, level in levels.items()}


def _sensor(sensor: SensorConfig) -> dict[str, Any]:
    content = sensor.model_dump()
    if sensor.type == "camera":
        content |= {"driver": "simulated", "settings": calibration(sensor)}
    return content
