"""The walk of a camera frame to a setpoint: the files that it passes, in order.

    python benchmarks/walks.py

One frame of the simulated camera goes through shared memory to the detector that ships, its boxes
to a follower, and the follower's command to a mission and its setpoint loop, each by the code that
flies, in one process. Listed are the project's files whose functions run on the way, those of the
simulator left out; the actors that call them (`sensor`, `analytics`, `drone/actor`) are three more.
"""

from __future__ import annotations

import sys
import types
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import typer

import aerodaas
from aerodaas.actors.drone.background_publisher import BackgroundPublisher
from aerodaas.actors.streams import Publisher, Subscriber
from aerodaas.analytics import VipDetectionAnalytics, VipFollowAnalytics
from aerodaas.analytics.base import ComputeKind
from aerodaas.cameras.simulated import SimulatedCamera
from aerodaas.config.model import EnvironmentConfig
from aerodaas.mission.commands import OpenStream
from aerodaas.runtime.controller import RobotSpec, VehicleController
from aerodaas.runtime.session import Session
from aerodaas.schedulers.trajectory.ordered import OrderedScheduler
from aerodaas.types.clock import NANOSECONDS, SimulatedClock, host_time_ns
from aerodaas.types.data import Alert, Frame, Header
from aerodaas.types.vehicle import VehicleState

_ROOT = Path(aerodaas.__file__).resolve().parents[1]
_ENVIRONMENT = _ROOT / "apps" / "environments" / "campus.json"
_PARTS = ("aerodaas", "actors", "schedulers")
_TURN = NANOSECONDS // 20
_NAVIGATION = "tello/follow"


class _Snapshot:
    """Context of an analysis."""

    kind: ComputeKind = "edge"

    def __init__(self, stamp: int, state: VehicleState) -> None:
        self._stamp, self._state = stamp, state

    def now(self) -> int:
        return self._stamp

    def vehicle(self) -> VehicleState | None:
        return self._state

    def alert(self, alert: Alert) -> None:
        del alert


class _Stream:
    """A stream in shared memory, with both ends in this process."""

    def __init__(self, scope: str, name: str) -> None:
        self.publisher = Publisher(scope, name)
        self._subscriber = Subscriber(scope, {name: 1})

    def newest(self) -> Any:  # noqa: ANN401 - a message of any item
        return self._subscriber.receive(5.0)[-1]


@contextmanager
def _walked(files: dict[str, None]) -> Iterator[None]:
    """Add the project's files whose functions are called meanwhile, in order of the first call."""

    def note(frame: types.FrameType, event: str, _: object) -> None:
        path = Path(frame.f_code.co_filename).resolve()
        if event == "call" and any(path.is_relative_to(_ROOT / one) for one in _PARTS):
            name = str(path.relative_to(_ROOT))
            if "simulation/" not in name:
                files.setdefault(name)

    sys.setprofile(note)
    try:
        yield
    finally:
        sys.setprofile(None)


def main() -> None:
    """Fly until the follower steers, noting the files of each frame's walk; print the last one."""
    environment = EnvironmentConfig.load(_ENVIRONMENT)
    robot = environment.robots[0]
    camera = SimulatedCamera(robot.sensors[0], environment)
    camera.open()
    session = Session(environment, None)
    spec = RobotSpec(
        robot, (), (_NAVIGATION,), (), (), (OpenStream(_NAVIGATION),), OrderedScheduler()
    )
    controller = VehicleController(spec, session, BackgroundPublisher(lambda _: None))
    scope = f"walk/{uuid.uuid4().hex[:8]}"
    own = {name: Publisher(scope, name) for name in VehicleController.streams(spec)}
    controller.connect()
    controller.open(own)
    detector, follower = VipDetectionAnalytics(), VipFollowAnalytics(distance=2.0)
    for analysis in (detector, follower):
        analysis.open()
    frames, boxes, navigation = (
        _Stream(scope, name) for name in ("tello/cam1", "tello/vests", _NAVIGATION)
    )
    controller.start(SimulatedClock())
    for turn in range(1, 600):
        now = turn * _TURN
        controller.advance_to(now)
        state = controller.vehicle.read()
        files: dict[str, None] = {}
        if turn % 4 == 0:
            with _walked(files):
                picture = camera.capture(now, state.truth)
            if picture is None:
                continue
            context = _Snapshot(now, state)
            with _walked(files):
                header = Header(turn, now, "tello/cam1")
                frame = Frame(header, picture.image, camera.model, state.odometry, picture.depth)
                frames.publisher.measure(frame, header, host_time_ns())
                seen = frames.newest()
                found = detector.process(seen.item, context)
                boxes.publisher.derive(found, seen, host_time_ns(), now)
                vests = boxes.newest()
                steering = follower.process(vests.item, context)
                navigation.publisher.derive(steering, vests, host_time_ns(), now)
                controller.take(navigation.newest(), now)
        with _walked(files):
            record = controller.turn(now, ())
        if files and record.cause is not None and record.sent is not None:
            print("\n".join(f"{number:3}  {file}" for number, file in enumerate(files, 1)))
            return
    raise SystemExit("the follower never steered")


if __name__ == "__main__":
    typer.run(main)
