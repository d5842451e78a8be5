"""Isolated processes with packages of their own: an analysis' `runtime_env` as Ray options.

`uv run --with` overlays the packages on the node's own from a cache, without changing the node's
environment; Ray starts the process through it (`py_executable`). Everything is installed before
the mission starts, on every node that the analysis may run on, because in flight there may be no
network and an error would come too late.
"""

from __future__ import annotations

import importlib.util
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, cast

import ray
from ray.exceptions import GetTimeoutError, RayError

from aerodaas.actors.cluster.ray_cluster import nodes_at, pinned
from aerodaas.actors.process_variables import ray_variables
from aerodaas.config.model import RuntimeEnvConfig
from aerodaas.config.secrets import cleaned
from aerodaas.errors import ConfigError
from aerodaas.runtime.dispatch.offload import CloudProcess
from aerodaas.runtime.placement import Placement
from aerodaas.runtime.plan import ActorPlan, FlightPlan

__all__ = ["environment_options", "isolation_options"]

_INSTALL_TIMEOUT = 600.0
"""Seconds for the packages of one analysis: PyTorch alone is gigabytes."""


@dataclass(frozen=True)
class _Installed:
    """Answer of a node: the command, or the problem."""

    command: tuple[str, ...] = ()
    """Command line of a Python that has the packages."""
    problem: str = ""


def environment_options(plan: FlightPlan) -> dict[str, dict[str, Any]]:
    """Ray options for the environment of each process that runs analyses, by name.

    Called before any actor exists, so that a failure leaves nothing behind. Raises ConfigError
    for an environment that a node cannot provide, and for a place without a node.
    """
    processes: dict[str, ActorPlan | CloudProcess] = {one.name: one for one in plan.actors}
    for number, process in enumerate(plan.dispatch.cloud if plan.dispatch else ()):
        processes[f"cloud/{number}/{process.site}"] = process
    for place in {*plan.edges, *(one.place for one in processes.values())}:
        nodes_at(place)
    return {
        name: isolation_options(one.runtime_env, one.place, name) for name, one in processes.items()
    }


def isolation_options(env: RuntimeEnvConfig | None, place: Placement, name: str) -> dict[str, Any]:
    """Install the environment of an analysis and return Ray's options for its process.

    Args:
        env: The environment; None needs no options.
        place: Where the process runs.
        name: Name of the analysis, for errors.

    Raises:
        ConfigError: If a node cannot provide the environment; with the node's message.
    """
    if env is None:
        return {}
    runtime_env: dict[str, Any] = {}
    if variables := ray_variables(env):
        runtime_env["env_vars"] = variables
    if env.image_uri is not None:
        _ask_all(place, name, _find_engine, ())
        runtime_env["image_uri"] = env.image_uri
    if env.packages:
        found = _ask_all(place, name, _install, env.packages)
        if len(set(found)) > 1:
            raise ConfigError(
                f"runtime_env of {name}: the nodes of kind {place.kind} keep Python or uv in "
                "different places; name one of them as the resource's `node`"
            )
        command = list(found[0])
        if place.kind == "edge":
            command.insert(command.index("run") + 1, "--offline")
        runtime_env["py_executable"] = shlex.join(command)
    return {"runtime_env": runtime_env} if runtime_env else {}


def _ask_all(
    place: Placement,
    name: str,
    question: Any,  # noqa: ANN401
    about: Iterable[str],
) -> list[tuple[str, ...]]:
    """Run `question` on every node where the analysis may run; raises ConfigError."""
    ask: Any = ray.remote(question)
    answers = {}
    for node in nodes_at(place):
        strategy = pinned(node["NodeID"])
        options = ask.options(num_cpus=0, max_retries=0, scheduling_strategy=strategy)
        answers[node["NodeManagerAddress"]] = options.remote(list(about))
    found = []
    for address, reference in answers.items():
        try:
            answer = cast("_Installed", ray.get(reference, timeout=_INSTALL_TIMEOUT))
        except GetTimeoutError:
            answer = _Installed(problem=f"not installed within {_INSTALL_TIMEOUT:.0f} s")
        except RayError as error:
            answer = _Installed(problem=str(error).strip().splitlines()[-1])
        if answer.problem:
            raise ConfigError(f"runtime_env of {name}: on node {address}: {answer.problem}")
        found.append(answer.command)
    return found


def _install(packages: list[str]) -> _Installed:
    """Install the packages on this node and start Python with them once."""
    if importlib.util.find_spec("uv") is None:
        return _Installed(problem='uv is missing; there, `pip install "aerodaas[isolation]"`')
    from uv import find_uv_bin  # noqa: PLC0415 - an extra

    chosen = [word for package in packages for word in ("--with", package)]
    command = (find_uv_bin(), "run", "--no-project", "--python", sys.executable, *chosen, "python")
    try:
        done = subprocess.run(  # noqa: S603 - checked requirements
            [*command, "-c", "pass"],
            capture_output=True,
            text=True,
            timeout=_INSTALL_TIMEOUT,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return _Installed(problem=f"not installed within {_INSTALL_TIMEOUT:.0f} s")
    if done.returncode:
        reason = cleaned(" ".join(done.stderr.split()), packages)
        return _Installed(problem=f"cannot install: {reason[-500:]}")
    return _Installed(command)


def _find_engine(_: list[str]) -> _Installed:
    if shutil.which("podman") is None:
        return _Installed(problem="podman is missing, so no image_uri can run there; install it")
    return _Installed()
