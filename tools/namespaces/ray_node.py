"""A Ray node on a machine of namespaces, kept slim: half a dozen of them share one computer."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import psutil

import aerodaas
from aerodaas.actors.cluster.authentication import make_token, require_authentication
from aerodaas.actors.cluster.ray_process import RAY
from aerodaas.actors.cluster.ray_variables import VARIABLES
from aerodaas.errors import AeroDaaSError
from tools.namespaces.machine import Machine

__all__ = ["environment", "restart_control_service", "start_head", "start_worker"]

_RETRIES = 2
_TOO_SLOW = "timed out during startup"
"""Ray gives a node half a minute to start, which a busy machine may not have to give."""
STORE_BYTES = 128 * 2**20
_VARIABLES = {
    **VARIABLES,
    # A frame is sent within its call: a reference costs round trips.
    # https://docs.ray.io/en/latest/data/data-internals.html
    "RAY_max_direct_call_object_size": "4194304",
}


def environment(**more: str) -> dict[str, str]:
    """The environment of Ray's processes: the project's own modules and the token are there.

    Makes the token if it is missing; raises AeroDaaSError if its file cannot be used.
    """
    if require_authentication():
        make_token()
    root = str(Path(aerodaas.__file__).parents[1])
    paths = [root, *filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep))]
    own = {"PYTHONPATH": os.pathsep.join(dict.fromkeys(paths))}
    return {**_VARIABLES, **os.environ, **own, **more}


def start_head(
    machine: Machine,
    address: str,
    port: int,
    folder: Path,
    resources: Mapping[str, float],
    variables: Mapping[str, str],
) -> None:
    """Start the cluster's head at `address:port`, its files under `folder`.

    Its tables are kept on disk, so that the control service may die and come back.
    """
    env = environment(
        RAY_gcs_storage="rocksdb",
        RAY_gcs_storage_path=str(folder / "control"),
        **variables,
    )
    words = ["--head", "--port", str(port), "--temp-dir", str(folder), "--include-dashboard=false"]
    _start(machine, address, resources, env, *words)


def start_worker(
    machine: Machine,
    address: str,
    head: str,
    resources: Mapping[str, float],
    variables: Mapping[str, str],
) -> None:
    """Join the cluster at `head` as the node `address`."""
    _start(machine, address, resources, environment(**variables), "--address", head)


def restart_control_service(machine: Machine) -> psutil.Process:
    """Kill the head's control service and start it anew, as a service manager does.

    Returns the process that was killed.
    """
    (old,) = (p for p in machine.processes() if p.name() == "gcs_server")
    words, env = old.cmdline(), old.environ()
    old.kill()
    old.wait()
    machine.run("setsid", "--fork", "sh", "-c", 'exec "$@" >/dev/null 2>&1', "sh", *words, env=env)
    return old


def _start(
    machine: Machine,
    address: str,
    resources: Mapping[str, float],
    env: Mapping[str, str],
    *words: str,
) -> None:
    command = [
        *(sys.executable, "-c", RAY, "start", "--node-ip-address", address),
        *("--num-cpus", "1", "--object-store-memory", str(STORE_BYTES)),
        *("--resources", json.dumps(resources), "--disable-usage-stats"),
        *("--include-log-monitor=false", *words),
    ]
    _attempt(machine, command, env, _RETRIES)


def _attempt(
    machine: Machine, command: Sequence[str], env: Mapping[str, str], retries: int
) -> None:
    try:
        machine.run(*command, env=env)
    except AeroDaaSError as error:
        if not retries or _TOO_SLOW not in str(error):
            raise AeroDaaSError(f"Ray does not start on {machine.name}: {error}") from None
        machine.clear()
        _attempt(machine, command, env, retries - 1)
