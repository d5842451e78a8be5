"""Robots whose vehicles are on one link: which they are, and what keeps them from sharing it."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

from aerodaas.config.model import RobotConfig
from aerodaas.drivers.mavlink.settings import MavlinkSettings, mavlink_settings
from aerodaas.errors import ConfigError

__all__ = ["check_links", "link_of"]

_RELIES = {"require", "set"}
"""Settings of `fallback` with which the vehicle must notice our silence."""


def link_of(robot: RobotConfig) -> str:
    """Name of the link of `robot`: it is one connection of one process for all that are on it."""
    kind, _, rest = mavlink_settings(robot).url.partition(":")
    # One device cannot be read at two speeds.
    return f"serial:{rest.rpartition(':')[0]}" if kind == "serial" else f"{kind}:{rest}"


def check_links(robots: Sequence[RobotConfig]) -> None:
    """Raise ConfigError for two of `robots` that cannot be told apart on a link they share."""
    links: dict[str, list[RobotConfig]] = {}
    for robot in robots:
        links.setdefault(link_of(robot), []).append(robot)
    for sharing in links.values():
        for one, other in combinations(sharing, 2):
            _check_pair(one.id, mavlink_settings(one), other.id, mavlink_settings(other))


def _check_pair(one: str, ours: MavlinkSettings, other: str, theirs: MavlinkSettings) -> None:
    both = f"robots {one} and {other} share the link {ours.url}"
    if ours.url != theirs.url:
        raise ConfigError(f"{both}, but {other} says {theirs.url}: one device has one speed")
    for name, settings in ((one, ours), (other, theirs)):
        if settings.system is None:
            raise ConfigError(f'{both}: robot {name} needs the "system" id of its vehicle there')
    if ours.system == theirs.system:
        raise ConfigError(
            f'{both} and the "system" id {ours.system}: give each vehicle one of its own '
            "(ArduPilot: MAV_SYSID, before 4.7 SYSID_THISMAV; PX4: MAV_SYS_ID)"
        )
    if ours.own_system == theirs.own_system and _RELIES & {ours.fallback, theirs.fallback}:
        raise ConfigError(
            f'{both}: with "fallback" each needs an "own_system" of its own, such as 245 and 242: '
            "else a vehicle that has lost us would hear our heartbeats for the other"
        )
    if ours.forward is not None and ours.forward == theirs.forward:
        raise ConfigError(
            f'{both}: "forward" of one of them passes on what all say there; take it from {other}'
        )
    if None not in {ours.corrections, theirs.corrections}:
        raise ConfigError(
            f'{both}: "corrections" of one of them are passed on to all; take them from {other}'
        )
