"""A provider's service under load: commands, watchers, submissions, and its memory.

    python benchmarks/service.py
    python benchmarks/service.py --drones 50 --watchers 200 --missions 2000

starts `aerodaas serve` in a process of its own, flies one mission of so many simulated drones in
real time, watches it by WebSocket, and measures over real loopback sockets from another process;
and how busy the processes are meanwhile.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import re
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated, Any, TypeVar

import numpy as np
import psutil
import typer
from _report import Report
from _served import served
from rich.progress import track
from websockets.asyncio.client import connect

from aerodaas.environment.provider.client import ProviderClient
from aerodaas.errors import AeroDaaSError
from aerodaas.protocol.schemas import CommandIn, MissionIn

T = TypeVar("T")
UNITS = {"count": "", "median": "ms", "p99": "ms", "rate": "per s"}
_COMMANDS = 500
_EVERY = 0.02
"""Seconds between two commands, and between two looks at a mission."""
_SPACING = 6.0
"""Metres from drone to drone."""
_SHARE_SECONDS = 8.0
"""Seconds over which the processor's shares are measured."""
_KINDS = {
    "service": r" aerodaas serve ",
    "flight": r" aerodaas\.flights ",
    "drones": r"^ray::DroneActor",
    "recorder": r"^ray::RecorderActor",
}
"""Patterns of command lines, by kind of process."""


def environment(drones: int) -> dict[str, Any]:
    """So many simulated drones in a row, without cameras."""
    robots = [
        {
            "id": f"d{number}",
            "start": [_SPACING * number, 0, 0],
            "sensors": [{"id": "odometry", "type": "odometry", "rate": 1}],
        }
        for number in range(drones)
    ]
    return {
        "name": "load",
        "robots": robots,
        "compute": [{"id": "edge", "kind": "edge"}],
        "recording": {"enabled": True},
        "simulation": {"world": "empty"},
    }


def document(drones: int) -> dict[str, Any]:
    """Each drone flies to and fro on a line of its own, for many minutes."""
    navigation = [
        {
            "robot": f"d{number}",
            "waypoints": [
                {
                    "id": f"w{turn}",
                    "x": _SPACING * number,
                    "y": 40.0 * (turn % 2),
                    "z": 2.0,
                    "waypoint_type": "local",
                }
                for turn in range(1, 20)
            ],
        }
        for number in range(drones)
    ]
    return {"format": "aerodaas-mission", "version": 1, "name": "load", "navigation": navigation}


async def watch(url: str, token: str, watchers: int, seconds: float) -> list[float]:
    """Watch a mission by so many connections; returns the messages a second of each."""
    headers = {"Authorization": f"Bearer {token}"}

    async def one() -> float:
        count = 0
        async with connect(url, additional_headers=headers, proxy=None, max_size=None) as socket:
            until = time.monotonic() + seconds
            while (left := until - time.monotonic()) > 0:
                with contextlib.suppress(asyncio.TimeoutError):
                    await asyncio.wait_for(socket.recv(), left)
                    count += 1
        return count / seconds

    return list(await asyncio.gather(*(one() for _ in range(watchers))))


def commands(client: ProviderClient, mission: str, robot: str, count: int) -> list[float]:
    """Milliseconds of so many commands, from the client to the drone's loop and back."""
    times = []
    for number in range(count):
        word: Any = "pause" if number % 2 == 0 else "resume"
        began = time.perf_counter()
        client.command(mission, CommandIn(robot=robot, command=word))
        times.append(1e3 * (time.perf_counter() - began))
        # Between two turns of the drone's loop, at any moment.
        time.sleep(_EVERY * (0.5 + number % 7 / 7))
    return times


def busy(service: int) -> str:
    """How much of a core each kind of process takes, and its memory."""
    before, began = _used(service), time.monotonic()
    time.sleep(_SHARE_SECONDS)
    after, elapsed = _used(service), time.monotonic() - began
    parts = []
    for kind in (*_KINDS, "other"):
        found = [(one, before[number][1]) for number, one in after.items() if number in before]
        mine = [(one, seconds) for one, seconds in found if one[0] == kind]
        share = sum(one[1] - seconds for one, seconds in mine) / elapsed
        memory = sum(one[2] for one, _ in mine)
        parts.append(f"{kind} {len(mine)} x {share / max(1, len(mine)):.0%} ({memory:.0f} MB)")
    return ", ".join(parts)


def _used(service: int) -> dict[int, tuple[str, float, float]]:
    """Kind, processor seconds and own megabytes of the service's processes, by number."""
    root = psutil.Process(service)
    found = {}
    for process in (root, *root.children(recursive=True)):
        with contextlib.suppress(psutil.Error):
            line, times = " ".join(process.cmdline()), process.cpu_times()
            kind = next((kind for kind, one in _KINDS.items() if re.search(one, line)), "other")
            memory = process.memory_info()
            own = (memory.rss - memory.shared) / 1e6
            found[process.pid] = kind, times.user + times.system, own
    return found


