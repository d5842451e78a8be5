"""One hop of a stream between two processes of one node, without Ray and actors.

Every 33 ms, as a camera at 30 Hz, a message is published and read: from the moment it is handed to
the publisher until the reader has it, the shared pixels read as in `latency.py`.
"""

from __future__ import annotations

import json
import resource
import statistics
import subprocess
import sys
import time
import uuid
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from _latency_ours import HEIGHT, WIDTH, read_frame
from _report import Report

from aerodaas.actors.streams import Publisher, Subscriber
from aerodaas.messages.frames import Frame, Header
from aerodaas.runtime.node import Outlet

UNITS = {"median": "us", "p99": "us", "publisher": "us of processor", "reader": "us of processor"}
_PERIOD = 0.033
_WARM_UP = 30
_KINDS = ("frame", "small message")


def _processor() -> float:
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def _publish(scope: str, kind: str, count: int) -> float:
    """Publish `count` messages; returns seconds of processor for each."""
    publisher, outlet = Publisher(scope, "s"), Outlet("s")
    image = np.random.default_rng(0).integers(0, 255, (HEIGHT, WIDTH, 3), dtype=np.uint8)
    time.sleep(1.0)
    began = 0.0
    for number in range(_WARM_UP + count):
        if number == _WARM_UP:
            began = _processor()
        time.sleep(_PERIOD)
        header = Header(number, number, "drone/camera")
        item: Any = Frame(header, image) if kind == "frame" else {"value": float(number)}
        publisher.publish(outlet.measure(item, header, time.monotonic_ns()))
    used = _processor() - began
    publisher.publish(outlet.measure(None, Header(0, 0, "the end"), 0))
    publisher.close()
    return used / count


def _read(scope: str) -> tuple[list[float], float]:
    """Read the messages; returns their latencies in seconds, and seconds of processor for each."""
    subscriber = Subscriber(scope, {"s": 1})
    print("ready", flush=True)
    latencies: list[float] = []
    began = 0.0
    while True:
        for message in subscriber.receive(1.0):
            if message.item is None:
                return latencies, (_processor() - began) / len(latencies)
            if isinstance(message.item, Frame):
                read_frame(message.item.image)
            if message.seq == _WARM_UP:
                began = _processor()
            if message.seq >= _WARM_UP:
                latencies.append((time.monotonic_ns() - message.captured) / 1e9)
            del message


def _measure(kind: str, count: int) -> dict[str, float]:
    scope = f"hop/{uuid.uuid4().hex[:8]}"
    command = [sys.executable, str(Path(__file__)), "--scope", scope]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as reader:  # noqa: S603 - our own
        assert reader.stdout is not None  # noqa: S101 - asked for
        reader.stdout.readline()
        publishing = _publish(scope, kind, count)
        latencies, reading = json.loads(reader.stdout.readline())
    return {
        "median": 1e6 * statistics.median(latencies),
        "p99": 1e6 * statistics.quantiles(latencies, n=100)[-1],
        "publisher": 1e6 * publishing,
        "reader": 1e6 * reading,
    }


def main(
    count: Annotated[int, typer.Option(min=100, help="Messages of each kind in a round.")] = 200,
    rounds: Annotated[int, typer.Option(min=1, help="Rounds of each kind, in turn.")] = 3,
    json_path: Annotated[Path | None, typer.Option("--json", help="Write the figures.")] = None,
    scope: Annotated[str, typer.Option(hidden=True)] = "",
) -> None:
    """Measure one hop: latency, and processor time at both ends, a message.

    python benchmarks/hop.py --count 200 --rounds 3
    """
    if scope:
        print(json.dumps(_read(scope)), flush=True)
        return
    report = Report(f"one hop, frames of {WIDTH}x{HEIGHT} and small messages", UNITS, packages=())
    found = [[_measure(each, count) for each in _KINDS] for _ in range(rounds)]
    for each, figures in zip(_KINDS, zip(*found, strict=True), strict=True):
        report.row(each, {unit: statistics.median(one[unit] for one in figures) for unit in UNITS})
    report.show()
    if json_path is not None:
        report.write(json_path)


if __name__ == "__main__":
    typer.run(main)
