"""The same in real time, with a driver of one's own, and on a node that has none of the files."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from stranger import CAMERA, ENVIRONMENT, FLY, HEAD, Flown, fly, write

pytestmark = pytest.mark.slow

HOVERBOT = '''
import numpy as np

from aerodaas.messages.odometry import Battery, Odometry
from aerodaas.messages.vehicle import Capabilities, PositionSetpoint, VehicleMode, VehicleState
from bot_settings import SPEED


class Hoverbot:
    """A point that moves as it is told, at the time of the clock that it is given."""

    capabilities = Capabilities("hoverbot", returns_home=False)

    def __init__(self, robot, environment):
        self.stamp, self.mode = 0, VehicleMode.GROUNDED
        self.position, self.velocity = np.array(robot.start), np.zeros(3)
        self.goal = PositionSetpoint(self.position)

    def connect(self, timeout=10.0): ...
    def close(self): ...
    def preflight(self):
        return []

    def read(self):
        odometry = Odometry(self.position.copy(), self.velocity.copy(), yaw=0.0)
        flying = self.mode is not VehicleMode.GROUNDED
        return VehicleState(self.stamp, odometry, Battery(1.0), self.mode, armed=flying)

    def send(self, setpoint, mode=VehicleMode.GUIDED):
        self.goal, self.mode = setpoint, mode
        return setpoint

    def take_off(self, height):
        self.send(PositionSetpoint(self.position + [0, 0, height]), VehicleMode.TAKING_OFF)

    def hold(self):
        self.send(PositionSetpoint(self.position.copy()), VehicleMode.HOLDING)

    def land(self):
        self.send(PositionSetpoint(self.position * [1, 1, 0]), VehicleMode.LANDING)

    return_home = land

    def advance_to(self, stamp):
        seconds, self.stamp = (stamp - self.stamp) / 1e9, stamp
        way, self.velocity = np.zeros(3), getattr(self.goal, "velocity", np.zeros(3))
        if isinstance(self.goal, PositionSetpoint):
            way = self.goal.position - self.position
            self.velocity = way * min(2.0, SPEED / (np.linalg.norm(way) + 1e-9))
        if np.linalg.norm(way) < 0.05 and self.mode is VehicleMode.LANDING:
            self.mode = VehicleMode.GROUNDED
        elif np.linalg.norm(way) < 0.05 and self.mode is VehicleMode.TAKING_OFF:
            self.mode = VehicleMode.HOLDING
        self.position = self.position + self.velocity * seconds
'''
LIVE = """
import threading

import numpy as np

from aerodaas.cameras.base import Picture


class Grey:
    model, finished, skipped = None, False, 0

    def __init__(self, sensor, environment): ...
    def open(self): ...
    def close(self): ...

    def capture(self, stamp, pose):
        return Picture(np.full((32, 48, 3), 77, np.uint8), stamp)


class Seen:
    def __init__(self, value):
        self.value = value


class See(Analytics[Seen]):
    def process(self, item, context):
        return Seen(float(item.image.mean()))


class Check(Analytics[bool]):
    isolated = True

    def process(self, item, context):
        return isinstance(item, Seen)


class Lock(Analytics[object]):
    def process(self, item, context):
        return threading.Lock()


seen = See().deploy(edge).analyse(camera)
Check().deploy(edge).analyse(seen)
Check().deploy(edge).analyse(Lock().deploy(edge).analyse(camera))
drone.navigate(AeroListData([Waypoint("a", 1, 0, 2), Waypoint("b", 1, 1, 2)]))
drone.start_mission(wait=False, speed=1)
first = next(iter(seen))
assert isinstance(first, Seen), first
print("read", type(first).__name__, first.value)
drone.wait()
"""


def test_real_time_with_a_driver_of_ones_own(tmp_path: Path) -> None:
    """`python app.py`: a driver in a module, results read by the application as its own class."""
    environment = json.loads(json.dumps(ENVIRONMENT))
    environment["robots"][0]["driver"] = "bot:Hoverbot"
    environment["robots"][0]["sensors"] = [{**CAMERA, "driver": "app:Grey", "settings": {}}]
    files = {"app.py": HEAD + LIVE, "bot.py": HOVERBOT, "bot_settings.py": "SPEED = 1.0\n"}
    write(tmp_path, files, environment)
    flown = fly(tmp_path, "app.py", python=True)
    assert "read Seen" in flown.said, flown.said
    assert flown.landed_as_planned(), flown.said
    assert "Lock's result: lock cannot be sent" in " ".join(flown.said.split())
    assert set(map(str, flown.values("drone/see"))) == {"('Seen', {'value': 77.0})"}
    assert {value for _, value in flown.values("drone/check")} == {True}


FAR = """
from pathlib import Path

