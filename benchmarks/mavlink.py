"""From `navigate()` to the packet, the jitter of setpoints, and what the driver takes.

python benchmarks/mavlink.py --seconds 20

An emulated autopilot flies in a process of its own. The control loop turns 20 times a second in
this one, while a third decodes and analyses a 720p stream on the same cores. The times are those
at which packets arrive at the autopilot's port, stamped by the kernel.
"""

from __future__ import annotations

import multiprocessing
import random
import socket
import struct
import threading
import time
from multiprocessing.synchronize import Event
from pathlib import Path
from typing import Annotated

import cv2
import numpy as np
import typer
from _ports import free_port
from _report import Report

from aerodaas.clock import NANOSECONDS, ScaledClock
from aerodaas.config.model import EnvironmentConfig, RobotConfig
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.drivers.mavlink.vehicle import MavlinkVehicle
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.drivers.mavlink.wire.framing import Framer
from aerodaas.messages.mission import MissionState
from aerodaas.messages.vehicle import Setpoint, VehicleState
from aerodaas.messages.waypoints import NavigationType, VelocityCommand
from aerodaas.mission.commands import OpenStream, Start, StreamItem
from aerodaas.mission.loop import SetpointLoop
from aerodaas.mission.mission import Mission
from aerodaas.mission.navigation.planner import InlinePlanner
from aerodaas.schedulers.trajectory.ordered import OrderedScheduler
from tools.mavlink_vehicle import AutopilotOptions, EmulatedAutopilot

UNITS = {
    "median": "ms",
    "p99": "ms",
    "within 5 ms": "%",
    "command, median": "ms",
    "command, p99": "ms",
    "driver": "% of a core",
}
_PERIOD = 0.05
_WARM_UP = 3.0
_STREAM = "benchmark/commands"


class Timed(MavlinkVehicle):
    """Counts the CPU seconds of `read` and `send`."""

    spent = 0.0

    def read(self) -> VehicleState:
        """Read, on the clock."""
        before = time.thread_time()
        state = super().read()
        self.spent += time.thread_time() - before
        return state

    def send(self, setpoint: Setpoint) -> Setpoint:
        """Send, on the clock."""
        before = time.thread_time()
        sent = super().send(setpoint)
        self.spent += time.thread_time() - before
        return sent


def main(
    seconds: Annotated[float, typer.Option(help="Time measured.", min=2.0)] = 15.0,
    family: Annotated[str, typer.Option(help="px4 or ardupilot.")] = "px4",
    *,
    load: Annotated[bool, typer.Option(help="Analyse a 720p stream meanwhile.")] = True,
    json: Annotated[Path | None, typer.Option(help="Write the figures to this file.")] = None,
) -> None:
    """Measure the setpoints of one flight."""
    report = Report("mavlink", UNITS, packages=["pymavlink", "opencv-python-headless"])
    report.note(
        "median and p99: how far each setpoint comes from 50 ms after the one before. command: "
        "from a navigation item's arrival, at any moment between two turns of the 20 Hz loop, to "
        "the first packet that carries it. driver: CPU of the link's thread and of read and send."
    )
    for case, busy in (("alone", False), ("with 720p analysis", True)):
        if load or not busy:
            report.row(case, _measure(family, seconds, busy=busy))
    report.show()
    if json is not None:
        report.write(json)


def _measure(family: str, seconds: float, *, busy: bool) -> dict[str, float]:
    port, tap = free_port(), _tap()
    spawn = multiprocessing.get_context("spawn")
    stop = spawn.Event()
    tap_port = int(tap.getsockname()[1])
    processes = [spawn.Process(target=_emulate, args=(family, port, stop), daemon=True)]
    if busy:
        processes.append(spawn.Process(target=_analyse, args=(stop,), daemon=True))
    for process in processes:
        process.start()
    try:
        return _fly(port, tap, tap_port, seconds)
    finally:
        stop.set()
        for process in processes:
            process.join(5.0)
        tap.close()


