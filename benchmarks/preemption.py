"""From the event's frame to the first setpoint that it changed, as a drone flies its plan.

A camera, an analysis and a drone fly in real time on this machine. Every second, for one frame,
the analysis asks for a velocity of priority 1, which preempts the waypoint being flown to. The
setpoint loop turns every 50 ms, so that half a period of waiting, and at most a whole one, is its
own share; the rest is the data path.

    python benchmarks/preemption.py --events 100 --json preemption.json
"""

from __future__ import annotations

import json
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np
import typer
from _latency_ours import PatternCamera
from _report import Report
from numpy.typing import NDArray
from rich.progress import Progress

from aerodaas import (
    AeroNavigation,
    Environment,
    Frame,
    NavigableAnalytics,
    NavigationType,
    VelocityCommand,
    Waypoint,
)
from aerodaas.analytics.base import Context
from aerodaas.config.options import RunOptions, current_options
from aerodaas.runtime.live import LiveReader
from aerodaas.runtime.session import CONTROL_PERIOD_NS

RATE = 13
"""Frames per second; no divisor of the loop's 20, so that events fall anywhere in its period."""
EVERY = 13
"""Frames between events: the plan has resumed by then."""
UNITS = {"median": "ms", "p99": "ms", "worst": "ms", "events": ""}


class Event(NavigableAnalytics):
    """Asks to rise, for one frame of every `EVERY`."""

    accepts: ClassVar[tuple[type, ...]] = (Frame,)
    isolated = True

    def process(self, item: Frame, context: Context) -> AeroNavigation | None:  # noqa: ARG002
        """Return the command for the event's frame."""
        if item.header.id % EVERY:
            return None
        command = VelocityCommand(up=0.1, priority=1, valid_for=0.2)
        return AeroNavigation(NavigationType.ANALYTICS_DRIVEN, [command])


@dataclass(frozen=True)
class Delays:
    """Milliseconds from an event's frame, one for each event, shape (N,)."""

    setpoint: NDArray[np.float64]
    """To the first setpoint that it changed."""
    command: NDArray[np.float64]
    """To the command's arrival at the drone: the data path."""


def fly(events: int, folder: Path) -> Delays:
    """Fly to a far waypoint through that many events."""
    plugin = f"{PatternCamera.__module__}:{PatternCamera.__name__}"
    camera = {"id": "camera", "type": "camera", "driver": plugin, "rate": RATE}
    limits = {"max_range": 5000, "endurance": 36000}
    content: dict[str, Any] = {
        "name": "preemption",
        "robots": [
            {"id": "drone", "sensors": [camera], "limits": limits, "mission": {"resume_after": 0.1}}
        ],
        "compute": [{"id": "edge"}],
        "simulation": {"world": "empty"},
        "recording": {"enabled": False},
    }
    path = folder / "preemption.json"
    path.write_text(json.dumps(content), encoding="utf-8")
    current_options.set(RunOptions(speed=1.0, simulated_time=False, view=False))
    env = Environment(path)
    drone = env.get_robot_by_id("drone")
    frames = drone.get_sensor_by_id("camera").get_data_stream()
    event = Event().deploy(env.get_compute_resource_by_id("edge")).analyse(frames)
    env.trajectory_scheduler().add_navigation(event)
    far = Waypoint("far", 4000.0, 0.0, 20.0)
    drone.navigate(AeroNavigation(NavigationType.DISTANCE_DRIVEN, [far]))
    drone.start_mission(wait=False)
    delays = _collect(env, events)
    drone.end_mission()
    drone.wait()
    return delays


def _collect(env: Environment, events: int) -> Delays:
    """Watch the setpoints; the first one that an event's frame caused is the one."""
    assert env.run is not None  # noqa: S101 - just started
    reader: LiveReader = env.graph.reader("drone/@setpoints")  # type: ignore[misc, assignment]
    found: dict[int, float] = {}
    with Progress() as progress:
        task = progress.add_task("flying", total=events)
        # One more than asked: the first has to wait for what is loaded at its first use.
        while len(found) <= events:
            record = reader.next(60.0)
            cause = record.cause
            if cause is not None and cause.id not in found:
                found[cause.id] = (record.stamp - cause.stamp) / 1e6
                progress.advance(task)
    arrived = env.run.poll(newest=events).robots["drone"].latencies
    return Delays(np.array(list(found.values())[1:]), np.array(arrived))


def main(
    events: Annotated[int, typer.Option(min=2, help="Events, one a second.")] = 100,
    json_path: Annotated[Path | None, typer.Option("--json", help="Write the figures.")] = None,
) -> None:
    """Measure the time from an event's frame to the first changed setpoint.

    python benchmarks/preemption.py --events 100 --json preemption.json
    """
    period = CONTROL_PERIOD_NS / 1e6
    with tempfile.TemporaryDirectory() as name:
        delays = fly(events, Path(name))
    title = f"preemption: from an event's frame, 1280x720 at {RATE}/s, analysis in its own actor"
    report = Report(title, UNITS, packages=("ray",))
    for case, values in (
        ("to the changed setpoint", delays.setpoint),
        ("to the command at the drone", delays.command),
    ):
        report.row(
            case,
            {
                "median": float(np.median(values)),
                "p99": float(np.percentile(values, 99)),
                "worst": float(values.max()),
                "events": float(len(values)),
            },
        )
    report.note(f"aim: one setpoint period ({period:.0f} ms) plus the data path")
    report.show()
    if json_path is not None:
        report.write(json_path)


if __name__ == "__main__":
    typer.run(main)
