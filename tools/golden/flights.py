"""The golden flights, each flown by the command line as a user would fly it."""

from __future__ import annotations

import json
import os
import re
import shutil
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tools.golden.summary import milestones, summary

__all__ = ["FLIGHTS", "FlightFailedError", "GoldenFlight"]

_COMMAND = Path(sys.executable).with_name("aerodaas")
_LONGEST = 900
"""Seconds of the clock that one flight may take."""
_HERE = Path(__file__).parent
_ROOT = _HERE.parents[1]
_BY_PROCESSOR, _BY_CLOCK = 0.5, 1.5
"""Metres by which flights may differ: those that a network steers, whose last digits depend on the
processor (onnxruntime chooses its kernels by it), and those that go by the wall clock."""
_SIX = {
    "disaster_survey": 0.0,
    "farm_survey": 0.0,
    "search_and_rescue": _BY_PROCESSOR,
    "situation_awareness": _BY_PROCESSOR,
    "tower_inspection": _BY_PROCESSOR,
    "vehicle_tracking": _BY_PROCESSOR,
}


class FlightFailedError(Exception):
    """A golden flight ended without what it is to be compared by."""


@dataclass(frozen=True)
class GoldenFlight:
    """A flight, and how exactly it repeats."""

    name: str
    fly: Callable[[Path], dict[str, Any]]
    """Flies in an empty folder and returns the summary."""
    near: float = 0.0
    """Metres by which it may differ from the one that is kept, where it is not equal."""

    @property
    def by_clock(self) -> bool:
        """Whether it goes by the wall clock, so that only its milestones are compared."""
        return self.near == _BY_CLOCK


def _flown(folder: Path, application: str | Path, *options: str) -> dict[str, Any]:
    _run(folder, "run", str(application), "--no-view", "--record", "out", *options)
    return summary(folder / "out" / "flight.mcap")


def _run(folder: Path, *words: str, **variables: str) -> str:
    ended = subprocess.run(  # noqa: S603 - this project's own words
        [str(_COMMAND), *words],
        cwd=folder,
        env={**os.environ, **variables},
        capture_output=True,
        text=True,
        timeout=_LONGEST,
        check=False,
    )
    if ended.returncode:
        told = "\n".join((ended.stdout + ended.stderr).splitlines()[-12:])
        raise FlightFailedError(f"aerodaas {' '.join(words)} ended with {ended.returncode}\n{told}")
    return ended.stdout


def _application(name: str, seed: int) -> Callable[[Path], dict[str, Any]]:
    # Seeds fly side by side, and one application serves a remote user.
    port = ("--set", f"remote.port={8350 + seed}")
    return lambda folder: _flown(folder, name, "--speed", "max", "--seed", str(seed), *port)


def _own(folder: Path) -> dict[str, Any]:
    for name in ("own.py", "own.json"):
        shutil.copy(_HERE / name, folder)
    return _flown(folder, "own.py", "--speed", "max", "--seed", "1")


def _with_execution_times(folder: Path) -> dict[str, Any]:
    times = ("--set", "simulation.execution_times=gamma:0.3")
    return _flown(folder, "situation_awareness", "--speed", "max", "--seed", "3", *times)


def _replayed(folder: Path) -> dict[str, Any]:
    """A flight with detections, whose recorded sensors go through its application again."""
    _flown(folder, "vehicle_tracking", "--speed", "max", "--seed", "1")
    application = _ROOT / "apps" / "vehicle_tracking.py"
    _run(folder, "replay", "out/flight.mcap", "--app", str(application), "--out", "again")
    return summary(folder / "again" / "flight.mcap")


def _emulated(family: str) -> Callable[[Path], dict[str, Any]]:
    def fly(folder: Path) -> dict[str, Any]:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind(("127.0.0.1", 0))
            port = str(probe.getsockname()[1])
        command = [sys.executable, "-m", "tools.mavlink_vehicle", "--family", family]
        vehicle = subprocess.Popen(  # noqa: S603 - this project's own words
            [*command, "--port", port, "--seed", "1"], cwd=_ROOT, stdout=subprocess.DEVNULL
        )
        try:
            url = f"udpin:127.0.0.1:{port}"
            settings = ("quadrotor_base.driver=mavlink", f"quadrotor_base.settings.url={url}")
            changes = [word for setting in settings for word in ("--set", setting)]
            return milestones(_flown(folder, "farm_survey", *changes))
        finally:
            vehicle.terminate()
            vehicle.wait()

    return fly


def _rehearsed(folder: Path) -> dict[str, Any]:
    """A mission that a provider rehearses, approves and flies: verdict and recording."""
    with _service(folder) as (address, token):
        said = _run(
            folder,
            *("submit", "farm_survey", "--to", address, "--seed", "2", "--json"),
            *("--no-view", "--record", "out"),
            AERODAAS_TOKEN=token,
        )
        mission = json.loads(said[said.index("{") :])["id"]
        request = urllib.request.Request(  # noqa: S310 - of this machine
            f"{address}/v1/missions/{mission}", headers={"Authorization": f"Bearer {token}"}
        )
        with urllib.request.urlopen(request) as answer:  # noqa: S310 - of this machine
            verdict = json.load(answer)["verdict"]
    verdict.pop("picture", None)
    return {"verdict": verdict, **summary(folder / "out" / "flight.mcap")}


@contextmanager
def _service(folder: Path) -> Iterator[tuple[str, str]]:
    """A provider of the farm's drone: its address, and its administrator's token."""
    log = folder / "service.log"
    fleet = _ROOT / "apps" / "environments" / "farm.json"
    words = ["serve", str(fleet), "--state", "state", "--port", "0", "--speed", "max"]
    with log.open("w") as output:
        service = subprocess.Popen(  # noqa: S603 - this project's own words
            [str(_COMMAND), *words], cwd=folder, stdout=output, stderr=subprocess.STDOUT
        )
    try:
        deadline = time.monotonic() + _LONGEST
        while not (found := re.search(r"(aerodaas_\S+)\n.* at (http\S+)\n", log.read_text())):
            if service.poll() is not None or time.monotonic() > deadline:
                raise FlightFailedError(f"the service did not start:\n{log.read_text()}")
            time.sleep(0.2)
        yield found[2], found[1]
    finally:
        service.terminate()
        service.wait()


def _all() -> Sequence[GoldenFlight]:
    exact = [
        GoldenFlight(f"{name}-{seed}", _application(name, seed), near)
        for name, near in _SIX.items()
        for seed in range(5)
    ]
    return (
        *exact,
        GoldenFlight("fleet_survey-0", _application("fleet_survey", 0)),
        GoldenFlight("own", _own),
        GoldenFlight("execution_times", _with_execution_times, _BY_PROCESSOR),
        GoldenFlight("replay", _replayed, _BY_PROCESSOR),
        GoldenFlight("rehearsal", _rehearsed),
        GoldenFlight("emulated_px4", _emulated("px4"), _BY_CLOCK),
        GoldenFlight("emulated_ardupilot", _emulated("ardupilot"), _BY_CLOCK),
    )


FLIGHTS = {flight.name: flight for flight in _all()}
