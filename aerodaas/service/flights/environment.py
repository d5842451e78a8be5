"""Environment of one flight: the provider's, narrowed by the tenant's limits and the lease.

Each limit is the lowest of those given, and the fence is the intersection of the provider's with
the lease's area. Nothing of the provider's is ever widened; what cannot be narrowed so is refused.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any, TypeAlias

import shapely

from aerodaas.config.checked import checked, near
from aerodaas.config.model import (
    EnvironmentConfig,
    GeofenceConfig,
    RobotConfig,
    SensorConfig,
    validated,
)
from aerodaas.config.overrides import located
from aerodaas.config.redaction import calibration
from aerodaas.config.sections.actuators import permitted
from aerodaas.config.sections.preflight import PreflightConfig
from aerodaas.errors import ConfigError
from aerodaas.mission.safety.geofence import Geofence
from aerodaas.service.flights.orders import FlightOrder, TenantLimits
from aerodaas.service.flights.shared_camera import attached_config
from aerodaas.simulation.airframe import GRAVITY, Airframe
from aerodaas.simulation.battery import flight_power

__all__ = ["Outline", "environment_of", "limited", "rehearsal_config"]

Outline: TypeAlias = Sequence[tuple[float, float]]
"""A polygon's corners (east, north) in metres of the provider's local frame."""
_INSET = 1e-6
"""Metres by which an intersection is drawn in, so that rounding does not widen it."""
_CORNERS = 3


def limited(
    config: EnvironmentConfig,
    robots: Collection[str],
    *,
    tenant: TenantLimits,
    area: Outline | None,
    actuators: Collection[str] = (),
) -> EnvironmentConfig:
    """The environment of one flight.

    Args:
        config: The provider's environment.
        robots: Robots of the lease, by id; all others are left out.
        tenant: Limits of the tenant.
        area: Area of the lease; None for the provider's fence alone.
        actuators: Those that the tenant may move, as `robot/actuator`; all others are left out, and
            so is every parachute.

    Raises:
        ConfigError: For an unknown robot, an area that crosses itself, a fence that is left
            empty, in several parts or without a robot's start, and a take-off that climbs
            higher than the tenant may fly.
    """
    known = {robot.id: robot for robot in config.robots}
    for name in robots:
        if name not in known:
            raise ConfigError(f"this provider has no robot {name}{near(name, known)}")
    wanted = None if area is None else _polygon(area)
    kept = [_limited(robot, tenant, wanted) for robot in config.robots if robot.id in robots]
    content = config.model_dump(by_alias=True)
    content["robots"] = [
        robot.model_dump()
        | {"actuators": [a.model_dump() for a in permitted(robot.id, robot.actuators, actuators)]}
        for robot in kept
    ]
    return validated(content, "the limits of this flight")


def _limited(robot: RobotConfig, tenant: TenantLimits, area: shapely.Polygon | None) -> RobotConfig:
    limits, fence = robot.limits, robot.limits.geofence
    ceiling = _least(fence.ceiling, tenant.max_height)
    if limits.takeoff_height > ceiling:
        raise ConfigError(
            f"{robot.id}: its take-off climbs to {limits.takeoff_height:g} m, and the tenant may "
            f"fly up to {ceiling:g} m: raise the tenant's max_height, or fly another robot"
        )
    changes: dict[str, object] = {"ceiling": ceiling}
    if area is not None:
        changes["polygon"] = _intersection(robot, area)
    speed = _least(limits.max_speed, tenant.max_speed)
    narrowed = limits.model_copy(
        update={
            "cruise_speed": min(limits.cruise_speed, speed),
            "max_speed": speed,
            "max_climb": _least(limits.max_climb, tenant.max_speed),
            "geofence": fence.model_copy(update=changes),
        }
    )
    return robot.model_copy(update={"limits": narrowed})


def _least(limit: float, further: float | None) -> float:
    return limit if further is None else min(limit, further)


def _polygon(area: Outline) -> shapely.Polygon:
    polygon = shapely.Polygon(area) if len(area) >= _CORNERS else shapely.Polygon()
    if not polygon.is_valid or polygon.area <= 0.0:
        raise ConfigError(
            "the lease's area encloses nothing or crosses itself: "
            f"{shapely.is_valid_reason(polygon)}; name its corners in their order"
        )
    return polygon


def _intersection(robot: RobotConfig, area: shapely.Polygon) -> list[tuple[float, float]]:
    """Corners of the robot's fence within the lease's area; raises ConfigError if unfit."""
    given = robot.limits.geofence
    fence = shapely.Polygon(given.polygon) if given.polygon else None
    if fence is not None and not fence.is_valid:
        Geofence(given)  # which says what is wrong with it
    if fence is not None and shapely.covers(area, fence):
        return given.polygon
    common = area if fence is None else shapely.intersection(fence, area)
    if fence is not None:
        common = common.buffer(-_INSET, join_style="mitre")
    parts = [part for part in shapely.get_parts(common) if part.area > 0.0]
    if len(parts) != 1:
        what = f"lies in {len(parts)} parts within it" if parts else "lies outside it"
        raise ConfigError(
            f"{robot.id}: the lease's area {what}, the fence of {_extent(fence)}: lease one area "
            "that lies within the fence"
        )
    corners = [(float(x), float(y)) for x, y in shapely.get_coordinates(parts[0])[:-1]]
    _check(robot, given.model_copy(update={"polygon": corners}))
    return corners


def _check(robot: RobotConfig, narrowed: GeofenceConfig) -> None:
    """Raise ConfigError for a fence without the robot's start, or wider than the provider's."""
    try:
        inside = Geofence(narrowed)
    except ConfigError as error:
        raise ConfigError(f"{robot.id}: within the lease's area, {error}") from None
    east, north, _ = robot.start
    start = shapely.Point(east, north)
    if inside.area is None or inside.inner is None or not shapely.covers(inside.area, start):
        raise ConfigError(
            f"{robot.id} stands at ({east:g}, {north:g}), outside the lease's area: lease one that "
            "holds its start and the way to it"
        )
    outer = Geofence(robot.limits.geofence).inner
    # A corner of the area upon one of the fence's may leave less to its mitred margin.
    if outer is not None and inside.inner.difference(outer).area > _INSET:
        raise ConfigError(
            f"{robot.id}: a corner of the lease's area touches one of the fence or of a no-fly "
            "zone, and the margin there would shrink: move it by a metre"
        )


def _extent(fence: shapely.Polygon | None) -> str:
    if fence is None:
        return "this robot"
    west, south, east, north = fence.bounds
    return f"{west:g} to {east:g} m east and {south:g} to {north:g} m north"


_CELL_VOLTS = 3.9
"""Mean open-circuit voltage of the simulated battery's cells between full and their knee."""
_HOUR = 3600.0


def rehearsal_config(
    config: EnvironmentConfig, battery: Mapping[str, float], seed: int | None = None
) -> EnvironmentConfig:
    """Copy of an environment with every driver and camera simulated.

    Limits, fences, starts, the world and its wind stay as they are. A robot with a driver of its
    own becomes a simulated drone whose full battery hovers for the `endurance` of its limits, and
    which need not know what only the vehicle can tell: `require` before take-off is `refuse` there.

    Args:
        config: Environment of the flight, see `aerodaas.service.flights.environment.limited`.
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


def environment_of(order: FlightOrder) -> EnvironmentConfig:
    """The environment of a flight; raises ConfigError where the limits leave no room for it."""
    whole = located(EnvironmentConfig.load(order.fleet), order.fleet.parent)
    if order.attached is not None:
        return attached_config(whole, order.attached, order.mission)
    config = limited(
        whole,
        order.robots,
        tenant=order.limits,
        area=order.area,
        actuators=order.actuators,
    )
    return rehearsal_config(config, order.battery, order.seed) if order.rehearsal else config
