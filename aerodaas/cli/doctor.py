"""Examination of this machine, with remedies: `aerodaas doctor`."""

from __future__ import annotations

import importlib
import os
import platform
import shutil
import socket
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Annotated

import psutil
import typer
from rich.console import Console
from rich.table import Table
from rich.text import Text

from aerodaas.actors import priority
from aerodaas.config.extensions import extensions
from aerodaas.errors import AeroDaaSError
from aerodaas.findings import Finding

__all__ = ["doctor", "examine", "show_findings"]

_PACKAGES = {
    "ray": "ray",
    "panda3d": "panda3d.core",
    "onnxruntime": "onnxruntime",
    "opencv-python-headless": "cv2",
    "av": "av",
    "pymavlink": "pymavlink",
    "foxglove-sdk": "foxglove",
    "mcap": "mcap",
    "pyvrp": "pyvrp",
}
_OPTIONAL = {
    "pyvrp": "pip install 'aerodaas[routing]' in Python 3.11 or newer, for the optimal scheduler "
    "and fleets",
}
"""What one does well without, and how to have it."""
_MEMORY_NEEDED = 1.0
_SHARED_MEMORY_NEEDED = 256
_PORTS = {
    14540: "PX4 offboard",
    14550: "ground station, ArduPilot",
}


def doctor(
    address: Annotated[str | None, typer.Option(help="Ray cluster to check, too.")] = None,
) -> None:
    """Say what this machine can do.

    aerodaas doctor
    """
    raise typer.Exit(0 if examine(address) else 1)


def examine(address: str | None = None) -> bool:
    """Print all findings; True if nothing needs mending."""
    checks: list[Callable[[], Iterator[Finding]]] = [
        _python,
        _machine,
        _punctuality,
        _packages,
        _providers,
        _streams,
        _renderer,
        _ports,
        lambda: _cluster(address),
    ]
    return show_findings("aerodaas doctor", (finding for check in checks for finding in check()))


def show_findings(title: str, findings: Iterable[Finding]) -> bool:
    """Print findings in one table; True if nothing needs mending."""
    table = Table(title=Text(title), title_justify="left", box=None, pad_edge=False)
    for column in ("", "subject", "finding"):
        table.add_column(column, overflow="fold")
    good = True
    for finding in findings:
        good &= finding.ok
        remedy = Text(f" → {finding.remedy}" if finding.remedy else "", "yellow")
        mark = Text("ok", "green") if finding.ok else Text("no", "red")
        # Texts, for what is told may have brackets, as the names of extras have.
        table.add_row(mark, Text(finding.subject), Text.assemble(finding.text, remedy))
    Console().print(table)
    return good


def _python() -> Iterator[Finding]:
    oldest, newest = (3, 10), (3, 13)
    fits = oldest <= sys.version_info[:2] <= newest
    yield Finding("Python", platform.python_version(), fits, "" if fits else "use 3.10 to 3.13")
    virtual = sys.prefix != sys.base_prefix
    yield Finding("environment", sys.prefix + (" (virtual)" if virtual else ""))


def _machine() -> Iterator[Finding]:
    memory = psutil.virtual_memory()
    free = memory.available / 2**30
    text = f"{os.cpu_count()} cores, {free:.1f} of {memory.total / 2**30:.1f} GiB free"
    fits = free >= _MEMORY_NEEDED
    yield Finding("machine", f"{platform.machine()}, {text}", fits, "" if fits else "free 1 GiB")
    shared = Path("/dev/shm")  # noqa: S108 - the kernel's own mount, only looked at
    if shared.is_dir():
        size = shutil.disk_usage(shared).total / 2**20
        fits = size >= _SHARED_MEMORY_NEEDED
        remedy = "" if fits else "give the container more: docker run --shm-size=1g"
        yield Finding("shared memory", f"{size:.0f} MiB", fits, remedy)


def _punctuality() -> Iterator[Finding]:
    """Priorities granted to a drone's actor, found by a thread that asks for them and ends."""
    nice = priority.niceness()
    remedy = "" if nice <= 0 else "start Ray and aerodaas without `nice`, RAY_worker_niceness=0"
    yield Finding("niceness", str(nice), nice <= 0, remedy)
    with ThreadPoolExecutor(1) as thread:
        refused = thread.submit(priority.real_time).result()
    hint = "setcap cap_sys_nice+ep, or `ulimit -r 1`, lets the setpoint loop go before all else"
    yield Finding("real-time priority", f"{refused}; {hint}" if refused else "granted")
    refused = priority.lockable_memory()
    hint = "`ulimit -l unlimited` keeps the setpoint loop's memory from being swapped out"
    yield Finding("locked memory", f"{refused}; {hint}" if refused else "granted")


def _packages() -> Iterator[Finding]:
    yield from (_package(package, module) for package, module in _PACKAGES.items())
    try:
        clash = version("opencv-python")
    except PackageNotFoundError:
        return
    yield Finding(
        "opencv-python",
        f"{clash} overwrites opencv-python-headless",
        ok=False,
        remedy="pip uninstall opencv-python; pip install --force-reinstall opencv-python-headless",
    )


def _package(package: str, module: str) -> Finding:
    try:
        importlib.import_module(module)
        return Finding(package, version(package))
    except (ImportError, PackageNotFoundError) as error:
        if package in _OPTIONAL:
            return Finding(package, "not installed", remedy=_OPTIONAL[package])
        return Finding(package, str(error), ok=False, remedy=f"pip install {package}")


def _providers() -> Iterator[Finding]:
    from aerodaas.analytics.detection.providers import (  # noqa: PLC0415 - slow to load
        default_providers,
    )

    names = [name.removesuffix("ExecutionProvider") for name in default_providers()]
    yield Finding("inference on", ", ".join(names))


def _streams() -> Iterator[Finding]:
    from aerodaas.actors.streams import shared_memory_obstacle  # noqa: PLC0415 - loads ray

    obstacle = shared_memory_obstacle()
    if not obstacle:
        yield Finding("streams", "sockets and shared memory between actors of this host")
    else:
        text = "shared memory not available; frames go through Ray's object store"
        yield Finding("streams", text, ok=False, remedy=obstacle)


def _renderer() -> Iterator[Finding]:
    from panda3d.core import PandaSystem  # noqa: PLC0415 - slow to load

    yield Finding("renderer", f"panda3d {PandaSystem.getVersionString()}, in software")


def _ports() -> Iterator[Finding]:
    added = {port: use for one in extensions().values() for port, use in one.ports.items()}
    for port, use in {**_PORTS, **added}.items():
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            try:
                probe.bind(("127.0.0.1", port))
                yield Finding(f"UDP {port}", f"free ({use})")
            except OSError as error:
                remedy = f"end the program that holds it: ss -ulpn 'sport = :{port}'"
                yield Finding(f"UDP {port}", f"{error.strerror} ({use})", ok=False, remedy=remedy)


def _cluster(address: str | None) -> Iterator[Finding]:
    from aerodaas.actors.cluster import ray_cluster as cluster  # noqa: PLC0415 - loads ray

    where = address or os.environ.get("RAY_ADDRESS")
    try:
        cluster.connect(address)
        kinds = ", ".join(resource.kind for resource in cluster.discover())
        yield Finding("Ray", f"cluster at {where}: {kinds}" if where else f"starts here: {kinds}")
    except AeroDaaSError as error:
        yield Finding("Ray", str(error), ok=False)
    finally:
        cluster.disconnect()
