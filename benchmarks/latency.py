"""From a frame's capture to the drone's command, beside the same four nodes in dora.

1280 x 720 frames at 30 per second pass through four processes: a camera, an analysis that reads
the frame, navigation, and the drone. Both systems run in turn on this machine, several rounds
each, and the medians over the rounds are shown. `pip install -e '.[benchmarks]'` brings dora.
"""

from __future__ import annotations

import json
import math
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import aerodaas.actors  # noqa: F401 - sets what Ray reads as it is imported

# isort: split
import numpy as np
import psutil
import ray
import typer
from _latency_ours import (
    HEIGHT,
    RATE,
    WIDTH,
    PatternCamera,
    ReadFrame,
    StampedVehicle,
    Steer,
)
from _latency_ray import frames_by_ray
from _report import Report
from ray.cluster_utils import Cluster
from rich.progress import Progress

from aerodaas import Environment
from aerodaas.config.options import RunOptions, current_options

_DORA = Path(sys.executable).with_name("dora")
_DORA_NODE = Path(__file__).parent / "_latency_dora.py"
_WARM_UP = 3.0
UNITS = {"median": "ms", "p99": "ms", "cpu": "% of a core", "frames": ""}


@dataclass(frozen=True)
class Round:
    """One round of one system."""

    latencies: list[float]
    """Milliseconds from capture to command."""
    cpu: float
    """Per cent of one core, all processes of the system together."""


def _processes(root: psutil.Process) -> list[psutil.Process]:
    return [root, *root.children(recursive=True)]


def _cpu_seconds(processes: list[psutil.Process]) -> float:
    total = 0.0
    for process in processes:
        try:
            times = process.cpu_times()
        except psutil.NoSuchProcess:
            continue
        total += times.user + times.system
    return total


def _environment(folder: Path, *, far: bool) -> Path:
    plugin, vehicle = (
        f"{one.__module__}:{one.__name__}" for one in (PatternCamera, StampedVehicle)
    )
    camera = {"id": "camera", "type": "camera", "driver": plugin, "rate": RATE}
    content = {
        "name": "latency",
        "robots": [{"id": "drone", "driver": vehicle, "sensors": [camera]}],
        "compute": [{"id": "place", "kind": "cloud" if far else "edge"}],
        "recording": {"enabled": False},
    }
    path = folder / "latency.json"
    path.write_text(json.dumps(content), encoding="utf-8")
    return path


def measure_ours(seconds: float, folder: Path, *, far: bool = False) -> Round:
    """Fly the four actors for `seconds`; `far` puts the analysis on another Ray node."""
    current_options.set(RunOptions(speed=1.0, simulated_time=False, view=False))
    env = Environment(_environment(folder, far=far))
    drone = env.get_robot_by_id("drone")
    frames = drone.get_sensor_by_id("camera").get_data_stream()
    place = env.get_compute_resource_by_id("place")
    drone.navigate(Steer().analyse(ReadFrame().deploy(place).analyse(frames)))
    drone.start_mission(wait=False)
    assert env.run is not None  # noqa: S101 - just started
    time.sleep(_WARM_UP)
    system = _processes(psutil.Process())
    began, cpu = time.monotonic(), _cpu_seconds(system)
    # The application's process watches the flight here as it does in `start_mission`.
    newest: Any = None
    while time.monotonic() < began + seconds:
        newest = env.run.poll(newest=int(seconds * RATE))
        time.sleep(0.2)
    used = (_cpu_seconds(system) - cpu) / (time.monotonic() - began)
    drone.end_mission()
    drone.wait()
    return Round(list(newest.robots["drone"].latencies), 100 * used)


