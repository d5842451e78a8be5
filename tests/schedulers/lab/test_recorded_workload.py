"""The lab on a recorded flight."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import pytest
from flying import FLAT, Flyer, hop, robot
from typer.testing import CliRunner

from aerodaas import Environment
from aerodaas.analytics import SyntheticAnalytics
from aerodaas.cli.lab.app import app
from aerodaas.cli.lab.recorded_workload import (
    RecordedWorkload,
    flown_trace,
    flown_workload,
)
from aerodaas.config.model import TaskConfig
from aerodaas.errors import RecordingError
from aerodaas.recording.reader import Recording
from aerodaas.recording.report.flight import RecordedFlight
from aerodaas.recording.report.summary import FlightSummary
from aerodaas.schedulers.analytics.base import MILLISECOND
from aerodaas.schedulers.lab import ExecutionTimes, Network, run_lab
from aerodaas.schedulers.lab.metrics import score
from aerodaas.schedulers.lab.sample import SamplePath

pytestmark = pytest.mark.wall_clock

_CAMERA = {"driver": "simulated", "rate": 2, "settings": {"width": 64, "height": 36}}
_CONTENT = {
    "robots": [robot(sensors=[{"id": f"camera{n}", **_CAMERA} for n in range(2)])],
    "compute": [{"id": "edge"}, {"id": "cloud", "kind": "cloud", "executors": 5}],
    "schedulers": {
        "analytics": "ec_edf",
        "tasks": {
            "slow": {"benefit": 30, "edge_time": 330, "cloud_time": 450, "cloud_cost": 5,
                     "qoe_bonus": 7, "qoe_share": 0.5, "qoe_window": 4},
        },
    },
    "recording": {"images": "none"},
    "simulation": {"world": "empty"},
}  # fmt: skip


def _watch_with_two(env: Environment) -> None:
    drone = env.get_robot_by_id("drone")
    quick, slow = SyntheticAnalytics("quick", 50, 200), SyntheticAnalytics("slow", 300, 400)
    quick.task = TaskConfig(benefit=10, edge_time=60, cloud_time=250, deadline=700)
    slow.task = TaskConfig(benefit=1000)  # the environment file knows better
    for model in (quick, slow):
        model.deploy(env.get_compute_resource_by_id("edge"))
        for camera in ("camera0", "camera1"):
            model.analyse(drone.get_sensor_by_id(camera).get_data_stream())
    drone.navigate(hop((2, 0), hover=4.0))


@pytest.mark.slow
def test_a_recorded_flight_becomes_a_workload(flyer: Flyer) -> None:
    """Every task is there with what was observed of it, and the lab runs schedulers over it."""
    run = flyer.fly(_watch_with_two, _CONTENT, speed=1.0)
    assert run.recording is not None
    values = run.reports()["dispatcher"].values
    flown = RecordedWorkload.read(run.recording)
    workload = flown_workload(flown)
    assert flown.resources.cloud_slots == 5
    # Those of the last second may be undecided when the flight ends.
    assert 0 <= values["tasks"] - len(workload.arrivals) <= 8
    assert {one.source for one in workload.arrivals} == {"drone/camera0", "drone/camera1"}
    quick = workload.models["drone/quick"]
    assert (quick.benefit, quick.deadline) == (10, 700 * MILLISECOND)
    slow = workload.models["drone/slow"]
    assert (slow.benefit, slow.edge_time, slow.cloud_cost) == (30, 330 * MILLISECOND, 5)
    assert slow.qoe is not None
    assert values["qoe_windows"]["drone/slow"][1] >= 1
    for one in workload.arrivals:
        assert one.edge_time is not None
        assert one.edge_time > (150 if one.model == "drone/slow" else 25) * MILLISECOND
    tasks = workload.arrivals
    assert any(one.cloud_time and one.cloud_time >= 400 * MILLISECOND for one in tasks)
    figures = run_lab(workload, ["ec_edf", "margin"], [0], jobs=1).scores["ec_edf"][0]
    assert figures.tasks == len(workload.arrivals)
    # A camera's frame makes its tasks at one moment; the lab gets them in the same order.
    sample = SamplePath.draw(workload, 0, 0, ExecutionTimes(), Network())
    together = [(a, b) for a, b in pairwise(sample.tasks) if a.arrival == b.arrival]
    assert len(together) == len(sample.tasks) // 2
    models = {(a.profile.model, b.profile.model) for a, b in together}
    assert models == {("drone/quick", "drone/slow")}
    # The flight is judged by the same code as the lab, to the same sum as in flight.
    judged = score(sample.tasks, flown_trace(flown, sample.tasks))
    assert judged.qos == pytest.approx(values["qos_total"])
    with Recording.open(run.recording) as recording:
        summary = FlightSummary.of(recording, RecordedFlight.read(recording))
    assert summary.utility == {"QoS": values["qos_total"], "QoE": values["qoe_total"]}
    why = [count for said, count in summary.reasons.items() if said.startswith("cloud: ")]
    assert sum(why) == summary.decisions["cloud"] > 0
    arguments = ["run", "--from", str(run.recording), "-s", "ec_edf,dems", "--seeds", "1"]
    outcome = CliRunner().invoke(app, [*arguments, "--jobs", "1"], env={"COLUMNS": "220"})
    assert outcome.exit_code == 0, outcome.output
    assert "dems" in outcome.output
    assert "as flown" in outcome.output


def test_a_flight_without_decisions_is_refused(flyer: Flyer) -> None:
    """The message says what to fly with."""
    run = flyer.fly(lambda env: env.get_robot_by_id("drone").navigate(hop((2, 0))), FLAT)
    assert run.recording is not None
    with pytest.raises(RecordingError, match="no decisions of an analytics scheduler; fly with"):
        RecordedWorkload.read(run.recording)
    outcome = CliRunner().invoke(app, ["run", "--from", str(run.recording)])
    assert isinstance(outcome.exception, RecordingError)


def test_what_is_no_recording_is_refused(tmp_path: Path) -> None:
    """As everywhere."""
    with pytest.raises(RecordingError, match="cannot open the recording"):
        RecordedWorkload.read(tmp_path / "nothing.mcap")
