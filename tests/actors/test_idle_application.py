"""What an application that only waits leaves at Ray's head while its drone hovers."""

from __future__ import annotations

import time

import pytest
import ray
from flying import Flyer, hop

from aerodaas import Environment
from aerodaas.messages.mission import MissionState

pytestmark = pytest.mark.wall_clock


def _hover(env: Environment) -> None:
    env.get_robot_by_id("drone").navigate(hop((1, 0), hover=600))


@pytest.mark.slow
def test_rays_head_records_no_call_of_a_flight(flyer: Flyer) -> None:
    """It would keep each with its history; a flight makes several each second."""
    with flyer.flying(_hover, speed=5.0) as env:
        run = env.launch()
        while run.poll().robots["drone"].mission.state is not MissionState.LOITERING:
            time.sleep(0.1)
        run._watch(time.monotonic() + 3.0)  # what the head would keep is sent once a second
        recorded = {str(event["name"]) for event in ray.timeline() or ()}
        assert not recorded & {"robots", "heard", "report", "vitals"}
        env.get_robot_by_id("drone").end_mission()
