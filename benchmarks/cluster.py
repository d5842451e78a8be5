"""What an edge-cloud costs: from frame to result by distance, and after failures.

Brings up an edge and cloud nodes of network namespaces (root). For each round trip, one drone's
frames go to an analysis of fixed time and its results come back as commands. A plain TCP
connection that carries as many bytes over the same link tells what the link alone takes; what is
left after that and the analysis is the framework's.
"""

from __future__ import annotations

import contextlib
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from _cluster_apps import Steer, Work, environment, flying
from _cluster_failures import measure_recoveries
from _report import Report

from aerodaas.actors.cluster import ray_cluster
from tools.namespaces import EdgeCloud, Shape
from tools.namespaces.network import RemoteMachine
from tools.namespaces.shape import parse_bandwidth

_RATE = 5.0
_WARM_UP = 4.0
_PORT = 7001
UNITS = {"median": "ms", "p99": "ms", "link": "ms", "analysis": "ms", "framework": "ms"}
FAILURE_UNITS = {"back": "s", "longest gap": "s", "tasks lost": "", "state gap": "ms"}
# Answers one byte for each frame; its own waking up is part of what any program would pay.
_ECHO = """
import socket, sys
port, size = int(sys.argv[1]), int(sys.argv[2])
with socket.create_server(("", port)) as server:
    print("ready", flush=True)
    link, _ = server.accept()
    link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    left = size
    while data := link.recv(min(left, 1 << 16)):
        left -= len(data)
        if not left:
            link.sendall(b"x")
            left = size
"""


@contextlib.contextmanager
def _echo(far: RemoteMachine, size: int) -> Iterator[socket.socket]:
    words = far.machine.words(sys.executable, "-c", _ECHO, str(_PORT), str(size))
    with subprocess.Popen(words, stdout=subprocess.PIPE) as server:  # noqa: S603 - our own words
        assert server.stdout is not None  # noqa: S101 - asked for
        server.stdout.readline()
        with socket.create_connection((far.address, _PORT)) as link:
            link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            yield link


def measure_link(far: RemoteMachine, size: int, count: int = 20) -> float:
    """Median milliseconds of `size` bytes there and one back, at the camera's rate."""
    data, times = bytes(size), []
    with _echo(far, size) as link:
        for _ in range(count):
            began = time.perf_counter()
            link.sendall(data)
            link.recv(1)
            times.append((time.perf_counter() - began) * 1000)
            time.sleep(1.0 / _RATE)
    return statistics.median(times[count // 4 :])


def measure_way(
    address: str, folder: Path, place: str, size: tuple[int, int], seconds: float, work: float
) -> list[float]:
    """Milliseconds from capture to command with the analysis at `place`."""
    content = environment(1, _RATE, size, cloud=True, tasks={})
    with flying(content, folder, address) as env:
        drone = env.get_robot_by_id("drone0")
        frames = drone.get_sensor_by_id("camera0").get_data_stream()
        result = Work(work).deploy(env.get_compute_resource_by_id(place)).analyse(frames)
        drone.navigate(Steer().analyse(result))
        run = env.launch()
        time.sleep(_WARM_UP + seconds)
        wanted = max(1, int(seconds * _RATE))
        return list(run.poll(newest=wanted).robots["drone0"].latencies)


def _add(report: Report, case: str, latencies: list[float], link: float, work: float) -> None:
    median = float(np.median(latencies))
    figures = {"median": median, "p99": float(np.percentile(latencies, 99)), "link": link}
    figures |= {"analysis": work * 1000, "framework": median - link - work * 1000}
    report.row(case, figures)


def main(
    *,
    seconds: Annotated[float, typer.Option(min=2, help="Measured for each case.")] = 10.0,
    rtt: Annotated[str, typer.Option(help="Round trips in ms, by comma.")] = "20,40,100",
    bandwidth: Annotated[str, typer.Option(help="Of each link.")] = "100mbit",
    width: Annotated[int, typer.Option(help="Of a frame, 16:9.")] = 320,
    work: Annotated[float, typer.Option(help="Seconds of an analysis.")] = 0.02,
    failures: Annotated[bool, typer.Option(help="Measure recoveries, too.")] = True,
    json_path: Annotated[Path | None, typer.Option("--json", help="Write the figures.")] = None,
) -> None:
    """Measure frame-to-result latency over edge and cloud, and recovery times.

    sudo python benchmarks/cluster.py --seconds 10 --json cluster.json
    """
    size = (width, width * 9 // 16)
    rate = parse_bandwidth(bandwidth)
    title = f"frame to result, {size[0]}x{size[1]} raw at {_RATE:g}/s, links of {bandwidth}"
    report = Report(title, UNITS, packages=("ray",))
    recoveries = Report("after failures, 1 drone, 2 analyses", FAILURE_UNITS, packages=("ray",))
    with tempfile.TemporaryDirectory() as name, EdgeCloud(2) as cluster:
        folder = Path(name)
        ray_cluster.connect(cluster.address)
        latencies = measure_way(cluster.address, folder, "edge", size, seconds, work)
        _add(report, "edge", latencies, 0.0, work)
        for text in rtt.split(","):
            shape = Shape(float(text) / 1000, rate)
            for cloud in cluster.clouds():
                cluster.shape(cloud, shape)
            link = measure_link(cluster.far["cloud1"], size[0] * size[1] * 3)
            latencies = measure_way(cluster.address, folder, "cloud", size, seconds, work)
            _add(report, f"cloud, {text} ms", latencies, link, work)
        if failures:
            plain = Shape(0.04, 50e6)
            for cloud in cluster.clouds():
                cluster.shape(cloud, plain)
            for one in measure_recoveries(cluster, folder, plain):
                figures = (one.back, one.longest, one.lost, one.state_gap)
                recoveries.row(one.what, dict(zip(FAILURE_UNITS, figures, strict=True)))
        ray_cluster.disconnect()
    report.note("link: as many bytes over one TCP connection there, one byte back, same pace")
    report.show()
    if failures:
        recoveries.show()
    if json_path is not None:
        report.write(json_path)
        if failures:
            recoveries.write(json_path.with_stem(f"{json_path.stem}_failures"))


if __name__ == "__main__":
    typer.run(main)
