"""The actor that plans: a call that hangs or kills it costs that call only."""

from __future__ import annotations

import os
import time

import pytest

from aerodaas.actors.drone.planner import PlannerExecutor

pytestmark = pytest.mark.wall_clock


@pytest.mark.slow
def test_planner_survives_what_it_is_asked(runtime: None) -> None:  # noqa: ARG001 - needs Ray
    """Results and errors come back; after a hang and a death the next call is answered."""
    with PlannerExecutor(patience=5.0) as planner:
        assert planner.submit(max, 1, 2).result(60) == 2
        with pytest.raises(ValueError, match="invalid literal"):
            planner.submit(int, "no number").result(60)
        for _ in range(2):
            hung = planner.submit(time.sleep, 1000)
            following = planner.submit(max, 1, 2)
            with pytest.raises(RuntimeError, match="took longer than 5 s"):
                hung.result(60)
            assert following.result(60) == 2
            with pytest.raises(RuntimeError, match="died"):
                planner.submit(os._exit, 1).result(60)
            assert planner.submit(max, 1, 2).result(60) == 2
