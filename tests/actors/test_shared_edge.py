"""A flight on an edge that others use, too: its tasks start in its turns, and all of them end."""

from __future__ import annotations

import tempfile
import threading
import time
from pathlib import Path

import pytest
from flying import Flyer, hop, robot

from aerodaas import Environment
from aerodaas.actors.dispatch.edge_turns import EdgeTurns
from aerodaas.analytics import SyntheticAnalytics
from aerodaas.config.options import EdgeShare
from aerodaas.service.edge import EdgeArbiter

pytestmark = [pytest.mark.slow, pytest.mark.wall_clock]

_TASK = 0.1
"""Seconds of a task, of which each of two flights asks for ten a second."""
_CAMERA = {"driver": "simulated", "settings": {"width": 64, "height": 36}}


class Neighbour:
    """Another tenant that always has work."""

    def __init__(self, path: Path) -> None:
        self.worked = 0.0
        self._over = threading.Event()
        self._turns = EdgeTurns(EdgeShare(path, "neighbour"), lambda: None)
        self._thread = threading.Thread(target=self._work, daemon=True)
        self._thread.start()

    def _work(self) -> None:
        self._turns.ask()
        while not self._over.is_set():
            if not self._turns.granted:
                time.sleep(0.002)
                continue
            self._turns.used, began = True, time.monotonic()
            time.sleep(_TASK)
            self.worked += time.monotonic() - began
            self._turns.release(again=True)

    def close(self) -> None:
        """Stop."""
        self._over.set()
        self._thread.join()
        self._turns.close()


def test_a_flight_works_in_its_turns(flyer: Flyer) -> None:
    """Two that ask for all of the edge have half each, and its scheduler goes on as it was."""

    def build(env: Environment) -> None:
        env.set_analytics_scheduler("dems")
        drone = env.get_robot_by_id("drone")
        model = SyntheticAnalytics("model", 1000 * _TASK, 0.0)
        model.deploy(env.get_compute_resource_by_id("edge"))
        model.analyse(drone.get_sensor_by_id("camera").get_data_stream())
        drone.navigate(hop((1, 0), hover=600))

    task = {"benefit": 10, "edge_time": 1000 * _TASK, "deadline": 1000}
    content = {
        "robots": [robot(sensors=[{"id": "camera", "rate": 10.0, **_CAMERA}])],
        "compute": [{"id": "edge"}],
        "schedulers": {"tasks": {"model": task}},
        "recording": {"images": "none"},
        "simulation": {"world": "empty"},
    }
    with tempfile.TemporaryDirectory(prefix="edge-", dir="/tmp") as folder:
        path = Path(folder) / "edge"
        arbiter = EdgeArbiter(path, 1)
        arbiter.start()
        neighbour = Neighbour(path)
        share = EdgeShare(path, "flight")
        with flyer.flying(build, content, speed=1.0, edge=share) as env:
            while not done(env):
                time.sleep(0.1)
            before, worked, began = done(env), neighbour.worked, time.monotonic()
            time.sleep(5.0)
            took = time.monotonic() - began
            own, others = (done(env) - before) * _TASK, neighbour.worked - worked
            values = env.launch().reports()["dispatcher"].values
            env.get_robot_by_id("drone").end_mission()
        neighbour.close()
        arbiter.close()
    assert own + others < 1.2 * took, "two ran at once"
    assert 0.5 < own / others < 2.0
    assert not values["replaced"]


def done(env: Environment) -> int:
    """Tasks of the flight that have ended on the edge."""
    run = env.launch()
    run.poll()
    return int(run.reports()["dispatcher"].values["places"].get("edge", 0))
