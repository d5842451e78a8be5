"""A whole application, actors and all, on an emulated autopilot: only the driver differs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from emulated import LOOPBACK, free_port
from flying import Flyer, hop, robot

from aerodaas import Environment
from aerodaas.messages.mission import MissionState
from tools.mavlink_vehicle import AutopilotOptions, EmulatedAutopilot

pytestmark = [pytest.mark.slow, pytest.mark.wall_clock]


def test_a_waypoint_mission(flyer: Flyer) -> None:
    """Connect, take off, visit, come back, land; recorded as any other flight."""
    port = free_port()
    settings = {"url": f"udpin:{LOOPBACK}:{port}"}
    content: dict[str, Any] = {
        "name": "field",
        "robots": [robot(driver="mavlink", settings=settings)],
        "compute": [{"id": "edge", "kind": "edge"}],
    }
    with EmulatedAutopilot(AutopilotOptions(family="ardupilot", peer=(LOOPBACK, port))) as vehicle:

        def build(environment: Environment) -> None:
            environment.get_robot_by_id("drone").navigate(hop((4, 0), (4, 4), hover=1.0))

        run = flyer.fly(build, content)
        home = vehicle.truth.position
        motions = vehicle.firmware.motions
    assert run.state is not None
    status = run.state.robots["drone"].mission
    assert status.state is MissionState.LANDED
    assert status.visited == ("wp0", "wp1")
    assert motions[:3] == ["arm", "take off", "follow"]
    assert float(np.linalg.norm(home)) < 1.0
