"""Rehearsals flown in simulated time, for tests of their verdicts."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from flying import Flyer, hop, robot

from aerodaas import (
    AeroNavigation,
    Environment,
    NavigableAnalytics,
    NavigationType,
    VelocityCommand,
)
from aerodaas.analytics.base import Context
from aerodaas.config.model import EnvironmentConfig, validated
from aerodaas.errors import MissionError
from aerodaas.messages.odometry import Odometry
from aerodaas.service.flights.environment import rehearsal_config

__all__ = ["FIELD", "Eastwards", "Rehearsal", "rehearse", "survey", "to_the_east"]

FIELD: dict[str, Any] = {
    "name": "field",
    "robots": [robot(start=[0, 0, 0])],
    "compute": [{"id": "edge", "kind": "edge"}],
    "simulation": {"world": "empty"},
}
"""One drone in still air."""


@dataclass(frozen=True)
class Rehearsal:
    """A flown rehearsal."""

    recording: Path
    config: EnvironmentConfig


class Eastwards(NavigableAnalytics):
    """Steers east for ten seconds, whatever lies there."""

    accepts: ClassVar[tuple[type, ...]] = (Odometry,)

    def process(self, item: Odometry, context: Context) -> AeroNavigation:
        """Two metres a second."""
        del item
        steering = context.now() < 15_000_000_000
        commands = [VelocityCommand(2.0, 0.0, 0.0, 0.0)] if steering else []
        return AeroNavigation(NavigationType.ANALYTICS_DRIVEN, commands)


def survey(env: Environment) -> None:
    """Two waypoints."""
    env.get_robot_by_id("drone").navigate(hop((6, 0), (6, 6)))


def to_the_east(env: Environment) -> None:
    """Steered by an analysis."""
    drone = env.get_robot_by_id("drone")
    odometry = drone.get_sensor_by_id("odom_drone").get_data_stream()
    drone.navigate(Eastwards().analyse(odometry))


def rehearse(
    flyer: Flyer,
    build: Callable[[Environment], object] = survey,
    *,
    limits: Mapping[str, Any] | None = None,
    driver: str = "simulated",
    battery: float = 1.0,
    world: str = "empty",
) -> Rehearsal:
    """Fly the rehearsal of a mission in the field, with further `limits`."""
    drone = {**FIELD["robots"][0], "driver": driver}
    drone["limits"] = {**drone["limits"], **(limits or {})}
    simulation = {"world": world}
    config = validated({**FIELD, "robots": [drone], "simulation": simulation}, "the field")
    config = rehearsal_config(config, {"drone": battery}, seed=5)
    # A flight that fails has a recording, too.
    with contextlib.suppress(MissionError):
        flyer.fly(build, config.model_dump(mode="json", by_alias=True), seed=5)
    return Rehearsal(next(flyer.folder.glob("flight/*.mcap")), config)
