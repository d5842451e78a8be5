"""Flights of the baselines: programs without AeroDaaS, on emulated vehicles, judged alike.

A baseline says what it does by the words of a mission's states, one line each (`enroute wp1`,
`alert fall`); where the vehicle is meanwhile is the emulator's truth.
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import threading
import time
import urllib.request
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, TypeAlias

import numpy as np
from _ports import free_port

from aerodaas.cameras.settings import camera_settings
from aerodaas.config.model import EnvironmentConfig
from aerodaas.geometry.frames import GeodeticOrigin
from aerodaas.messages.odometry import Odometry
from aerodaas.recording.report.flight import Band, RecordedFlight, RobotFlight
from aerodaas.simulation.phone import write_log
from aerodaas.simulation.world import World
from missions.catalogue import ADDED, APPS, MISSIONS
from missions.criteria import Check
from missions.evidence import Evidence
from missions.witness import Witness
from tools.mavlink_vehicle import AutopilotOptions, EmulatedAutopilot
from tools.tello_vehicle import EmulatedTello, TelloOptions, VideoOptions
from tools.tello_vehicle.video import VideoStream

__all__ = ["BASELINES", "Baseline", "PlainFlight", "fly"]

Place: TypeAlias = tuple[float, float, float]
Line: TypeAlias = tuple[float, str]
"""Seconds of the world, and what a program said then."""

_BENCHMARKS = Path(__file__).resolve().parents[1]
_STATES = frozenset(
    {
        *("taking_off", "enroute", "loitering", "diverted", "following"),
        *("holding", "returning", "landing", "landed"),
    }
)
_ENOUGH = 2
"""Waypoints that are visited when the remote user adds theirs."""
_RATE = 15
"""Pictures a second; a key frame begins each second, as a Tello's do."""
_PHONE = 300.0
"""Seconds that the phone's log lasts."""


@dataclass(frozen=True, slots=True)
class Baseline:
    """One program: whose mission it flies, by which library, in which environment's world."""

    mission: str
    sdk: Literal["pymavlink", "mavsdk", "djitellopy"]
    environment: str
    places: Mapping[str, Place] = field(default_factory=dict)
    """Its waypoints."""
    folder: Path = _BENCHMARKS / "baselines"

    @property
    def name(self) -> str:
        """Mission and library."""
        return f"{self.mission}_{self.sdk}"

    @property
    def script(self) -> Path:
        """Its file."""
        return self.folder / f"{self.name}.py"

    @property
    def python(self) -> str:
        """The interpreter that has its library; empty where the environment names none."""
        named = {"mavsdk": "AERODAAS_MAVSDK", "djitellopy": "AERODAAS_DJITELLOPY"}.get(self.sdk)
        return sys.executable if named is None else os.environ.get(named, "")


def _level(height: float, **places: tuple[float, float]) -> dict[str, Place]:
    return {name: (x, y, height) for name, (x, y) in places.items()}


_FARM = _level(1.5, wp1=(0, 0), wp2=(0, 10), wp3=(10, 10), wp4=(10, 0))
_DISASTER = _level(1.5, wp1=(0, 0), wp2=(10, 0), wp3=(10, 10), wp4=(0, 10))
_REMOTE = {f"remote{number}": place for number, place in enumerate(ADDED, start=1)}
_VEHICLE = _level(4.0, wp1=(0, 12), wp2=(12, 0), wp3=(30, 8))
_RESCUE = _level(1.5, wp1=(0, 12), wp2=(14, 13), wp3=(24, 26), wp4=(0, 26))
_TOWER = _level(3.0, wp1=(-12, 0), wp2=(-12, 16), wp3=(12, 16), wp4=(12, 0))

BASELINES = {
    one.name: one
    for one in (
        Baseline("farm_survey", "pymavlink", "farm", _FARM),
        Baseline("farm_survey", "mavsdk", "farm", _FARM),
        Baseline("disaster_survey", "pymavlink", "disaster", {**_DISASTER, **_REMOTE}),
        Baseline("situation_awareness", "djitellopy", "campus"),
        Baseline("vehicle_tracking", "pymavlink", "vehicle", _VEHICLE),
        Baseline("search_and_rescue", "djitellopy", "rescue", _RESCUE),
        Baseline("tower_inspection", "pymavlink", "tower", _TOWER),
    )
}