def _fly(port: int, tap: socket.socket, tap_port: int, seconds: float) -> dict[str, float]:
    robot = RobotConfig.model_validate(
        {
            "id": "drone",
            "driver": "mavlink",
            "settings": {"url": f"udpin:127.0.0.1:{port}", "failsafes": "ignore"},
        }
    )
    vehicle = Timed(robot, EnvironmentConfig(robots=[robot]))
    vehicle.connect(30.0)
    # Every packet goes to the tap as well, whose kernel stamps it.
    wire = vehicle.connection.link
    _copy_to(wire, tap_port)
    clock = ScaledClock()
    takeoff = vehicle.read().odometry.position
    mission = Mission(robot, InlinePlanner(OrderedScheduler()), takeoff=takeoff)
    loop = SetpointLoop(vehicle, mission)
    arrivals: list[tuple[float, float]] = []
    stopping = threading.Event()
    listener = threading.Thread(target=_listen, args=(tap, arrivals, stopping), daemon=True)
    listener.start()
    vehicle.use_clock(clock)
    mission.handle(OpenStream(_STREAM), clock.now())
    mission.handle(Start(), clock.now())
    draw = random.Random(0).random
    due, sign, given = time.monotonic(), 1.0, []
    measured_from: float | None = None
    before = 0.0
    while measured_from is None or time.monotonic() - measured_from < seconds:
        # Navigation comes at any moment between two turns.
        time.sleep(max(0.0, due - _PERIOD * draw() - time.monotonic()))
        if measured_from is not None:
            sign = -sign
            given.append((time.time(), sign))
            item = VelocityCommand(yaw_rate=0.2 * sign, valid_for=2.0)
            navigation = AeroNavigation(NavigationType.ANALYTICS_DRIVEN, [item])
            mission.handle(StreamItem(_STREAM, navigation), clock.now())
        time.sleep(max(0.0, due - time.monotonic()))
        now = time.monotonic()
        due += _PERIOD * max(1, int((now - due) / _PERIOD) + 1)
        flying = mission.state not in {
            MissionState.IDLE,
            MissionState.PREFLIGHT,
            MissionState.TAKING_OFF,
        }
        if flying and measured_from is None:
            measured_from = now + _WARM_UP
            before = vehicle.spent + _thread_time(wire)
        loop.step(clock.now())
    spent = vehicle.spent + _thread_time(wire) - before
    stopping.set()
    listener.join()
    vehicle.close()
    start = time.time() - seconds
    return _figures(arrivals, given, start, spent / (seconds + _WARM_UP))


def _figures(
    arrivals: list[tuple[float, float]],
    given: list[tuple[float, float]],
    start: float,
    load: float,
) -> dict[str, float]:
    stamps = np.array([stamp for stamp, _ in arrivals if stamp > start])
    late = 1e3 * np.abs(np.diff(stamps) - _PERIOD)
    delays = []
    for asked, sign in given:
        # Counter-clockwise is negative on the wire.
        carried = [stamp for stamp, rate in arrivals if stamp >= asked and rate * sign < 0.0]
        if carried and asked > start:
            delays.append(1e3 * (carried[0] - asked))
    return {
        "median": float(np.median(late)),
        "p99": float(np.percentile(late, 99)),
        "within 5 ms": 100 * float(np.mean(late <= 5.0)),  # noqa: PLR2004 - the aim
        "command, median": float(np.median(delays)),
        "command, p99": float(np.percentile(delays, 99)),
        "driver": 100 * load,
    }


def _copy_to(wire: object, port: int) -> None:
    out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    transport = wire._wire  # type: ignore[attr-defined]  # noqa: SLF001 - a probe
    send = transport.send

    def both(packet: bytes, peers: tuple[object, ...]) -> None:
        send(packet, peers)
        out.sendto(packet, ("127.0.0.1", port))

    transport.send = both


def _thread_time(wire: object) -> float:
    """CPU seconds of the link's thread so far."""
    thread = wire._thread  # type: ignore[attr-defined]  # noqa: SLF001 - a probe
    stat = Path(f"/proc/self/task/{thread.native_id}/stat").read_text(encoding="ascii")
    fields = stat.rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / 100.0


def _tap() -> socket.socket:
    opened = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    opened.bind(("127.0.0.1", 0))
    opened.settimeout(0.2)
    timestamp_ns = 35
    opened.setsockopt(socket.SOL_SOCKET, timestamp_ns, 1)
    return opened


def _listen(
    tap: socket.socket, arrivals: list[tuple[float, float]], stopping: threading.Event
) -> None:
    """Kernel stamps and yaw rates of all setpoints."""
    mav = mavlink.MAVLink(None, 1, 1)
    wanted = frozenset({mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED})
    framer = Framer(wanted, mav.decode)
    while not stopping.is_set():
        try:
            content, ancillary, _, _ = tap.recvmsg(2048, 128)
        except TimeoutError:
            continue
        whole, nanoseconds = struct.unpack("qq", ancillary[0][2][:16])
        stamp = whole + nanoseconds / NANOSECONDS
        arrivals += [(stamp, float(getattr(one, "yaw_rate", 0.0))) for one in framer.feed(content)]


def _emulate(family: str, port: int, stop: Event) -> None:
    options = AutopilotOptions(
        family="px4" if family == "px4" else "ardupilot", peer=("127.0.0.1", port)
    )
    with EmulatedAutopilot(options):
        stop.wait()


def _analyse(stop: Event) -> None:
    """Encode, decode and analyse 720p at 30 frames per second, as a camera and a light model."""
    cv2.setNumThreads(1)
    rng = np.random.default_rng(0)
    image = cv2.GaussianBlur(rng.integers(0, 255, (720, 1280, 3), dtype=np.uint8), (9, 9), 0)
    _, encoded = cv2.imencode(".jpg", image)
    due = time.monotonic()
    while not stop.is_set():
        frame = cv2.imdecode(encoded, cv2.IMREAD_COLOR)
        assert frame is not None  # noqa: S101 - it was encoded just now
        grey = cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY)
        cv2.goodFeaturesToTrack(grey, 100, 0.01, 10)
        due += 1 / 30
        time.sleep(max(0.0, due - time.monotonic()))


if __name__ == "__main__":
    typer.run(main)
