"""The head's machine is lost with its disk while a drone of an edge flies."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import psutil
import pytest
from flying import FLAT
from required import needs_root

from aerodaas.recording.reader import Recording
from aerodaas.recording.report.flight import RecordedFlight
from tools.namespaces.machine import Machine
from tools.namespaces.network import LocalNetwork, RemoteMachine
from tools.namespaces.ray_node import environment, start_head

pytestmark = [
    pytest.mark.slow,
    pytest.mark.timeout(400),
    needs_root,
    pytest.mark.wall_clock,
    pytest.mark.xdist_group("namespaces"),
]
_ROOT = Path(__file__).resolve().parents[2]
_PORT = 6379
_ACTORS = ["ray::DroneActor", "ray::NodeActor", "ray::RecorderActor"]
"""The second has joined in flight."""
_NODES_OWN = ("ray::IDLE", "ray::DashboardAgent", "ray::RuntimeEnvAgent")
_APPLICATION = """
import time
from aerodaas import AeroNavigation, Analytics, Environment, NavigationType, Odometry, Waypoint

class Height(Analytics[float]):
    accepts, produces, isolated = (Odometry,), float, True

    def process(self, item, context):
        return item.height

env = Environment("environment.json")
drone = env.get_robot_by_id("drone")
odometry = drone.get_sensor_by_id("odom_drone")
hover = Waypoint("there", 4, 0, 2, hover_duration=75)
drone.navigate(AeroNavigation(NavigationType.DISTANCE_DRIVEN, [hover]))
drone.start_mission(wait=False)
while odometry.poll(20.0).height < 1.0:
    time.sleep(0.05)
Height().analyse(odometry.get_data_stream())
print("in the air", flush=True)
drone.wait()
"""


@dataclass
class Field:
    """An edge beside the drone, and a head elsewhere."""

    edge: Machine
    head: RemoteMachine
    folder: Path

    def application(self, *words: str) -> subprocess.Popen[str]:
        """Fly on the edge, for longer than Ray waits for its head by itself: a minute."""
        (self.folder / "environment.json").write_text(json.dumps(FLAT))
        (self.folder / "app.py").write_text(_APPLICATION)
        command = [sys.executable, "-m", "aerodaas", "run", str(self.folder / "app.py"), *words]
        command += ["--speed", "1", "--no-view", "--record", str(self.folder / "out")]
        command += ["--address", f"{self.head.address}:{_PORT}"]
        return subprocess.Popen(
            self.edge.words(*command),
            cwd=self.folder,
            env={**os.environ, "PYTHONPATH": str(_ROOT)},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )

    def actors(self) -> list[str]:
        """What of a run is on the edge."""
        found = []
        for process in self.edge.processes():
            with contextlib.suppress(psutil.Error):
                words = " ".join(process.cmdline())
                if words.startswith("ray::") and not words.startswith(_NODES_OWN):
                    found.append(words.split()[0].partition(".")[0])
        return found

    def landed(self) -> str:
        """How the flight ended, by its recording, which is closed."""
        with Recording.open(self.folder / "out" / "flight.mcap") as recording:
            assert recording.complete
            return RecordedFlight.read(recording).robots["drone"].outcome


@pytest.fixture
def field(tmp_path: Path) -> Iterator[Field]:
    """The edge joins as people have it join: by the script."""
    with LocalNetwork() as network:
        head = network.add("head", [network.folder])
        start_head(head.machine, head.address, _PORT, network.folder, {"cloud": 1.0}, {})
        edge = network.add_here("edge")
        variables = {"AERODAAS_VENV": sys.prefix, "AERODAAS_OWN_ADDRESS": network.host}
        script = str(_ROOT / "clusters/edge-join.sh")
        with (tmp_path / "join.log").open("w") as log:
            joining = subprocess.Popen(
                edge.words(script, f"{head.address}:{_PORT}"),
                env=environment(**variables),
                stdout=log,
                stderr=log,
            )
        try:
            log_text = (tmp_path / "join.log").read_text
            assert _wait_for(lambda: "Ray runtime started" in log_text(), 120.0), log_text()
            yield Field(edge, head, tmp_path)
        finally:
            edge.power_off()
            joining.wait()


def _wait_for(happened: Callable[[], bool], seconds: float) -> bool:
    end = time.monotonic() + seconds
    while not happened() and time.monotonic() < end:
        time.sleep(0.2)
    return happened()


def _until_airborne(application: subprocess.Popen[str]) -> None:
    assert application.stdout is not None
    said = []
    for line in application.stdout:
        said.append(line)
        if "in the air" in line:
            return
    raise AssertionError("".join(said))


def test_the_application_returns_and_nothing_is_left(field: Field) -> None:
    """The mission is flown to its end; then all of it ends, though no head can be told."""
    application = field.application()
    _until_airborne(application)
    assert sorted(field.actors()) == _ACTORS
    field.head.machine.power_off()
    lost = time.monotonic()
    said, _ = application.communicate(timeout=240)
    print(f"returned {time.monotonic() - lost:.0f} s after the head was lost:\n{said}")  # noqa: T201
    assert application.returncode == 0
    assert _wait_for(lambda: not field.actors(), 60.0), field.actors()
    print(f"all had ended {time.monotonic() - lost:.0f} s after it was lost")  # noqa: T201
    assert field.landed() == "landed: all waypoints are visited"
    assert f"the cluster's head at {field.head.address}:{_PORT} is out of reach" in said
    assert "its recording: " in said
    assert "out/flight.mcap" in said
    assert "Traceback" not in said


def test_the_application_is_killed_as_well(field: Field) -> None:
    """The drone comes home, and the orphan reaper ends what it can reach: all on the edge."""
    application = field.application()
    _until_airborne(application)
    assert sorted(field.actors()) == _ACTORS
    field.head.machine.power_off()
    time.sleep(15.0)
    (process,) = (
        one
        for one in psutil.Process(application.pid).children(recursive=True)
        if "aerodaas" in one.cmdline()
    )
    process.kill()
    application.communicate(timeout=20)
    assert _wait_for(lambda: not field.actors(), 150.0), field.actors()
    assert field.landed() == "landed: the application's process is gone"
