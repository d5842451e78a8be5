"""A robot's vehicle by its driver, to fly it or only to look at it."""

from __future__ import annotations

from collections.abc import Sequence

from aerodaas.config.model import EnvironmentConfig, RobotConfig
from aerodaas.config.plugins import load_plugin
from aerodaas.messages.vehicle import Vehicle

__all__ = ["check_links", "link_of", "load_vehicle"]


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


def link_of(robot: RobotConfig) -> str | None:
    """Name of the link of `robot`, which one process opens for all robots that are on it.

    It is what the driver's class attribute `link_of` makes of the robot; None without one: the
    robot shares no link. Raises the project's errors for an unknown driver and wrong settings.
    """
    name = getattr(load_plugin("drivers", robot.driver), "link_of", None)
    return None if name is None else f"{robot.driver} {name(robot)}"


def check_links(robots: Sequence[RobotConfig]) -> None:
    """Raise ConfigError for robots that cannot be told apart on a link they share.

    Their driver's class attribute `check_links`, if it has one, says so.
    """
    for driver in dict.fromkeys(one.driver for one in robots):
        check = getattr(load_plugin("drivers", driver), "check_links", None)
        if check is not None:
            check([one for one in robots if one.driver == driver])