@dataclass(frozen=True, slots=True)
class PlainFlight:
    """How a baseline's flight ended."""

    code: int
    """Exit status."""
    lines: tuple[Line, ...]
    errors: str
    evidence: Evidence

    def judge(self, mission: str) -> list[Check]:
        """Hold it against the criteria of the application's own flights."""
        return [criterion(self.evidence) for criterion in MISSIONS[mission].criteria]


@dataclass(frozen=True, slots=True)
class _Stage:
    """An emulated vehicle that is switched on, and how a program is pointed at it."""

    truth: Callable[[], Odometry]
    clock: Callable[[], float | None]
    """The world's seconds; None before its time begins."""
    launcher: tuple[str, ...]
    arguments: tuple[str, ...]
    remote: str = ""
    """Address at which the program takes a remote user's waypoints, if it does."""


def fly(
    baseline: Baseline,
    folder: Path,
    *,
    seed: int = 0,
    pace: float = 1.0,
    timeout: float = 500.0,
) -> PlainFlight:
    """Fly a baseline on an emulated vehicle, its files in `folder`.

    The program's clocks run at `pace`, at which this process must run, too. A program that takes
    longer than `timeout` seconds of that time is ended.
    """
    folder.mkdir(parents=True, exist_ok=True)
    document = EnvironmentConfig.load(APPS / "environments" / f"{baseline.environment}.json")
    simulation = document.simulation.model_copy(update={"seed": seed})
    environment = document.model_copy(update={"simulation": simulation})
    stage = _tello if baseline.sdk == "djitellopy" else _autopilot
    with (
        stage(baseline, environment, folder) as staged,
        Witness(staged.truth, staged.clock) as witness,
    ):
        paced = [baseline.python, str(_BENCHMARKS / "_pace.py"), str(pace)]
        words = [*paced, *staged.launcher, str(baseline.script), *staged.arguments]
        code, lines = _run(words, folder, staged, timeout / pace)
    np.savetxt(folder / "truth.csv", witness.table, "%.3f", ",", header="t,x,y,z,vx,vy,vz")
    errors = (folder / "errors.txt").read_text(encoding="utf-8")
    return PlainFlight(code, lines, errors, _evidence(baseline, environment, witness, lines))


@contextlib.contextmanager
def _tello(baseline: Baseline, environment: EnvironmentConfig, folder: Path) -> Iterator[_Stage]:
    options = TelloOptions(
        video=VideoOptions(width=640, height=480, rate=_RATE, key_interval=_RATE)
    )
    arguments: tuple[str, ...] = ()
    if baseline.mission == "situation_awareness":
        log = folder / "vip_log.csv"
        world = World.load(environment.simulation)
        write_log(log, world, "vip", GeodeticOrigin(13.0166, 77.5695, 920.0), _PHONE)
        arguments = (str(log),)
    with EmulatedTello(options.placed(environment)) as tello:

        def clock() -> float | None:
            return None if tello.film_began is None else time.monotonic() - tello.film_began

        launcher = (str(_BENCHMARKS / "_tello_here.py"), str(tello.port))
        yield _Stage(lambda: tello.truth, clock, launcher, arguments)


@contextlib.contextmanager
def _autopilot(
    baseline: Baseline, environment: EnvironmentConfig, folder: Path
) -> Iterator[_Stage]:
    robot, simulation = environment.robots[0], environment.simulation
    port, video, remote = free_port(), free_port(), free_port()
    options = AutopilotOptions(
        family="px4" if baseline.sdk == "mavsdk" else "ardupilot",
        peer=("127.0.0.1", port),
        start=robot.start,
        start_yaw=robot.start_yaw,
        noise=simulation.sensor_noise,
        wind=simulation.wind,
        gust=simulation.gust,
        seed=simulation.seed,
    )
    began = time.monotonic()
    scheme = "udpin://" if baseline.sdk == "mavsdk" else "udpin:"
    seen, url = f"udp://127.0.0.1:{video}", f"{scheme}127.0.0.1:{port}"
    arguments = {
        "farm_survey": (url,),
        "disaster_survey": (url, seen, str(remote)),
        "vehicle_tracking": (url, seen),
        "tower_inspection": (url, seen, str(folder / "pictures")),
    }[baseline.mission]
    with EmulatedAutopilot(options) as autopilot, contextlib.ExitStack() as stack:
        if seen in arguments:
            stack.enter_context(_film(environment, autopilot, video))
        address = f"http://127.0.0.1:{remote}" if str(remote) in arguments else ""
        yield _Stage(
            lambda: autopilot.truth, lambda: time.monotonic() - began, (), arguments, address
        )


