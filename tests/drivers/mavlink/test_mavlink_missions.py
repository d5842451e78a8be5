"""A whole application, actors and all, on an emulated autopilot: only the driver differs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flying import Flyer, hop, robot
from mavlink_flights import LOOPBACK, free_port
from typer.testing import CliRunner

from aerodaas import Environment
from aerodaas.cli.app import app
from aerodaas.types.status import MissionState
from tools.mavlink_vehicle import AutopilotOptions, EmulatedAutopilot

pytestmark = [pytest.mark.slow, pytest.mark.wall_clock]

APPS = Path(__file__).parents[3] / "apps"


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
    status = run.state.robots["drone"].status
    assert status.state is MissionState.LANDED
    assert status.visited == ("wp0", "wp1")
    assert motions[:3] == ["arm", "take off", "follow"]
    assert float(np.linalg.norm(home)) < 1.0


def test_the_farm_survey_with_its_driver_changed(runtime: None, tmp_path: Path) -> None:  # noqa: ARG001
    """`aerodaas run apps/farm_survey.py --set …`: the application and its file as they are."""
    port = free_port()
    words = [
        *("run", str(APPS / "farm_survey.py"), "--record", str(tmp_path / "flight")),
        *("--set", "quadrotor_base.driver=mavlink"),
        *("--set", f"quadrotor_base.url=udpin:{LOOPBACK}:{port}"),
        *("--set", "quadrotor_base.limits.cruise_speed=2"),
    ]
    with EmulatedAutopilot(AutopilotOptions(family="px4", peer=(LOOPBACK, port))) as vehicle:
        done = CliRunner().invoke(app, words)
        motions = vehicle.firmware.motions
    assert done.exit_code == 0, done.output
    assert motions[:3] == ["arm", "take off", "follow"]
    assert motions[-1] == "land"
