"""A drone's actor in the test's own process, without Ray."""

from __future__ import annotations

import uuid
from pathlib import Path
from typing import Any

from drone_nodes import robot_spec
from flying import robot

from aerodaas.actors.drone.actor import DroneActor
from aerodaas.config.model import EnvironmentConfig
from aerodaas.mission.commands import Command
from aerodaas.runtime.session import Session

__all__ = ["DroneByHand", "drone_by_hand"]


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


def drone_by_hand(
    *initial: Command,
    speed: float,
    navigation: tuple[str, ...] = (),
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
    spec = robot_spec(only, *initial, navigation=navigation)
    session, name = Session(environment, speed, locks=locks), "drone/drone"
    actor = DroneByHand(session, name, (spec,))
    actor.open_here()
    return actor