@contextlib.contextmanager
def _film(
    environment: EnvironmentConfig, autopilot: EmulatedAutopilot, port: int
) -> Iterator[None]:
    """Stream the robot's first camera as H.264 by UDP, as companions of autopilots do."""
    sensor = next(one for one in environment.robots[0].sensors if one.type == "camera")
    camera = camera_settings(sensor)
    video = VideoOptions(
        world=environment.simulation.world,
        seed=environment.simulation.seed,
        width=camera.width,
        height=camera.height,
        rate=_RATE,
        key_interval=_RATE,
        horizontal_fov=camera.horizontal_fov,
        pitch=camera.pitch,
    )
    stream = VideoStream(TelloOptions(video=video), (("127.0.0.1", port),), lambda: autopilot.truth)
    stream.start()
    try:
        yield
    finally:
        stream.stop()


def _run(
    words: list[str], folder: Path, stage: _Stage, timeout: float
) -> tuple[int, tuple[Line, ...]]:
    lines: list[Line] = []
    with (folder / "errors.txt").open("w") as errors, (folder / "output.txt").open("w") as output:
        process = subprocess.Popen(  # noqa: S603 - our own programs
            words,
            cwd=folder,
            env={**os.environ, "PYTHONUNBUFFERED": "1"},
            stdout=subprocess.PIPE,
            stderr=errors,
            text=True,
        )
        timer = threading.Timer(timeout, process.kill)
        timer.start()
        try:
            asked = not stage.remote
            assert process.stdout is not None  # noqa: S101 - asked for a pipe
            for text in process.stdout:
                lines.append((stage.clock() or 0.0, text.strip()))
                print(f"{lines[-1][0]:.2f} {lines[-1][1]}", file=output, flush=True)
                if not asked and sum(line.startswith("loitering") for _, line in lines) >= _ENOUGH:
                    asked = True
                    _add_waypoints(stage.remote)
            return process.wait(), tuple(lines)
        finally:
            timer.cancel()
            process.kill()
            process.wait()


def _add_waypoints(address: str) -> None:
    body = json.dumps([[name, *place] for name, place in _REMOTE.items()]).encode()
    request = urllib.request.Request(f"{address}/waypoints", body)  # noqa: S310 - ours, by http
    urllib.request.urlopen(request, timeout=10).close()  # noqa: S310


def _evidence(
    baseline: Baseline,
    environment: EnvironmentConfig,
    witness: Witness,
    lines: Sequence[Line],
) -> Evidence:
    """What the program said stands for a recording's mission states and alerts."""
    table = witness.table
    said = [(at, *text.partition(" ")[::2]) for at, text in lines]
    states = [(at, word, rest) for at, word, rest in said if word in _STATES]
    ends = [*(at for at, _, _ in states[1:]), float(table[-1, 0]) if len(table) else 0.0]
    robot = RobotFlight(
        bands=[
            Band(word, at, end, rest) for (at, word, rest), end in zip(states, ends, strict=False)
        ],
        plan=dict(baseline.places),
        visited=tuple(rest for _, word, rest in states if word == "loitering"),
    )
    alerts = [(at, "alert", rest) for at, word, rest in said if word == "alert"]
    return Evidence(
        RecordedFlight(alerts=alerts),
        robot,
        environment.robots[0],
        World.load(environment.simulation),
        table[:, 0],
        table[:, 1:4],
        table[:, 4:7],
    )
