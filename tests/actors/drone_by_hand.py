"""A drone's actor in the test's own process, without Ray."""

from __future__ import annotations

import uuid
from pathlib import Path
from typing import Any

from flying import robot

from aerodaas.actors.drone.actor import DroneActor
from aerodaas.config.model import EnvironmentConfig, RobotConfig
from aerodaas.mission.commands import Command
from aerodaas.runtime.controller import RobotSpec
from aerodaas.runtime.session import Session
from aerodaas.schedulers.trajectory.nearest_neighbor import NearestNeighborScheduler

__all__ = ["DroneByHand", "drone_by_hand", "spec_by_hand"]


class DroneByHand(DroneActor):
    """As Ray would run it, but for its place."""

    @property
    def scope(self) -> str:
        """Prefix of this test's streams."""
        return f"{self.session.id}/here"

    def open_here(self) -> None:
        """What `prepare` does on a node of Ray's."""
        self.publisher(self.alerts.outlet.stream)
        self._open(())
        self._phase = "ready"


class _InThisProcess(NearestNeighborScheduler):
    isolated = False


def spec_by_hand(
    robot: RobotConfig,
    *initial: Command,
    navigation: tuple[str, ...] = (),
    requesters: tuple[str, ...] = (),
) -> RobotSpec:
    """A robot without sensors, whose plans need no process of their own."""
    return RobotSpec(
        robot=robot,
        sensors=(),
        navigation=navigation,
        commands=(),
        requesters=requesters,
        initial=tuple(initial),
        scheduler=_InThisProcess(),
    )


def drone_by_hand(
    *initial: Command,
    speed: float,
    navigation: tuple[str, ...] = (),
    requesters: tuple[str, ...] = (),
    locks: Path | None = None,
    **settings: Any,  # noqa: ANN401
) -> DroneByHand:
    """An actor that flies one simulated robot called `drone` and is ready to start."""
    content = {
        "name": f"by-hand-{uuid.uuid4().hex[:6]}",
        "robots": [robot(sensors=[], **settings)],
        "simulation": {"world": "empty"},
    }
    environment = EnvironmentConfig.model_validate(content)
    (only,) = environment.robots
    spec = spec_by_hand(only, *initial, navigation=navigation, requesters=requesters)
    session, name = Session(environment, speed, locks=locks), "drone/drone"
    actor = DroneByHand(session, name, (spec,))
    actor.open_here()
    return actor
