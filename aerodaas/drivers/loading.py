"""A robot's vehicle by its driver, to fly it or only to look at it."""

from __future__ import annotations

from aerodaas.config.model import EnvironmentConfig, RobotConfig
from aerodaas.config.plugins import load_plugin
from aerodaas.types.vehicle import Vehicle

__all__ = ["load_vehicle"]


def load_vehicle(
    robot: RobotConfig, environment: EnvironmentConfig, *, observing: bool = False
) -> Vehicle:
    """The vehicle of `robot` by its driver, not connected yet.

    Args:
        robot: The robot.
        environment: Its environment.
        observing: Whether connecting is to change nothing at the vehicle: by the settings that the
            driver names in its class attribute `observing`, if it has any.

    Raises:
        UnknownIdError: For an unknown driver.
        ConfigError: For one that cannot be imported, and for settings that are wrong.
    """
    driver = load_plugin("drivers", robot.driver)
    if observing:
        settings = {**robot.settings, **getattr(driver, "observing", {})}
        robot = robot.model_copy(update={"settings": settings})
    vehicle: Vehicle = driver(robot, environment)
    return vehicle