import ray
from helpers import results
from helpers.results import Level


class Mine:
    def __init__(self, value):
        self.value = value


class Near(Analytics[Mine]):
    def __getstate__(self):
        # Sent: from here on the package is no longer where it was.
        here = Path(__file__).parent
        if ray.is_initialized() and (here / "helpers").exists():
            (here / "helpers").rename(here / "gone")
        return super().__getstate__()

    def process(self, item, context):
        return Mine(float(item.image.mean()))


class Far(Analytics[Level]):
    isolated = True

    def process(self, item, context):
        from helpers import later
        return Level(later.twice(item.value), isinstance(item, Mine))


class Back(Analytics[str]):
    def process(self, item, context):
        return f"{isinstance(item, Level)} {item.mine}"


cloud = env.get_compute_resource_by_id("cloud")
near = Near().deploy(edge).analyse(camera)
Back().deploy(edge).analyse(Far().deploy(cloud).analyse(near))
results.Deep().deploy(cloud).analyse(near)
"""
RESULTS = """
from dataclasses import dataclass

from aerodaas import Analytics


@dataclass
class Level:
    value: float
    mine: bool


class Deep(Analytics[Level]):
    def process(self, item, context):
        return Level(item.value, False)
"""
CLUSTER = """
import os, subprocess, sys
os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
from ray.cluster_utils import Cluster
small = {"num_cpus": 1, "object_store_memory": 80 * 2**20}
cluster = Cluster()
try:
    cluster.add_node(resources={"edge": 1}, node_name="edge", include_dashboard=False, **small)
    cluster.add_node(resources={"cloud": 1}, node_name="cloud", **small)
    command = [sys.argv[1], "run", "app.py", "--speed", "1", "--address", cluster.address]
    sys.exit(subprocess.run(command, cwd=sys.argv[2]).returncode)
finally:
    cluster.shutdown()
"""


def test_a_node_without_the_files(tmp_path: Path) -> None:
    """Everything comes with the run: the files are gone before a process of it starts."""
    environment = json.loads(json.dumps(ENVIRONMENT))
    environment["robots"][0]["sensors"] = [{**CAMERA, "rate": 2}]
    environment["compute"].append({"id": "cloud", "kind": "cloud"})
    folder = tmp_path / "application"
    files = {
        "app.py": HEAD + FAR + FLY,
        "helpers/__init__.py": "",
        "helpers/results.py": RESULTS,
        "helpers/later.py": "def twice(value):\n    return 2 * value\n",
    }
    write(folder, files, environment)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    variables = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    command = [sys.executable, "-c", CLUSTER, str(Path(sys.executable).parent / "aerodaas")]
    done = subprocess.run(
        [*command, str(folder)],
        cwd=elsewhere,
        env=variables,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    said = f"{done.stdout}{done.stderr}"
    assert done.returncode == 0, said
    assert not (folder / "helpers").exists()
    (recording,) = folder.rglob("*.mcap")
    flown = Flown(0, said, recording)
    near = [value["value"] for _, value in flown.values("drone/near")]
    far = flown.values("drone/far")
    assert {kind for kind, _ in far} == {"Level"}
    assert far[0][1]["mine"] is True
    assert far[0][1]["value"] / 2 in near
    assert flown.lines("drone/back") == {"True True"}
    assert {kind for kind, _ in flown.values("drone/deep")} == {"Level"}
