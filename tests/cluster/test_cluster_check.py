"""What is said of clusters that are not as they should be, and that nothing is left of them."""

from __future__ import annotations

import json
import os
import shlex
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest
from required import needs, needs_root

from aerodaas.actors.cluster.authentication import UNAUTHENTICATED
from aerodaas.actors.cluster.check import clock_offset
from aerodaas.errors import ConfigError
from aerodaas.schedulers.lab.network import Network
from tools.namespaces import EdgeCloud, Shape
from tools.namespaces.ray_node import environment
from tools.namespaces.trace import TracePlayer

pytestmark = pytest.mark.wall_clock

ROOT = Path(__file__).resolve().parents[2]
SLOW = [
    pytest.mark.slow,
    pytest.mark.timeout(280),
    needs_root,
]
# Shifts the clock of whoever is started with it; the kernel has no namespace for that.
AHEAD = """
#define _GNU_SOURCE
#include <dlfcn.h>
#include <time.h>
int clock_gettime(clockid_t id, struct timespec *t) {
    static int (*real)(clockid_t, struct timespec *);
    if (!real) real = dlsym(RTLD_NEXT, "clock_gettime");
    int done = real(id, t);
    if (id == CLOCK_REALTIME) t->tv_sec += 60;
    return done;
}
"""


def aerodaas(*words: str, **env: str) -> subprocess.CompletedProcess[str]:
    """Run the command line; widely, so that no line is broken."""
    return subprocess.run(
        [sys.executable, "-m", "aerodaas", *words],
        env={**os.environ, "PYTHONPATH": str(ROOT), "COLUMNS": "240", **env},
        capture_output=True,
        text=True,
        timeout=200,
        check=False,
    )


@pytest.fixture(scope="module")
def small() -> Iterator[EdgeCloud]:
    """An edge and one cloud node, 40 ms away."""
    with EdgeCloud(1, shape=Shape(0.04, 50e6)) as made:
        yield made


def test_the_clocks_offset_is_taken_from_the_shortest_round_trip() -> None:
    """A slow one, of which nobody knows which way it was slow, does not count."""
    quick = (1_000_000_000, 3_010_000_000, 1_020_000_000)
    slow = (2_000_000_000, 4_900_000_000, 3_000_000_000)
    assert clock_offset([slow, quick]) == pytest.approx((2.0, 0.01))


class TestGood:
    """A cluster that is as it should be."""

    pytestmark = SLOW

    def test_check(self, small: EdgeCloud) -> None:
        """Every node, way and clock is measured; nothing is to be mended."""
        checked = aerodaas("cluster", "check", small.address)
        assert checked.returncode == 0, checked.stdout + checked.stderr
        for text in ("edge nodes", "cloud nodes", "round trip", "Mbit/s", "clock of", "AeroDaaS"):
            assert text in checked.stdout
        assert "Traceback" not in checked.stderr

    def test_a_trace_changes_the_links(self, small: EdgeCloud) -> None:
        """Latency is added, bandwidth replaced, an outage cuts and ends."""
        network = Network("t", latency=((0, 0.0), (10**10, 4e8)), outages=((5 * 10**9, 6 * 10**9),))
        player = TracePlayer(small, network, 10.0)
        player.apply(2.5)
        assert small.far["cloud1"].shape == Shape(0.14, 50e6)
        player.apply(5.5)
        assert small.is_cut("cloud1")
        player.apply(10.0)
        assert small.far["cloud1"].shape == Shape(0.04, 50e6)
        assert not small.is_cut("cloud1")

    def test_a_resource_that_nobody_offers(self, small: EdgeCloud, tmp_path: Path) -> None:
        """Told before anything starts, in one line."""
        content = {
            "robots": [{"id": "drone"}],
            "compute": [{"id": "far", "kind": "cloud", "node": "10.1.2.3"}],
        }
        (tmp_path / "environment.json").write_text(json.dumps(content))
        (tmp_path / "app.py").write_text(
            "from aerodaas import *\n"
            "from aerodaas.analytics import *\n"
            "from analyses import Wish\n"
            "env = Environment()\n"
            "far = env.get_compute_resource_by_id('far')\n"
            "drone = env.get_robot_by_id('drone')\n"
            "drone.navigate(Wish().deploy(far).instantiate())\n"
            "drone.start_mission()\n"
        )
        path = os.pathsep.join([str(ROOT), str(ROOT / "tests")])
        ended = aerodaas(
            "run",
            str(tmp_path / "app.py"),
            "--address",
            small.address,
            "--no-view",
            "--record",
            str(tmp_path / "out"),
            PYTHONPATH=path,
        )
        assert ended.returncode == 2
        assert "no node of the cluster is called '10.1.2.3'; known: 10." in ended.stderr
        assert ended.stderr.count("error:") == 1


