"""One flight of a mission by the command line, as a user flies it, with its remote user."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import psutil

from aerodaas.geometry.frames import GeodeticOrigin
from aerodaas.recording.reader import Recording
from aerodaas.simulation.phone import write_log
from aerodaas.simulation.scenario import load_scenario
from aerodaas.simulation.world import World
from missions.catalogue import ADDED, Mission

__all__ = ["Flown", "fly"]

_ROOT = Path(__file__).resolve().parents[2]
_LOOK = 2.0
"""Seconds between two looks at the memory."""


@dataclass(frozen=True, slots=True)
class Flown:
    """How a flight by the command line ended."""

    recording: Path
    code: int
    """Exit status."""
    output: str
    memory: float
    """Most bytes (PSS) of all its processes together."""
    wall: float
    """Seconds on the wall from the mission's begin to the recording's end."""


def fly(
    mission: Mission,
    seed: int,
    folder: Path,
    *,
    speed: str = "max",
    settings: Mapping[str, object] | None = None,
    environment: Path | None = None,
    options: Sequence[str] = (),
    timeout: float = 1800.0,
) -> Flown:
    """Fly `mission` into `folder`, which must be empty or new; raises TimeoutExpired.

    `options` are further ones of `aerodaas run`.
    """
    folder.mkdir(parents=True, exist_ok=True)
    port = _free_port()
    laid_over: dict[str, object] = {"remote.port": port, **(settings or {})}
    if mission.name == "situation_awareness":
        laid_over["phone.path"] = str(_phone(folder, seed))
    command = [sys.executable, "-m", "aerodaas", "run", str(mission.application), "--no-view"]
    command += ["--seed", str(seed), "--speed", speed, "--record", str(folder / "flight")]
    command += ["--env", str(environment)] if environment else []
    command += options
    for name, value in laid_over.items():
        text = value if isinstance(value, str) else json.dumps(value)
        command += ["--set", f"{name}={text}"]
    paths = [str(_ROOT), os.environ.get("PYTHONPATH", "")]
    variables = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))}
    log = folder / "output.txt"
    with log.open("w") as output, _remote_user(mission, port, folder, variables):
        process = subprocess.Popen(  # noqa: S603 - our own command
            command, cwd=folder, env=variables, stdout=output, stderr=subprocess.STDOUT
        )
        memory = _watch(process, time.monotonic() + timeout)
    path = folder / "flight" / "flight.mcap"
    wall = path.stat().st_mtime - _began(path) if path.exists() else 0.0
    return Flown(path, process.returncode, log.read_text(), memory, wall)


def _watch(process: subprocess.Popen[bytes], until: float) -> float:
    """Wait for the end; returns the most memory that was seen."""
    most = 0.0
    while True:
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(_LOOK)
            return most
        most = max(most, _memory(process.pid))
        if time.monotonic() > until:
            process.send_signal(signal.SIGINT)
            process.wait(90)
            return most


def _memory(pid: int) -> float:
    total = 0.0
    with contextlib.suppress(psutil.NoSuchProcess):
        root = psutil.Process(pid)
        for one in [root, *root.children(recursive=True)]:
            with contextlib.suppress(psutil.NoSuchProcess):
                total += one.memory_full_info().pss
    return total


@contextlib.contextmanager
def _remote_user(
    mission: Mission, port: int, folder: Path, variables: Mapping[str, str]
) -> Iterator[None]:
    if not mission.remote_user:
        yield
        return
    script = Path(__file__).with_name("remote_user.py")
    words = [sys.executable, str(script), f"http://127.0.0.1:{port}", json.dumps(ADDED)]
    with (folder / "remote_user.txt").open("w") as output:
        user = subprocess.Popen(words, env=variables, stdout=output, stderr=subprocess.STDOUT)  # noqa: S603
        try:
            yield
        finally:
            user.terminate()
            user.wait()


def _phone(folder: Path, seed: int) -> Path:
    """The log that the person's phone would have written in this seed's world."""
    path = folder / "vip_log.csv"
    world = World(load_scenario("campus"), seed)
    write_log(path, world, "vip", GeodeticOrigin(13.0166, 77.5695, 920.0), 300.0)
    return path


def _began(path: Path) -> float:
    with Recording.open(path) as recording:
        return recording.epoch_ns / 1e9


def _free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as server:
        return int(server.getsockname()[1])
