"""Nodes in actors of their own, stepped by the executor of a flight in simulated time."""

from __future__ import annotations

import os
from pathlib import Path
from typing import ClassVar

import numpy as np
from flying import FLAT, Flyer, hop, recorded, robot

from aerodaas import Analytics, Environment, Odometry
from aerodaas.analytics.base import Context
from aerodaas.environment.run import Run
from aerodaas.messages.frames import Header
from aerodaas.messages.readings import Alert, Readings
from aerodaas.recording.reader import Recording

CAMERA = {"id": "cam", "type": "camera", "rate": 5, "settings": {"width": 64, "height": 36}}
ODOMETRY = {"id": "odom", "type": "odometry", "rate": 10}
CONTENT = {**FLAT, "robots": [robot(sensors=[ODOMETRY, CAMERA])]}


class Where(Analytics[Readings]):
    """Tells its process, and the variable that its environment sets; warns once."""

    accepts: ClassVar[tuple[type, ...]] = (Odometry,)

    def process(self, item: Odometry, context: Context) -> Readings:  # noqa: ARG002
        """Name the process."""
        header = Header(0, context.now(), "where")
        context.alert(Alert(header, "seen", os.environ.get("COLOUR", "none")))
        return Readings(context.now(), {"pid": os.getpid()})


def _fly(flyer: Flyer, name: str, runtime: str | None, *, own_environment: bool) -> Run:
    def build(env: Environment) -> None:
        drone = env.get_robot_by_id("drone")
        where = Where()
        if own_environment:
            edge = env.get_compute_resource_by_id("edge")
            where.deploy(edge, {"env_vars": {"COLOUR": "green"}})
        where.analyse(drone.get_sensor_by_id("odom").get_data_stream())
        drone.navigate(hop((2, 0)))

    return flyer.fly(build, CONTENT, seed=3, runtime=runtime, record=flyer.folder / name)


def _seen(run: Run) -> tuple[set[float], set[str]]:
    """Processes of the analysis, and texts of its alerts."""
    assert run.recording is not None
    with Recording.open(run.recording) as recording:
        values = [one.value for one in recording.records(topics=["/drone/where/value"])]
        alerts = [one.value for one in recording.records(schemas=["aerodaas.Alert"])]
    pids = {value.value["values"]["pid"] for value in values}
    return pids, {alert.text for alert in alerts if alert.kind == "seen"}


def test_a_flight_is_the_same_wherever_its_nodes_are(tmp_path: Path) -> None:
    """In one process, with one node in an environment of its own, and with all nodes on Ray."""
    flyer = Flyer(tmp_path)
    inline = _fly(flyer, "inline", None, own_environment=False)
    isolated = _fly(flyer, "isolated", None, own_environment=True)
    everything = _fly(flyer, "everything", "ray", own_environment=False)
    assert _seen(inline) == ({os.getpid()}, {"none"})
    for run, said in ((isolated, "green"), (everything, "none")):
        pids, texts = _seen(run)
        assert texts == {said}
        assert len(pids) == 1
        assert os.getpid() not in pids
    first = recorded(inline)
    for run in (isolated, everything):
        other = recorded(run)
        assert np.array_equal(first.robots["drone"]._columns, other.robots["drone"]._columns)
        assert first.frames == other.frames
