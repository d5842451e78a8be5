"""What recording costs beside the flight: processor, bytes, frames dropped, latency added.

python benchmarks/recording.py --frames ../shared/data/frames
"""

from __future__ import annotations

import json as json_format
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated
from unittest.mock import patch

import typer
from _recording_app import RATE, SIZE, build, draw_pictures, environment
from _report import Report

from aerodaas import Environment
from aerodaas.config.options import RunOptions, current_options
from aerodaas.environment.run import Run
from aerodaas.recording.reader import Recording
from aerodaas.recording.report.flight import RecordedFlight

UNITS = {
    "published": "frames",
    "dropped": "frames",
    "recorder": "cores",
    "memory": "MB",
    "machine": "% busy",
    "file": "MB/min",
    "latency": "ms",
    "without": "ms",
    "added": "ms",
}

IMAGES = ("jpeg", "h264")


def main(
    drones: Annotated[list[int] | None, typer.Option(help="Numbers of drones.", min=1)] = None,
    frames: Annotated[
        Path | None, typer.Option(help="Folder of pictures; drawn ones without it.")
    ] = None,
    seconds: Annotated[float, typer.Option(help="Seconds of hovering.", min=2)] = 20.0,
    json: Annotated[Path | None, typer.Option(help="Write the figures to this file.")] = None,
) -> None:
    """Fly 1, 2 and 4 simulated drones in real time, recorded and not, then replay one of them.

    "memory" is the most that the recorder had, frames in shared memory included. "latency" is the
    median from a frame's capture to an analysis that does nothing, beside "without": the same
    flight unrecorded. The cameras pan over pictures that are decoded beforehand.
    """
    report = Report("recording", UNITS, packages=["ray", "mcap", "opencv-python-headless"])
    width, height = SIZE
    report.note(f"Cameras of {width} x {height} at {RATE:g} Hz, one a drone.")
    with tempfile.TemporaryDirectory() as temporary:
        work = Path(temporary)
        pictures = frames.resolve() if frames else draw_pictures(work / "pictures")
        counts = drones or [1, 2, 4]
        for kind in IMAGES:
            for count in counts:
                folder = work / f"{kind}-{count}"
                case = f"{count} drone{'s' * (count > 1)}, {kind}"
                report.row(case, _measure(folder, count, pictures, seconds, kind))
            factor = _replay(work / f"{kind}-{counts[0]}" / "recorded" / "flight.mcap", seconds)
            report.note(f"Replay of {kind}: {factor:.1f} times real time, without a DNN.")
    report.show()
    if json is not None:
        report.write(json)


def _measure(
    folder: Path, drones: int, pictures: Path, seconds: float, images: str
) -> dict[str, float]:
    latencies = {}
    for recorded in (False, True):
        content = environment(drones, pictures, recorded=recorded, images=images)
        run, _ = _fly(folder, content, _application(seconds), speed=1.0, simulated_time=False)
        assert run.state is not None  # noqa: S101 - it has flown
        seen = [
            sent.median_ms
            for report in run.state.reports.values()
            for stream, sent in report.sent.items()
            if stream.endswith("seen") and sent.median_ms is not None
        ]
        latencies[recorded] = statistics.median(seen)
    path = folder / "recorded" / "flight.mcap"
    with Recording.open(path) as recording:
        flight, duration = RecordedFlight.read(recording), recording.duration
    cameras = {f"drone{number}/camera{number}" for number in range(drones)}
    load = flight.loads["recorder"]
    machine = next(iter(flight.machines.values()))
    dropped = sum(flight.drops.get(camera, 0) for camera in cameras)
    return {
        "published": sum(flight.frames.values()) + dropped,
        "dropped": dropped,
        "recorder": statistics.fmean(load.cpu),
        "memory": max(load.memory),
        "machine": 100 * statistics.fmean(machine.cpu),
        "file": path.stat().st_size / 1e6 / duration * 60,
        "latency": latencies[True],
        "without": latencies[False],
        "added": latencies[True] - latencies[False],
    }


def _replay(recording: Path, seconds: float) -> float:
    """Mission seconds per wall second, start not included."""
    folder = recording.parent.parent / "replay"
    run, flown = _fly(folder, None, _application(seconds), replay=recording)
    assert run.state is not None  # noqa: S101 - it has flown
    stamps = [robot.mission.stamp for robot in run.state.robots.values()]
    return max(stamps) / 1e9 / flown


def _application(seconds: float) -> Callable[[Environment], None]:
    return lambda env: build(env, seconds)


def _fly(
    folder: Path,
    content: dict[str, object] | None,
    app: Callable[[Environment], None],
    **words: object,
) -> tuple[Run, float]:
    """Fly to the end; returns the run and the wall seconds between start and end."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "environment.json"
    path.write_text(json_format.dumps(content))
    options = RunOptions(record=folder / "recorded", view=False, **words)  # type: ignore[arg-type]
    token = current_options.set(options)
    try:
        with patch("aerodaas.terminal.console.show_results"):
            env = Environment(path)
            app(env)
            run = env.launch()
            began = time.monotonic()
            run.wait()
    finally:
        current_options.reset(token)
    return run, time.monotonic() - began


if __name__ == "__main__":
    typer.run(main)
