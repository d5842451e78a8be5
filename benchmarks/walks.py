"""The walk of a camera frame to a setpoint: the files that it passes, in order.

    python benchmarks/walks.py
    python benchmarks/walks.py --inline

One frame of the simulated camera goes to the detector that ships, its boxes to a follower, and the
follower's command to the drone's setpoint loop. All four are the nodes that fly, stepped by hand in
one process. Between them a message travels through shared memory, as between actors on one
machine, or with `--inline` as it is, as in simulated time. Listed are the project's files whose
functions run on the way, those of the simulator left out.
"""

from __future__ import annotations

import sys
import types
import uuid
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer

import aerodaas
from aerodaas.actors.streams import Publisher, Subscriber
from aerodaas.analytics import VipDetectionAnalytics, VipFollowAnalytics
from aerodaas.analytics.base import Analytics
from aerodaas.config.model import EnvironmentConfig
from aerodaas.mission.commands import OpenStream
from aerodaas.mission.planner import InlinePlanner
from aerodaas.runtime.analysis import AnalysisNode, AnalysisSpec
from aerodaas.runtime.camera import CameraNode
from aerodaas.runtime.controller import RobotSpec
from aerodaas.runtime.drone import DroneNode
from aerodaas.runtime.inline import InlineExecutor, Part
from aerodaas.runtime.node import Node
from aerodaas.runtime.session import Session
from aerodaas.runtime.stream_names import setpoint_stream, state_stream
from aerodaas.schedulers.trajectory.ordered import OrderedScheduler
from aerodaas.types.clock import NANOSECONDS
from aerodaas.types.status import Message

_ROOT = Path(aerodaas.__file__).resolve().parents[1]
_ENVIRONMENT = _ROOT / "apps" / "environments" / "campus.json"
_PARTS = ("aerodaas", "actors", "schedulers")
_CYCLE = NANOSECONDS // 20
_CAMERA, _VESTS, _FOLLOW = "tello/cam1", "tello/vests", "tello/follow"

Carry = Callable[[Message[Any]], Message[Any]]


@contextmanager
def _walked(files: dict[str, None]) -> Iterator[None]:
    """Add the project's files whose functions are called meanwhile, in order of the first call."""

    def on_event(frame: types.FrameType, event: str, _: object) -> None:
        path = Path(frame.f_code.co_filename).resolve()
        if event == "call" and any(path.is_relative_to(_ROOT / part) for part in _PARTS):
            name = str(path.relative_to(_ROOT))
            if "simulation/" not in name:
                files.setdefault(name)

    sys.setprofile(on_event)
    try:
        yield
    finally:
        sys.setprofile(None)


def _analysis(session: Session, work: Analytics[Any], stream: str, reads: str) -> AnalysisNode:
    spec = AnalysisSpec(
        stream,
        work,
        {reads: 1},
        robot="tello",
        state=state_stream("tello"),
        external=False,
        dormant=False,
        triggers=(),
        kind="edge",
        answers_always=False,
        wakes=(),
    )
    return spec.make(session)


class _SharedMemory:
    """Streams in shared memory, with both ends in this process."""

    def __init__(self, streams: Sequence[str], closing: ExitStack) -> None:
        scope = f"walk/{uuid.uuid4().hex[:8]}"
        self._publishers = {stream: Publisher(scope, stream) for stream in streams}
        self._subscribers = {stream: Subscriber(scope, {stream: 1}) for stream in streams}
        for end in (*self._subscribers.values(), *self._publishers.values()):
            closing.callback(end.close)

    def carry(self, message: Message[Any]) -> Message[Any]:
        """Publish a message, and receive it."""
        self._publishers[message.stream].publish(message)
        return self._subscribers[message.stream].receive(5.0)[-1]


def _as_it_is(message: Message[Any]) -> Message[Any]:
    return message


def _steer(
    nodes: Sequence[Node], carry: Carry, now: int, state: Message[Any]
) -> list[Message[Any]]:
    """Step each node with what the one before has published; what the last one publishes."""
    found: list[Message[Any]] = []
    for node in nodes:
        published = node.step(now, [*found, state])
        found = [carry(message) for message in published if message.stream == node.name]
        if not found:
            return []
    return found


def main(
    *,
    inline: Annotated[bool, typer.Option("--inline", help="As in simulated time.")] = False,
) -> None:
    """Fly until the follower steers, noting the files of each frame's walk; print the last one."""
    environment = EnvironmentConfig.load(_ENVIRONMENT)
    robot = environment.robots[0]
    session = Session(environment, None)
    spec = RobotSpec(robot, (), (_FOLLOW,), (), (), (OpenStream(_FOLLOW),), OrderedScheduler())
    drone = DroneNode(
        session, "drone", (spec,), lambda _, scheduler: InlinePlanner(scheduler), observed={}
    )
    state = state_stream(robot.id)
    camera = CameraNode(session, _CAMERA, robot.sensors[0], state, ends=False)
    detector = _analysis(session, VipDetectionAnalytics(), _VESTS, _CAMERA)
    follower = _analysis(session, VipFollowAnalytics(distance=2.0), _FOLLOW, _VESTS)
    executor = InlineExecutor()
    walk: dict[str, None] = {}
    steered: list[Message[Any]] = []
    with ExitStack() as closing:
        streams = (_CAMERA, _VESTS, _FOLLOW)
        carry: Carry = _as_it_is if inline else _SharedMemory(streams, closing).carry
        for node in (drone, camera, detector, follower):
            closing.callback(node.close)
            node.open(Part(node.name, executor))
            node.start(executor.clock)
        for cycle in range(1, 600):
            now = cycle * _CYCLE
            executor.clock.advance_to(now)
            with _walked(walk):
                sent = {message.stream: message for message in drone.step(now, ())}
            record = sent[setpoint_stream(robot.id)].item
            if record is not None and record.cause is not None and steered:
                print("\n".join(f"{number:3}  {file}" for number, file in enumerate(walk, 1)))
                return
            walk = {}
            with _walked(walk):
                steered = _steer((camera, detector, follower), carry, now, sent[state])
                drone.step(now, steered)
    raise SystemExit("the follower never steered")


if __name__ == "__main__":
    typer.run(main)
