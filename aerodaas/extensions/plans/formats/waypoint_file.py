"""Mission Planner's `.waypoints` files: QGC WPL 110, a line of fields for each item."""

from __future__ import annotations

from collections.abc import Iterator

from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.errors import ConfigError
from aerodaas.extensions.plans.commands import (
    FRAME_ABOVE_SEA,
    command_name,
)
from aerodaas.extensions.plans.formats.numbers import finite
from aerodaas.extensions.plans.plan import MOST_ITEMS, Plan, PlanHome, PlanItem

__all__ = ["HEADER", "parse_waypoint_file"]

HEADER = "QGC WPL 110"
_FIELDS = 12
_LONGEST = 40
"""Most characters of a number."""


def parse_waypoint_file(text: str) -> Plan:
    """Read the text of a `.waypoints` file; its item 0 is home.

    Raises:
        ConfigError: If it is none, it has no home, or a line does not hold what it should.
    """
    first, *lines = text.lstrip("\ufeff").splitlines() or [""]
    if first.strip() != HEADER:
        raise ConfigError(f"its first line is not {HEADER!r}: save it again as that")
    items = list(_items(lines))
    if not items:
        raise ConfigError("it holds no items, not even number 0, which is home: save it again")
    first_item = items[0]
    if (first_item.command, first_item.frame) != (mavlink.MAV_CMD_NAV_WAYPOINT, FRAME_ABOVE_SEA):
        raise ConfigError(
            f"its item 0 must be home, command 16 in frame {FRAME_ABOVE_SEA}, but is "
            f"{command_name(first_item.command)} in frame {first_item.frame}: put a line for home "
            "before it, and number the others from 1"
        )
    home = PlanHome.given(first_item.x, first_item.y, first_item.z)
    return Plan(tuple(items[1:]), home=home, ardupilot=True)


def _items(lines: list[str]) -> Iterator[PlanItem]:
    expected = 0
    for row, line in enumerate(lines, start=2):
        if not line.strip() or line.startswith("#"):
            continue
        if expected > MOST_ITEMS:
            raise ConfigError(f"has more than {MOST_ITEMS} items: split it")
        where = f"line {row}"
        fields = line.split()
        if len(fields) != _FIELDS:
            raise ConfigError(f"{where} has {len(fields)} fields, not {_FIELDS}")
        number = _whole(fields[0], f"{where}: number")
        if number != expected:
            raise ConfigError(f"{where} is item {number}, not {expected}: number them in order")
        first, second, third, fourth, x, y, z = (
            _number(field, f"{where}: field {index}")
            for index, field in enumerate(fields[4:11], start=5)
        )
        yield PlanItem(
            number,
            _whole(fields[3], f"{where}: command"),
            _whole(fields[2], f"{where}: frame"),
            (first, second, third, fourth),
            x,
            y,
            z,
            _whole(fields[11], f"{where}: autocontinue") != 0,
        )
        expected += 1


def _whole(text: str, what: str) -> int:
    # Not `isdigit`, which takes the digits of every script.
    if len(text) > _LONGEST or not text.isascii() or not text.isdigit():
        raise ConfigError(f"{what} must be a whole number, not {text[:_LONGEST]!r}")
    return int(text)


def _number(text: str, what: str) -> float:
    try:
        value = float(text) if len(text) <= _LONGEST and "_" not in text else None
    except ValueError:
        value = None
    if value is None:
        raise ConfigError(f"{what} must be a number, not {text[:_LONGEST]!r}")
    return finite(value, what)
