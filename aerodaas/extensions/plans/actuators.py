"""Actuators in plans: items that move them, as a waypoint's `actuate`, and back."""

from __future__ import annotations

from collections.abc import Sequence

from aerodaas.config.sections.actuators import (
    ActuatorConfig,
    GripperConfig,
    RelayConfig,
    ServoConfig,
)
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.errors import ConfigError
from aerodaas.extensions.plans.commands import (
    FRAME_MISSION,
)
from aerodaas.extensions.plans.plan import PlanItem

__all__ = ["MOVES", "move_item", "move_of"]

MOVES = frozenset(
    {mavlink.MAV_CMD_DO_GRIPPER, mavlink.MAV_CMD_DO_SET_RELAY, mavlink.MAV_CMD_DO_SET_SERVO}
)
"""Commands that may become a waypoint's `actuate`."""
_GRIPPER = ("release", "grab")
"""Positions by GRIPPER_ACTION."""
_RELAY = ("off", "on")


def move_of(item: PlanItem, actuators: Sequence[ActuatorConfig]) -> tuple[str, str] | str:
    """The move of an actuator that an item of a plan means.

    Args:
        item: Item of one of the commands `MOVES`.
        actuators: Those of the robot.

    Returns:
        Actuator and position; or why there is none, in words.
    """
    number, value = item.values[0], item.values[1]
    for one in actuators:
        positions = _positions(one, item.command)
        if positions is None or _number(one) != number:
            continue
        name = None if value is None else positions.get(value)
        if name is None:
            return f"the actuator {one.id} has no position for {value}"
        return one.id, name
    return "no actuator of the environment has this number; nothing is moved"


def move_item(
    number: int, actuator: str, position: str, actuators: Sequence[ActuatorConfig]
) -> PlanItem:
    """The item by which a plan moves an actuator.

    Args:
        number: Number of the item in the plan.
        actuator: Id of the actuator.
        position: One of its positions.
        actuators: Those of the robot.

    Raises:
        ConfigError: For an actuator or position that is not there.
    """
    for one in actuators:
        for command in MOVES:
            positions = _positions(one, command)
            if one.id == actuator and positions is not None and position in positions.values():
                value = next(key for key, name in positions.items() if name == position)
                values = (float(_number(one)), value, 0.0, 0.0)
                return PlanItem(number, command, FRAME_MISSION, values, 0.0, 0.0, 0.0)
    raise ConfigError(
        f"{actuator}: {position} cannot be written: give the robot's `actuators`, which have it"
    )


def _number(actuator: ActuatorConfig) -> int:
    if isinstance(actuator, ServoConfig):
        return actuator.channel
    return actuator.instance if isinstance(actuator, GripperConfig | RelayConfig) else -1


def _positions(actuator: ActuatorConfig, command: int) -> dict[float, str] | None:
    """Positions by the command's second parameter; None if it is no command for this actuator."""
    if command == mavlink.MAV_CMD_DO_GRIPPER and isinstance(actuator, GripperConfig):
        return {float(index): name for index, name in enumerate(_GRIPPER)}
    if command == mavlink.MAV_CMD_DO_SET_RELAY and isinstance(actuator, RelayConfig):
        return {float(index): name for index, name in enumerate(_RELAY)}
    if command == mavlink.MAV_CMD_DO_SET_SERVO and isinstance(actuator, ServoConfig):
        return {float(pulse): name for name, pulse in actuator.positions.items()}
    return None
