"""The walk of a camera frame to a setpoint: the files that it passes, in order.

    python benchmarks/walks.py

One frame of the simulated camera goes through shared memory to the detector that ships, its boxes
to a follower, and the follower's command to a drone, each a node of a flight, all in one process.
Listed are the project's files whose functions run on the way, those of the simulator left out; the
actors that step the nodes (`base`, `node_runner`, `drone/actor`) are three more.
"""

from __future__ import annotations

import sys
import types
import uuid
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import typer

import aerodaas
from aerodaas.actors.streams import Publisher, Subscriber
from aerodaas.analytics import VipDetectionAnalytics, VipFollowAnalytics
from aerodaas.analytics.base import Analytics
from aerodaas.clock import NANOSECONDS, SimulatedClock
from aerodaas.config.model import EnvironmentConfig
from aerodaas.messages.envelope import Message
from aerodaas.messages.mission import SetpointRecord
from aerodaas.mission.commands import OpenStream
from aerodaas.mission.planner import InlinePlanner
from aerodaas.runtime.analysis import AnalysisNode, AnalysisSpec
from aerodaas.runtime.camera import CameraNode
from aerodaas.runtime.controller import RobotSpec
from aerodaas.runtime.drone import DroneNode
from aerodaas.runtime.node import Host, Node
from aerodaas.runtime.session import Session
from aerodaas.runtime.stream_names import state_stream
from aerodaas.schedulers.trajectory.ordered import OrderedScheduler

_ROOT = Path(aerodaas.__file__).resolve().parents[1]
_ENVIRONMENT = _ROOT / "apps" / "environments" / "campus.json"
_PARTS = ("aerodaas", "actors", "schedulers")
_LONGEST = 30 * NANOSECONDS
"""Mission time within which the follower must steer, nanoseconds."""
_FRAMES, _BOXES, _NAVIGATION = "tello/cam1", "tello/vests", "tello/follow"


class _Host(Host):
    """Host of the nodes, on a simulated clock."""

    def __init__(self) -> None:
        self.time = 0

    def now(self) -> int:
        return self.time

    def publish_alert(
        self, kind: str, text: str, stamp: int, values: Mapping[str, Any], source: str
    ) -> None:
        del kind, text, stamp, values, source

    def wake(self) -> None:
        return


class _Stream:
    """A stream in shared memory, with both ends in this process."""

    def __init__(self, scope: str, name: str) -> None:
        self._publisher = Publisher(scope, name)
        self._subscriber = Subscriber(scope, {name: 1})

    def carry(self, messages: Sequence[Message[Any]]) -> list[Message[Any]]:
        """Publish messages of a node, and return what a reader gets."""
        for message in messages:
            self._publisher.publish(message)
        return self._subscriber.receive(5.0) if messages else []


def _analysis(
    session: Session, stream: str, work: Analytics[Any], reads: str, state: str
) -> AnalysisNode:
    spec = AnalysisSpec(
        stream=stream,
        work=work,
        inputs={reads: 1},
        robot="tello",
        state=state,
        external=False,
        dormant=False,
        triggers=(),
        kind="edge",
        answers_always=False,
        wakes=(),
    )
    return spec.make(session)


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
    session, host, robot = Session(environment, None), _Host(), environment.robots[0]
    sensor, state = robot.sensors[0], state_stream(robot.id)
    spec = RobotSpec(
        robot,
        sensors=(),
        navigation=(_NAVIGATION,),
        commands=(),
        initial=(OpenStream(_NAVIGATION),),
        scheduler=OrderedScheduler(),
    )
    drone = DroneNode(
        session,
        "drone",
        (spec,),
        lambda _, scheduler: InlinePlanner(scheduler),
        observed={_FRAMES: sensor.rate},
    )
    camera = CameraNode(session, _FRAMES, sensor, state, ends=False)
    detector = _analysis(session, _BOXES, VipDetectionAnalytics(), _FRAMES, state)
    follower = _analysis(session, _NAVIGATION, VipFollowAnalytics(distance=2.0), _BOXES, state)
    scope = f"walk/{uuid.uuid4().hex[:8]}"
    frames, boxes, navigation = (_Stream(scope, name) for name in (_FRAMES, _BOXES, _NAVIGATION))
    nodes: tuple[Node, ...] = (drone, camera, detector, follower)
    for node in nodes:
        node.open(host)
        node.start(SimulatedClock())
    steering: list[Message[Any]] = []
    files: dict[str, None] = {}
    while host.time < _LONGEST:
        host.time = drone.due
        with _walked(files):
            published = drone.step(host.time, steering)
        records = [one.item for one in published if isinstance(one.item, SetpointRecord)]
        if any(record.cause is not None and record.sent is not None for record in records):
            print("\n".join(f"{number:3}  {file}" for number, file in enumerate(files, 1)))
            return
        steering = []
        if host.time >= camera.due:
            states = [message for message in published if message.stream == state]
            files = {}
            with _walked(files):
                seen = frames.carry(camera.step(host.time, states))
                found = boxes.carry(detector.step(host.time, [*seen, *states]))
                steering = navigation.carry(follower.step(host.time, [*found, *states]))
    raise SystemExit("the follower never steered")


if __name__ == "__main__":
    typer.run(main)