class TestBad:
    """One clear message each."""

    pytestmark = SLOW

    @pytest.mark.parametrize("command", [("cluster", "check"), ("doctor", "--address")])
    def test_wrong_address(self, small: EdgeCloud, command: tuple[str, str]) -> None:
        """Nobody listens there."""
        told = aerodaas(*command, f"{small.host}:1")
        assert told.returncode == 1
        said = told.stdout + told.stderr
        assert f"no Ray cluster answers at {small.host}:1" in said
        assert "Traceback" not in said

    def test_wrong_token(self, tmp_path: Path) -> None:
        """Says where the right one is to be found, within seconds."""
        token = tmp_path / "token"
        token.touch(0o600)
        token.write_text("the-clusters-own-token-the-clusters-own-token")
        variables = {"RAY_AUTH_MODE": "token", "RAY_AUTH_TOKEN_PATH": str(token)}
        with EdgeCloud(0, variables=variables) as cluster:
            nowhere = {"HOME": str(tmp_path), "RAY_AUTH_TOKEN_PATH": "", "RAY_AUTH_TOKEN": ""}
            for env, reason in (
                ({**variables, "RAY_AUTH_TOKEN": "another-token"}, "refuses our token"),
                (nowhere, "no token for the cluster at"),
                ({"RAY_AUTH_MODE": "disabled"}, "RAY_AUTH_MODE=disabled would let all"),
            ):
                told = aerodaas("cluster", "check", cluster.address, **env)
                assert told.returncode in {1, 2}
                assert reason in told.stderr
                assert len(told.stderr.splitlines()) == 1
            assert not (tmp_path / ".ray").exists()
            off = {"RAY_AUTH_MODE": "disabled", UNAUTHENTICATED: "1"}
            told = aerodaas("cluster", "greet", cluster.address, **off)
            assert told.returncode == 1
            assert "asks for no token" in told.stderr
            assert "refuses our token" in told.stderr
            assert aerodaas("cluster", "greet", cluster.address, **variables).returncode == 0

    def test_a_fresh_host_asks_for_a_token(self, tmp_path: Path) -> None:
        """Without a token's file one is made, and a stranger without it is refused."""
        fresh = {"HOME": str(tmp_path), "PYTHONPATH": str(ROOT), "COLUMNS": "240"}
        script = (
            f"{sys.executable} -c {shlex.quote(_STRANGER)} $RAY_ADDRESS; "
            f"{sys.executable} -m aerodaas cluster greet $RAY_ADDRESS && echo greeted"
        )
        inherited = {key: value for key, value in os.environ.items() if not key.startswith("RAY_")}
        told = subprocess.run(
            [sys.executable, "-m", "tools.namespaces", "--cloud", "1", "--", "sh", "-c", script],
            env={**inherited, **fresh},
            capture_output=True,
            text=True,
            check=False,
        )
        assert "stranger: refused" in told.stdout, told.stdout + told.stderr
        assert "greeted" in told.stdout
        assert (tmp_path / ".ray" / "auth_token").stat().st_mode & 0o777 == 0o600

    def test_other_versions(self) -> None:
        """A head that says it runs another Ray, or another Python."""
        with EdgeCloud(0) as cluster:
            for key, other, remedy in (
                ("ray_version", "2.40.0", "pip install 'ray==2.40.0'"),
                ("python_version", "3.9.1", "use Python 3.9 here"),
            ):
                script = _PRETEND.format(key=key, other=other)
                env = {**os.environ, "PYTHONPATH": str(ROOT)}
                subprocess.run([sys.executable, "-c", script, cluster.address], env=env, check=True)
                told = aerodaas("cluster", "check", cluster.address)
                assert told.returncode == 1
                assert other in told.stderr
                assert remedy in told.stderr
                assert len(told.stderr.splitlines()) == 1

    @needs(shutil.which("cc"), "install a C compiler: a clock is shifted by a library of our own")
    def test_twins_and_clocks_and_nothing_offered(self, tmp_path: Path) -> None:
        """A node that has joined twice, one whose clock is a minute ahead, one without a use."""
        source, library = tmp_path / "ahead.c", tmp_path / "ahead.so"
        source.write_text(AHEAD)
        subprocess.run(["cc", "-shared", "-fPIC", "-o", library, source, "-ldl"], check=True)  # noqa: S607
        with EdgeCloud(1) as cluster:
            cluster.join_again("cloud1")
            cluster.add("ahead", {"cloud": 1.0}, LD_PRELOAD=str(library))
            useless = cluster.add("useless", {"attic": 1.0})
            told = aerodaas("cluster", "check", cluster.address)
            address = cluster.far["cloud1"].address
        assert told.returncode == 1
        assert f"{address} has joined 2 times" in told.stdout
        assert "ray stop" in told.stdout
        assert "ms ahead → set both clocks by NTP" in told.stdout
        assert f"{useless.address} offers neither edge nor cloud" in told.stdout


