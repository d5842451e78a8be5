"""One robot of an environment file, connected, for the commands that ask its vehicle."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from aerodaas.errors import UnknownIdError

if TYPE_CHECKING:
    from aerodaas.config.model import RobotConfig
    from aerodaas.messages.vehicle import Vehicle

__all__ = ["connected_robot"]

_CONNECTING = 10.0
"""Wall seconds for a vehicle to answer."""


@contextmanager
def connected_robot(
    name: str, file: Path, settings: Iterable[str]
) -> Iterator[tuple[Vehicle, RobotConfig]]:
    """Connect the robot `name` of an environment file for the length of a `with`, to look at it.

    Nothing is changed at the vehicle, whatever a flight would set there, and no video is asked for.

    Args:
        name: Its id.
        file: The environment file.
        settings: `id.setting=value`, laid over the file.

    Raises:
        ConfigError: For a file or a setting that is wrong.
        UnknownIdError: If the file has no such robot.
        VehicleError: If the vehicle does not answer.
    """
    from aerodaas.config.overrides import parse_setting  # noqa: PLC0415 - slow to load
    from aerodaas.drivers.loading import load_vehicle  # noqa: PLC0415 - as above
    from aerodaas.environment.environment import Environment  # noqa: PLC0415 - as above

    overrides = dict(parse_setting(text) for text in settings)
    config = Environment(file.resolve(), overrides=overrides).config
    robots = {one.id: one for one in config.robots}
    if name not in robots:
        raise UnknownIdError("robot", name, list(robots))
    robot = robots[name]
    seen = robot.model_copy(update={"sensors": ()})
    with closing(load_vehicle(seen, config, observing=True)) as vehicle:
        vehicle.connect(_CONNECTING)
        yield vehicle, robot
