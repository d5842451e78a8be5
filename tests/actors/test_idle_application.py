"""What an application that only waits asks of Ray while its drone hovers."""

from __future__ import annotations

import time
from collections import Counter
from typing import Any

import pytest
import ray
from flying import Flyer, hop

from aerodaas import Environment
from aerodaas.messages.mission import MissionState

pytestmark = pytest.mark.wall_clock

_WATCHED = 5.0
"""Seconds of waiting while calls are counted."""


def _hover(env: Environment) -> None:
    env.get_robot_by_id("drone").navigate(hop((1, 0), hover=600))


@pytest.mark.slow
def test_an_idle_application_looks_once_a_second_and_leaves_no_records(
    flyer: Flyer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """While nothing changes it looks about once a second, and Ray's head records no call."""
    from aerodaas.actors.run.flight import Flight  # noqa: PLC0415 - loads ray

    calls: Counter[str] = Counter()

    def count(name: str) -> None:
        plain = getattr(Flight, name)

        def counted(self: Flight, *args: Any) -> Any:  # noqa: ANN401
            calls[name] += 1
            return plain(self, *args)

        monkeypatch.setattr(Flight, name, counted)

    with flyer.flying(_hover, speed=5.0) as env:
        run = env.launch()
        while run.poll().robots["drone"].mission.state is not MissionState.LOITERING:
            time.sleep(0.1)
        count("poll")
        began = time.monotonic()
        run._watch(began + _WATCHED)
        elapsed = time.monotonic() - began
        assert 0 < calls["poll"] <= 1.5 * elapsed + 2, "the heartbeats' included"
        recorded = {str(event["name"]) for event in ray.timeline() or ()}
        assert not recorded & {"robots", "await_change", "heard", "report", "vitals"}
        env.get_robot_by_id("drone").end_mission()
