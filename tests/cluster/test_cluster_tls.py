"""Ray's TLS for real: an edge and a cloud node, each with a certificate for its own address."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from certificates import make_certificates, tls_variables
from flying import FLAT, robot
from required import needs, needs_root

from aerodaas.recording.reader import Recording
from aerodaas.recording.report.flight import RecordedFlight
from tools.namespaces.machine import run
from tools.namespaces.network import LocalNetwork
from tools.namespaces.ray_node import environment, start_head, start_worker

pytestmark = [
    pytest.mark.slow,
    pytest.mark.timeout(400),
    needs_root,
    needs(shutil.which("openssl"), "install openssl"),
    pytest.mark.wall_clock,
]
_ROOT = Path(__file__).resolve().parents[2]
_CAMERA = {"id": "camera", "type": "camera", "driver": "glances:NoiseCamera", "rate": 5.0}
_ENVIRONMENT = {
    **FLAT,
    "robots": [robot(sensors=[_CAMERA, {"id": "odom", "type": "odometry", "rate": 10}])],
    "compute": [{"id": "edge", "kind": "edge"}, {"id": "cloud", "kind": "cloud"}],
    "recording": {"images": "none"},
}
# Frames are analysed in the cloud until it has seen 20; large objects cross by themselves.
MARK = b"for no one's eyes"
_APPLICATION = """
from pathlib import Path
import ray
from test_cluster_tls import MARK
from aerodaas import AeroNavigation, Environment, NavigationType, Waypoint
from glances import Glance

env = Environment("environment.json")
drone = env.get_robot_by_id("drone")
frames = drone.get_sensor_by_id("camera").get_data_stream()
glance = Glance("glance", Path("stop"))
glance.deploy(env.get_compute_resource_by_id("cloud")).analyse(frames)
glance.trigger(drone.end_mission, when=lambda number: number >= 20)
hover = Waypoint("w", 2, 0, 2, hover_duration=600)
drone.navigate(AeroNavigation(NavigationType.DISTANCE_DRIVEN, [hover]))
drone.start_mission(wait=False)
there = ray.remote(resources={"cloud": 0.001}, num_cpus=0)(lambda data: len(data))
marked = MARK * 10_000
print("in the call:", ray.get(there.remote(marked), timeout=60))
print("in the store:", ray.get(there.remote(ray.put(marked * 50)), timeout=60))
env.run.wait()
"""


@dataclass
class Secured:
    """A cluster whose nodes speak TLS."""

    address: str
    cloud: str
    """Address of the cloud node."""
    cable: str
    """The interface to it."""
    certificates: Path
    folder: Path

    def aerodaas(self, *words: str, **variables: str) -> subprocess.CompletedProcess[str]:
        """The command line, on the edge."""
        paths = (_ROOT, _ROOT / "tests/cluster", _ROOT / "tests")
        return subprocess.run(
            [sys.executable, "-m", "aerodaas", *words],
            cwd=self.folder,
            env={**environment(), "PYTHONPATH": os.pathsep.join(map(str, paths)), **variables},
            capture_output=True,
            text=True,
            timeout=240,
            check=False,
        )


@pytest.fixture(scope="module")
def secured(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Secured]:
    """An edge with the head, and a cloud node."""
    folder = tmp_path_factory.mktemp("certificates")
    paths = (_ROOT, _ROOT / "tests/cluster", _ROOT / "tests")
    with LocalNetwork() as network, pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", os.pathsep.join(map(str, paths)))
        edge = network.add_here("edge1")
        cloud = network.add("cloud1", [network.folder])
        make_certificates(folder, network.host, cloud.address)
        with socket.socket() as probe:
            probe.bind(("", 0))
            port = int(probe.getsockname()[1])
        here = tls_variables(folder, network.host)
        start_head(edge, network.host, port, network.folder, {"edge": 1.0}, here)
        there = tls_variables(folder, cloud.address)
        address = f"{network.host}:{port}"
        start_worker(cloud.machine, cloud.address, address, {"cloud": 1.0}, there)
        way = json.loads(run("ip", "-json", "route", "get", cloud.address))
        files = tmp_path_factory.mktemp("application")
        yield Secured(address, cloud.address, way[0]["dev"], folder, files)


@contextlib.contextmanager
def overhearing(secured: Secured) -> Iterator[Callable[[], bool]]:
    """Listen to the packets between the nodes; what is yielded tells whether MARK was in one."""
    found = threading.Event()
    over = threading.Event()
    everything = 3
    with socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(everything)) as ear:
        ear.bind((secured.cable, 0))
        ear.settimeout(0.2)

        def listen() -> None:
            while not over.is_set():
                with contextlib.suppress(TimeoutError):
                    if MARK in ear.recv(65536):
                        found.set()

        thread = threading.Thread(target=listen)
        thread.start()
        yield lambda: found.wait(1.0)
        over.set()
        thread.join()


def test_an_application_flies_over_an_encrypted_cluster(secured: Secured) -> None:
    """Frames, calls and large objects reach the other node, and nobody between can read them."""
    (secured.folder / "app.py").write_text(_APPLICATION)
    (secured.folder / "environment.json").write_text(json.dumps(_ENVIRONMENT))
    host = secured.address.partition(":")[0]
    words = ["run", "app.py", "--address", secured.address, "--speed", "1", "--record", "out"]
    with overhearing(secured) as heard:
        flown = secured.aerodaas(*words, **tls_variables(secured.certificates, host))
        assert not heard()
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as open_letter:
            open_letter.sendto(MARK, (secured.cloud, 9))
        assert heard(), "else we were deaf"
    assert flown.returncode == 0, flown.stdout + flown.stderr
    assert f"in the call: {len(MARK) * 10_000}" in flown.stdout
    assert f"in the store: {len(MARK) * 500_000}" in flown.stdout
    with Recording.open(secured.folder / "out/flight.mcap") as recording:
        flight = RecordedFlight.read(recording)
    assert flight.robots["drone"].outcome == "landed: an analysis asked to land"
    assert len(flight.latencies["drone/glance"].total) >= 15


def test_who_has_no_certificate_is_refused(secured: Secured) -> None:
    """At once, by us, with what to set; and by Ray, whoever asks it directly."""
    refused = secured.aerodaas("cluster", "greet", secured.address)
    assert refused.returncode == 1
    assert "speaks TLS only: set RAY_USE_TLS=1" in refused.stderr + refused.stdout
    # Ray's own client would try for minutes.
    ask = f"from ray._raylet import GcsClient; GcsClient(address={secured.address!r})"
    with pytest.raises(subprocess.TimeoutExpired):
        subprocess.run([sys.executable, "-c", ask], env=environment(), timeout=20, check=False)


def test_who_has_somebody_elses_certificate_is_refused(secured: Secured, tmp_path: Path) -> None:
    """Though it knows the cluster's own authority."""
    host = secured.address.partition(":")[0]
    stranger = tls_variables(make_certificates(tmp_path, host), host)
    stranger["RAY_TLS_CA_CERT"] = str(secured.certificates / "ca.crt")
    refused = secured.aerodaas("cluster", "greet", secured.address, **stranger)
    assert refused.returncode == 1
    assert "refuses our certificate" in refused.stderr + refused.stdout
    right = tls_variables(secured.certificates, host)
    assert secured.aerodaas("cluster", "greet", secured.address, **right).returncode == 0
