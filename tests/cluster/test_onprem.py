"""`ray up clusters/onprem.yaml` for real: three hosts of namespaces, an SSH server on each."""

from __future__ import annotations

import itertools
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml
from required import needs_peer, needs_root, peer

from tools.namespaces.machine import run
from tools.namespaces.network import LocalNetwork, RemoteMachine

pytestmark = [
    pytest.mark.slow,
    pytest.mark.timeout(900),
    needs_root,
    needs_peer("AERODAAS_SSHD"),
    pytest.mark.wall_clock,
]
ROOT = Path(__file__).resolve().parents[2]
CLUSTERS = ROOT / "clusters"
RAY = [sys.executable, "-m", "ray.scripts.scripts"]
SSHD = """
HostKey {folder}/host_key
AuthorizedKeysFile {folder}/key.pub
PermitRootLogin yes
StrictModes no
PidFile none
"""
# What the file's setup would install: the environment that runs this test.
WRAPPER = f"""#!/bin/sh
export PYTHONPATH={ROOT}
exec {sys.executable} -m ray.scripts.scripts "$@"
"""


def start_sshd(far: RemoteMachine, folder: Path) -> subprocess.Popen[bytes]:
    """An SSH server on a machine whose root has a home of his own."""
    home = folder / far.name
    (home / "aerodaas/bin").mkdir(parents=True)
    wrapper = home / "aerodaas/bin/ray"
    wrapper.write_text(WRAPPER)
    wrapper.chmod(0o755)
    (home / "passwd").write_text(
        f"root:x:0:0:root:{home}:/bin/bash\nsshd:x:100:65534::/run/sshd:/usr/sbin/nologin\n"
    )
    far.machine.run("mount", "--bind", str(home / "passwd"), "/etc/passwd")
    config = home / "sshd_config"
    config.write_text(SSHD.format(folder=folder))
    words = far.machine.words(peer("AERODAAS_SSHD"), "-D", "-e", "-f", str(config))
    with (home / "sshd.log").open("wb") as log:
        return subprocess.Popen(words, stderr=log)


@pytest.fixture
def hosts(tmp_path: Path) -> Iterator[list[RemoteMachine]]:
    """A head and two servers that take SSH."""
    Path("/run/sshd").mkdir(exist_ok=True)
    own_ray = Path("/tmp/ray")  # noqa: S108 - each machine has its own
    own_ray.mkdir(exist_ok=True)
    for key in ("host_key", "key"):
        words = ["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", str(tmp_path / key)]
        subprocess.run(words, check=True)
    with LocalNetwork() as network:
        far = [network.add(name, [own_ray]) for name in ("head", "server1", "server2")]
        servers = [start_sshd(one, tmp_path) for one in far]
        yield far
    for server in servers:
        server.wait()


def written(hosts: list[RemoteMachine], folder: Path) -> Path:
    """The file as a user would have changed it: every line marked CHANGE, and nothing else."""
    content = yaml.safe_load((CLUSTERS / "onprem.yaml").read_text())
    content["provider"]["head_ip"] = hosts[0].address
    content["provider"]["worker_ips"] = [host.address for host in hosts[1:]]
    content["auth"] = {"ssh_user": "root", "ssh_private_key": str(folder / "key")}
    token = folder / "token"
    token.write_text("a-token-of-this-tests-own-a-token-of-this-tests-own")
    content["file_mounts"] = {"~/.ray/auth_token": str(token)}
    path = folder / "onprem.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


def ray_up(path: Path, env: dict[str, str]) -> subprocess.CompletedProcess[str]:
    """What a user types."""
    return subprocess.run(
        [*RAY, "up", "-y", "--no-config-cache", str(path)],
        env=env,
        capture_output=True,
        text=True,
        timeout=500,
        check=False,
    )


def test_workers_start_as_well_as_the_head(hosts: list[RemoteMachine], tmp_path: Path) -> None:
    """After `ray up`, all three nodes are there, each with its resource, and the token is asked."""
    path = written(hosts, tmp_path)
    env = {**os.environ, "HOME": str(tmp_path), "RAY_AUTH_MODE": "token"}
    env["RAY_AUTH_TOKEN_PATH"] = str(tmp_path / "token")
    # Ray gives a node half a minute to start, which a busy machine may not have to give.
    attempts = (ray_up(path, env) for _ in range(3))
    said = [up.stdout + up.stderr for up in itertools.takewhile(_failed, attempts)]
    assert len(said) < 3, said[-1]
    address = f"{hosts[0].address}:6379"
    deadline = time.monotonic() + 240
    found = ""
    while found.count("10.") < 3:
        assert time.monotonic() < deadline, found + _monitor_log(hosts[0])
        time.sleep(3.0)
        found = run(sys.executable, "-c", _NODES, address, env=env)
    kinds = dict(line.split() for line in found.splitlines())
    assert kinds == {h.address: "edge" if h.name == "head" else "cloud" for h in hosts}
    for host in hosts:
        own = tmp_path / host.name / ".ray" / "auth_token"
        assert own.stat().st_mode & 0o777 == 0o600
    greeting = [sys.executable, "-m", "aerodaas", "cluster", "greet", address]
    wrong = {**env, "RAY_AUTH_TOKEN": "another-token", "PYTHONPATH": str(ROOT)}
    refused = subprocess.run(greeting, env=wrong, capture_output=True, text=True, check=False)
    assert refused.returncode == 1
    assert "refuses our token" in refused.stderr
    right = {**env, "PYTHONPATH": str(ROOT)}
    subprocess.run(greeting, env=right, check=True)


_NODES = """
import sys
from ray._private.state import GlobalState
from ray._raylet import GcsClientOptions
state = GlobalState()
state._initialize_global_state(GcsClientOptions.create(sys.argv[1], None, True, False))
for node in state.node_table():
    if node["Alive"]:
        kinds = [kind for kind in ("edge", "cloud") if kind in node["Resources"]]
        print(node["NodeManagerAddress"], *kinds)
"""


def _failed(ended: subprocess.CompletedProcess[str]) -> bool:
    return ended.returncode != 0


def _monitor_log(head: RemoteMachine) -> str:
    return head.machine.run("sh", "-c", "tail -n 60 /tmp/ray/session_latest/logs/monitor*")