@needs_root
@pytest.mark.slow
def test_the_join_script(tmp_path: Path) -> None:
    """An edge joins, stays, cannot join twice, and says what is wrong with the address."""
    script = str(ROOT / "clusters/edge-join.sh")
    (tmp_path / "bin").mkdir()
    for name, module in (("python", ""), ("ray", "-m ray.scripts.scripts")):
        program = tmp_path / "bin" / name
        program.write_text(f'#!/bin/sh\nexec {sys.executable} {module} "$@"\n')
        program.chmod(0o755)
    with EdgeCloud(0) as cluster:
        far = cluster.add("jetson", {})
        env = environment(AERODAAS_VENV=str(tmp_path))
        wrong = subprocess.run(
            far.machine.words(script, f"{cluster.host}:1"),
            env=env,
            capture_output=True,
            text=True,
            check=False,
        )
        assert wrong.returncode == 1
        assert f"no Ray cluster answers at {cluster.host}:1" in wrong.stderr
        with subprocess.Popen(
            far.machine.words(script, cluster.address), env=env, stdout=subprocess.PIPE, text=True
        ) as staying:
            assert staying.stdout is not None
            assert f"as {far.address} with" in staying.stdout.readline()
            assert any("Ray runtime started" in line for line in staying.stdout)
            twice = subprocess.run(
                far.machine.words(script, cluster.address),
                env=env,
                capture_output=True,
                text=True,
                check=False,
            )
            assert twice.returncode == 1
            assert "runs on this machine already" in twice.stderr
            told = aerodaas("cluster", "check", cluster.address)
            assert any(
                far.address in line and "edge," in line for line in told.stdout.splitlines()
            ), told.stdout
            far.machine.power_off()


@needs_root
@pytest.mark.slow
def test_nothing_is_left() -> None:
    """Neither a process nor a device, even if the command is killed."""
    devices = _devices()
    words = ["--cloud", "1", "--rtt", "5ms"]
    with subprocess.Popen(
        [sys.executable, "-m", "tools.namespaces", *words],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        assert any("Ctrl-C" in line for line in process.stdout)
        below = psutil.Process(process.pid).children(recursive=True)
        assert any(one.name() == "raylet" for one in below)
        process.kill()
    _, left = psutil.wait_procs(below, timeout=20)
    assert left == []
    deadline = time.monotonic() + 20
    while _devices() - devices:
        assert time.monotonic() < deadline
        time.sleep(0.2)


def test_without_root() -> None:
    """Said at once, with what to do instead; root becomes nobody for as long as it takes."""
    user = os.geteuid()
    if user == 0:
        os.seteuid(65534)
    try:
        with pytest.raises(ConfigError, match="need root"):
            EdgeCloud(1)
    finally:
        os.seteuid(user)


def _devices() -> set[str]:
    return {path.name for path in Path("/sys/class/net").iterdir()}


_STRANGER = """
import os, sys
os.environ["RAY_AUTH_MODE"] = "disabled"
from ray._raylet import GcsClient
try:
    GcsClient(address=sys.argv[1]).internal_kv_put(b"k", b"v", True, b"n", timeout=5)
    print("stranger: written")
except Exception as error:
    refused = "InvalidAuthToken" in str(error)
    print("stranger: refused" if refused else f"stranger: {error}")
"""
_PRETEND = """
import json, sys
from aerodaas.actors.cluster.authentication import require_authentication
require_authentication()
from ray._raylet import GcsClient
client = GcsClient(address=sys.argv[1])
told = json.loads(client.internal_kv_get(b"CLUSTER_METADATA", b"cluster"))
import platform, ray
told.update(ray_version=ray.__version__, python_version=platform.python_version())
told["{key}"] = "{other}"
client.internal_kv_put(b"CLUSTER_METADATA", json.dumps(told).encode(), True, b"cluster")
"""