def show_flight(report: Report, drones: int, watchers: int, seconds: float) -> None:
    """Fly so many drones, command one, and watch them."""
    with served(environment(drones)) as (client, token, number):
        wanted = MissionIn.model_validate({"document": document(drones), "minutes": 30})
        mission = client.submit(wanted).id
        try:
            show_mission(report, client, token, number, mission, watchers, seconds)
        finally:
            # A flight outlives its service.
            with contextlib.suppress(AeroDaaSError):
                client.cancel(mission)
            while client.mission(mission).ended is None:
                time.sleep(0.5)


def show_mission(
    report: Report,
    client: ProviderClient,
    token: str,
    service: int,
    mission: str,
    watchers: int,
    seconds: float,
) -> None:
    """Command a drone of a flying mission, unwatched and watched; `service` is its process' id."""
    while not (found := client.mission(mission)).status or any(
        one.mission.state != "enroute" for one in found.status.values()
    ):
        if found.reason and found.ended:
            raise SystemExit(found.reason)
        time.sleep(0.5)
    report.note(f"of a core, unwatched: {busy(service)}")
    row(report, f"command, {len(found.status)} drones", commands(client, mission, "d0", _COMMANDS))
    watching_seconds = seconds + _SHARE_SECONDS
    url = f"{client.address.websocket}/v1/missions/{mission}/live?rate=5"
    with subprocess.Popen(  # noqa: S603 - this very file, so that watching has a process
        [sys.executable, __file__, "watch", url, token, str(watchers), str(watching_seconds)],
        stdout=subprocess.PIPE,
        text=True,
    ) as watching:
        time.sleep(min(5.0, seconds / 3))
        shares = busy(service)
        times = commands(client, mission, "d0", round((seconds - 5.0) / _EVERY / 2))
        rates = json.loads(watching.communicate()[0])
    row(report, f"the same, {watchers} watch at 5 Hz", times)
    report.note(f"of a core, watched: {shares}")
    report.note(
        f"watchers received {np.median(rates):.1f} states a second (median), "
        f"{min(rates):.1f} the slowest"
    )


def show_submissions(report: Report, missions: int) -> None:
    """Submit and cancel so many missions, and look at the service's memory."""
    with served(environment(1), "--approval") as (client, _, number):
        process = psutil.Process(number)
        wanted = MissionIn.model_validate({"document": document(1)})
        times, memory = [], []
        for _ in track(range(missions), "submissions", transient=True):
            began = time.perf_counter()
            mission = _patiently(lambda: client.submit(wanted)).id
            times.append(1e3 * (time.perf_counter() - began))
            _patiently(partial(client.cancel, mission))
            memory.append(process.memory_info().rss / 1e6)
        row(report, "submission", times)
        tenth = max(1, missions // 10)
        report.note(
            f"the service's memory: {np.median(memory[tenth : 2 * tenth]):.0f} MB after a tenth of "
            f"{missions} missions, {np.median(memory[-tenth:]):.0f} MB at the end"
        )


def _patiently(ask: Callable[[], T]) -> T:
    """Ask, and again where the account asks too often."""
    while (found := _asked(ask)) is None:
        time.sleep(_EVERY)
    return found


def _asked(ask: Callable[[], T]) -> T | None:
    try:
        return ask()
    except AeroDaaSError:
        return None


def row(report: Report, case: str, times: list[float]) -> None:
    """Add the figures of one case, from milliseconds."""
    found = np.array(times)
    report.row(
        case,
        {
            "count": len(found),
            "median": float(np.median(found)),
            "p99": float(np.quantile(found, 0.99)),
            "rate": 1e3 / float(np.mean(found)),
        },
    )


def main(
    drones: Annotated[int, typer.Option(min=1, help="Drones of the mission.")] = 5,
    watchers: Annotated[int, typer.Option(min=1, help="WebSocket clients.")] = 50,
    missions: Annotated[int, typer.Option(min=20, help="Submissions.")] = 200,
    seconds: Annotated[float, typer.Option(min=10, help="Seconds of watching.")] = 15.0,
    json_file: Annotated[Path | None, typer.Option("--json", help="Write figures here.")] = None,
) -> None:
    """Measure a provider's service, all on this machine."""
    report = Report("service", UNITS, packages=["fastapi", "uvicorn", "sqlalchemy", "websockets"])
    show_flight(report, drones, watchers, seconds)
    show_submissions(report, missions)
    report.show()
    if json_file is not None:
        report.write(json_file)


if __name__ == "__main__":
    if sys.argv[1:2] == ["watch"]:
        _, _, where, secret, number, duration = sys.argv
        print(json.dumps(asyncio.run(watch(where, secret, int(number), float(duration)))))
    else:
        typer.run(main)