def measure_dora(seconds: float, folder: Path) -> Round:
    """Run the same four nodes in dora."""
    result = folder / "dora.json"
    result.unlink(missing_ok=True)
    script = str(_DORA_NODE)
    frames = int((seconds + _WARM_UP) * RATE)
    inputs = {
        "camera": {"tick": f"dora/timer/hz/{RATE}"},
        "read": {"frame": "camera/frame"},
        "steer": {"reading": "read/reading"},
        "drone": {"command": "steer/command"},
    }
    outputs = {"camera": ["frame"], "read": ["reading"], "steer": ["command"], "drone": []}
    nodes = [
        {
            "id": name,
            "path": sys.executable,
            "args": f"{script} {name}",
            "inputs": {key: {"source": source, "queue_size": 1} for key, source in wires.items()},
            "outputs": outputs[name],
            "env": {"LATENCY_FRAMES": str(frames), "LATENCY_RESULT": str(result)},
        }
        for name, wires in inputs.items()
    ]
    flow = folder / "dataflow.yml"
    flow.write_text(json.dumps({"nodes": nodes}), encoding="utf-8")  # JSON is YAML, too
    with subprocess.Popen(  # noqa: S603 - our own command
        [str(_DORA), "run", str(flow)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    ) as process:
        time.sleep(_WARM_UP)
        system = _processes(psutil.Process(process.pid))
        began, cpu = time.monotonic(), _cpu_seconds(system)
        time.sleep(seconds - 1.0)
        used = (_cpu_seconds(system) - cpu) / (time.monotonic() - began)
        process.wait(timeout=60)
    ages = json.loads(result.read_text(encoding="utf-8"))
    return Round(ages[-int(seconds * RATE) :], 100 * used)


def measure_ray(seconds: float) -> Round:
    """Send the same bytes to an actor on the other node, by a Ray call and nothing else."""
    if not ray.is_initialized():
        ray.init(address=os.environ["RAY_ADDRESS"], log_to_driver=False)
    ages = frames_by_ray(int((_WARM_UP + seconds) * RATE), ("edge", "cloud"))
    return Round(ages[-int(seconds * RATE) :], math.nan)


def _add(report: Report, name: str, rounds: list[Round]) -> None:
    medians = [float(np.median(one.latencies)) for one in rounds]
    highs = [float(np.percentile(one.latencies, 99)) for one in rounds]
    report.row(
        name,
        {
            "median": statistics.median(medians),
            "p99": statistics.median(highs),
            "cpu": statistics.median(one.cpu for one in rounds),
            "frames": sum(len(one.latencies) for one in rounds),
        },
    )


def _ratios(ours: list[Round], theirs: list[Round]) -> str:
    pairs = [
        (
            np.median(a.latencies) / np.median(b.latencies),
            np.percentile(a.latencies, 99) / np.percentile(b.latencies, 99),
            a.cpu / b.cpu,
        )
        for a, b in zip(ours, theirs, strict=True)
    ]
    middle, high, cpu = (statistics.median(ratio) for ratio in zip(*pairs, strict=True))
    return f"latency {middle:.2f}, p99 {high:.2f}, CPU {cpu:.2f}"


@contextmanager
def _two_nodes() -> Iterator[None]:
    cluster = Cluster(
        initialize_head=True, head_node_args={"num_cpus": 1, "resources": {"edge": 1}}
    )
    cluster.add_node(num_cpus=1, resources={"cloud": 1})
    os.environ["RAY_ADDRESS"] = str(cluster.address)
    try:
        yield
    finally:
        del os.environ["RAY_ADDRESS"]
        ray.shutdown()
        cluster.shutdown()


def main(
    seconds: Annotated[float, typer.Option(min=2, help="Seconds measured in each round.")] = 10.0,
    rounds: Annotated[int, typer.Option(min=1, help="Rounds of each system, in turn.")] = 3,
    dora: Annotated[bool, typer.Option(help="Measure dora beside it.")] = True,  # noqa: FBT002
    json_path: Annotated[Path | None, typer.Option("--json", help="Write the figures.")] = None,
) -> None:
    """Measure capture-to-command latency and CPU, ours beside dora's.

    python benchmarks/latency.py --seconds 10 --rounds 3 --json latency.json
    """
    if dora and not _DORA.is_file():
        remedy = "pip install -e '.[benchmarks]', or give --no-dora"
        raise typer.BadParameter(f"dora is missing: {remedy}")
    title = f"capture to command, {WIDTH}x{HEIGHT} at {RATE}/s, camera-analytics-navigation-drone"
    packages = ("ray", *(("dora-rs",) if dora else ()))
    report = Report(title, UNITS, packages=packages)
    ours: list[Round] = []
    theirs: list[Round] = []
    with tempfile.TemporaryDirectory() as name, Progress() as progress:
        folder = Path(name)
        task = progress.add_task("measuring", total=rounds * (2 if dora else 1) + 2)
        for _ in range(rounds):
            ours.append(measure_ours(seconds, folder))
            progress.advance(task)
            if dora:
                theirs.append(measure_dora(seconds, folder))
                progress.advance(task)
        ray.shutdown()
        with _two_nodes():
            far = [measure_ours(seconds, folder, far=True)]
            progress.advance(task)
            by_ray = [measure_ray(seconds)]
            progress.advance(task)
    _add(report, "AeroDaaS, one node", ours)
    if theirs:
        _add(report, "dora, one node", theirs)
        report.note(f"ours over dora's, medians of pairs: {_ratios(ours, theirs)}")
    _add(report, "AeroDaaS, analysis on a second Ray node", far)
    _add(report, "Ray alone, a frame's bytes to a second node", by_ray)
    report.note("CPU: all processes of the system together, Ray's own included; 100 % = one core")
    report.show()
    if json_path is not None:
        report.write(json_path)


if __name__ == "__main__":
    typer.run(main)
