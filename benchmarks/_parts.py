"""Processor time of a simulated flight's parts, all in one process: drone, camera, recorder.

    python benchmarks/_parts.py --camera --record

The square of Farm Survey is flown without streams between the parts. Prints, as JSON, simulated
seconds per wall second and, for each simulated second, milliseconds of the processor: of the flight
by part, and of all threads together, among them the recorder's own.
"""

from __future__ import annotations

import json
import tempfile
import time
from collections import Counter, defaultdict
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from aerodaas import AeroNavigation, NavigationType, Waypoint
from aerodaas.clock import NANOSECONDS, host_time_ns
from aerodaas.config.model import EnvironmentConfig
from aerodaas.config.plugins import load_plugin
from aerodaas.drivers.loading import load_vehicle
from aerodaas.geometry.frames import GeodeticOrigin
from aerodaas.identifiers import internal
from aerodaas.messages.envelope import Message, TraceSpan
from aerodaas.messages.frames import Frame, Header
from aerodaas.mission.commands import AddNavigation, Start
from aerodaas.mission.loop import SetpointLoop
from aerodaas.mission.mission import Mission
from aerodaas.mission.navigation.planner import InlinePlanner
from aerodaas.recording.provenance import Provenance
from aerodaas.recording.recorder import FlightRecorder
from aerodaas.schedulers.trajectory.ordered import OrderedScheduler

_ENVIRONMENT = Path(__file__).parents[1] / "apps" / "environments" / "farm.json"
_CORNERS = ((0, 0), (0, 10), (10, 10), (10, 0))
_PERIOD = NANOSECONDS // 20


class _Flight:
    """The Farm Survey of one process."""

    def __init__(self, config: EnvironmentConfig, stack: ExitStack, *, record: bool) -> None:
        self._robot, home = config.robots[0], config.home
        assert home is not None  # noqa: S101 - the farm has one
        origin = GeodeticOrigin(home.latitude, home.longitude, home.altitude)
        self._vehicle: Any = load_vehicle(self._robot, config)
        self._vehicle.connect()
        self._mission = Mission(
            self._robot,
            InlinePlanner(OrderedScheduler()),
            takeoff=self._vehicle.read().odometry.position,
            origin=origin,
            wind=np.array(config.simulation.wind),
            vehicle=self._vehicle,
        )
        self._loop = SetpointLoop(self._vehicle, self._mission)
        stops = [
            Waypoint(f"wp{n}", x, y, 1.5, hover_duration=5) for n, (x, y) in enumerate(_CORNERS)
        ]
        self._mission.handle(
            AddNavigation(AeroNavigation(NavigationType.DISTANCE_DRIVEN, stops)), 0
        )
        self._mission.handle(Start(), 0)
        self._camera: Any = None
        self._recorder: FlightRecorder | None = None
        for sensor in self._robot.sensors:
            if sensor.type == "camera":
                self._camera = load_plugin("cameras", config.camera_driver(sensor))(sensor, config)
                self._camera.open()
                stack.callback(self._camera.close)
                self._stream, self._frame_period = (
                    f"{self._robot.id}/{sensor.id}",
                    1e9 / sensor.rate,
                )
        if record:
            folder = stack.enter_context(tempfile.TemporaryDirectory())
            path, recording = Path(folder) / "flight.mcap", config.recording
            self._recorder = FlightRecorder(
                path, config=recording, provenance=Provenance(), home=origin
            )
        self._sent: Counter[str] = Counter()
        self._parts: dict[str, float] = defaultdict(float)

    def fly(self) -> dict[str, float]:
        """Fly to the end; returns the figures."""
        now = frames = 0
        began, spent = time.perf_counter(), time.process_time()
        while not self._mission.finished:
            now += _PERIOD
            self._turn(now)
            while self._camera is not None and frames * self._frame_period <= now:
                self._capture(round(frames * self._frame_period))
                frames += 1
        flown = now / NANOSECONDS
        if self._recorder is not None:
            self._recorder.close()
        figures = {"factor": flown / (time.perf_counter() - began)}
        figures["actors"] = 1000 * (time.process_time() - spent) / flown
        return figures | {part: 1000 * used / flown for part, used in self._parts.items()}

    def _turn(self, now: int) -> None:
        began = time.thread_time()
        self._vehicle.advance_to(now)
        setpoint = self._loop.step(now)
        items = {"state": self._loop.state, "setpoints": setpoint, "status": self._mission.status}
        self._parts["drone"] += time.thread_time() - began
        for kind, item in items.items():
            self._record(internal(self._robot.id, kind), item, now)
        if self._recorder is not None and now % (2 * _PERIOD) == 0:
            assert self._loop.state is not None  # noqa: S101 - it has turned
            self._record(f"{self._robot.id}/odom", self._loop.state.odometry, now)

    def _capture(self, now: int) -> None:
        began = time.thread_time()
        odometry = self._vehicle.read().odometry
        picture = self._camera.capture(now, odometry)
        self._parts["camera"] += time.thread_time() - began
        header = Header(self._sent[self._stream] + 1, now, self._stream)
        frame = Frame(header, picture.image, odometry=odometry, camera=self._camera.model)
        self._record(self._stream, frame, now, header)

    def _record(self, stream: str, item: object, now: int, header: Header | None = None) -> None:
        if self._recorder is None:
            return
        self._sent[stream] += 1
        header = header or Header(self._sent[stream], now, self._robot.id)
        captured = host_time_ns()
        span = TraceSpan(self._robot.id, captured, captured)
        began = time.thread_time()
        self._recorder.write(
            Message(stream, self._sent[stream], now, header, captured, (span,), item)
        )
        self._parts["recorder"] += time.thread_time() - began


def main(
    *,
    camera: Annotated[bool, typer.Option(help="With the farm's camera.")] = False,
    record: Annotated[bool, typer.Option(help="With a recording of all messages.")] = False,
) -> None:
    """Fly once and print the figures."""
    config = EnvironmentConfig.model_validate_json(_ENVIRONMENT.read_text())
    if not camera:
        robot = config.robots[0]
        sensors = tuple(sensor for sensor in robot.sensors if sensor.type != "camera")
        config = config.model_copy(
            update={"robots": (robot.model_copy(update={"sensors": sensors}),)}
        )
    with ExitStack() as stack:
        flight = _Flight(config, stack, record=record)
        figures = flight.fly()
    typer.echo(json.dumps(figures))


if __name__ == "__main__":
    typer.run(main)
