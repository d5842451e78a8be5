"""The walks of a camera frame and of a submission: the files that each passes, in order.

    python benchmarks/walks.py [frame|submit]

`frame`: one frame of the simulated camera goes through shared memory to the detector that ships,
its boxes to a follower, and the follower's command to a drone, each a node of a flight, all in one
process. Listed are the project's files whose functions run on the way, those of the simulator left
out; the actors that step the nodes (`base`, `node_runner`, `drone/actor`) are three more.

`submit`: a mission is submitted to a provider with one simulated drone, and rehearsed there. Listed
are the files whose functions run in the service from `POST /v1/missions` on, and in the process of
its flight until it launches the flight; the rehearsal's own process is left out.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import threading
import time
import types
import uuid
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, Literal

import httpx
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
from aerodaas.mission.navigation.planner import InlinePlanner
from aerodaas.runtime.node import Host, Node
from aerodaas.runtime.nodes.analysis import AnalysisNode, AnalysisSpec
from aerodaas.runtime.nodes.camera import CameraNode
from aerodaas.runtime.nodes.controller import RobotSpec
from aerodaas.runtime.nodes.drone import DroneNode
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

    threading.setprofile(note)
    sys.setprofile(note)
    try:
        yield
    finally:
        sys.setprofile(None)
        threading.setprofile(None)


def _print(files: Sequence[str]) -> None:
    print("\n".join(f"{number:3}  {file}" for number, file in enumerate(files, 1)))


def _frame() -> None:
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
        lambda spec: InlinePlanner(spec.scheduler),
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
            _print(list(files))
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


_FLIGHT = "AERODAAS_WALK"
"""Variable that tells a flight's process where to write its files."""
_PATIENCE = 120.0
"""Wall seconds for a mission to be rehearsed and launched."""
_FLEET = {
    "name": "campus",
    "robots": [{"id": "one", "sensors": [{"id": "odometry", "type": "odometry", "rate": 10}]}],
    "compute": [{"id": "edge", "kind": "edge"}],
    "simulation": {"world": "empty", "seed": 5},
}
_MISSION = {
    "format": "aerodaas-mission",
    "version": 1,
    "name": "visit",
    "sensors": ["one/odometry"],
    "navigation": [
        {
            "robot": "one",
            "waypoints": [{"id": "wp", "x": 5.0, "y": 0.0, "z": 2.0, "waypoint_type": "local"}],
        }
    ],
}


def _submit() -> None:
    """Serve a provider in a thread, submit a mission to it, and print the files that it passed."""
    from aerodaas.http_server.addresses import listen  # noqa: PLC0415 - for this walk alone
    from aerodaas.service import mission as missions  # noqa: PLC0415
    from aerodaas.service.access.accounts import Accounts  # noqa: PLC0415
    from aerodaas.service.http.limits import PROVIDER  # noqa: PLC0415
    from aerodaas.service.http.server import AppServer  # noqa: PLC0415
    from aerodaas.service.provider import build_service  # noqa: PLC0415
    from aerodaas.service.settings import ServiceSettings  # noqa: PLC0415
    from aerodaas.service.store import Store  # noqa: PLC0415

    files: dict[str, None] = {}
    with tempfile.TemporaryDirectory(prefix="walk-", dir="/tmp") as name:
        folder = Path(name)
        fleet, walked = folder / "fleet.json", folder / "walked.json"
        fleet.write_text(json.dumps(_FLEET), encoding="utf-8")
        settings = ServiceSettings(fleet, EnvironmentConfig.load(fleet), folder / "s")
        settings.state.mkdir()
        start = missions.start_process

        def started(flight: Any, *, tied: bool, vehicles: bool) -> subprocess.Popen[bytes]:  # noqa: ANN401
            if tied:
                return start(flight, tied=tied, vehicles=vehicles)
            command = [sys.executable, __file__, "flight", "--folder", str(flight.path)]
            return subprocess.Popen(command, env={**os.environ, _FLIGHT: str(walked)})  # noqa: S603

        missions.start_process = started
        listener = listen("127.0.0.1", 0)
        url = f"http://127.0.0.1:{listener.getsockname()[1]}/v1"
        with Store.open(folder / "service.db") as store, _walked(files):
            headers = {"Authorization": f"Bearer {Accounts(store).first_token()}"}
            server = AppServer(listener, PROVIDER)
            server.start(lambda: build_service(settings, store))
            with httpx.Client(headers=headers, timeout=_PATIENCE, trust_env=False) as client:
                while client.get(f"{url}/me").is_error:
                    time.sleep(0.1)
                files.clear()
                client.post(f"{url}/missions", json={"document": _MISSION}).raise_for_status()
                until = time.monotonic() + _PATIENCE
                while not walked.exists() and time.monotonic() < until:
                    time.sleep(0.1)
            service = list(files)
            server.close()
        _print(list(dict.fromkeys([*service, *json.loads(walked.read_text())])))


def _fly(folder: Path) -> None:
    """Fly the order in `folder` up to its launch, and write the files that it passed."""
    from aerodaas.environment.environment import Environment  # noqa: PLC0415 - for one walk alone
    from aerodaas.flights.process import fly  # noqa: PLC0415

    files: dict[str, None] = {}

    def launch(_: Environment) -> None:
        part = Path(os.environ[_FLIGHT] + ".part")
        part.write_text(json.dumps(list(files)), encoding="utf-8")
        part.replace(os.environ[_FLIGHT])
        os._exit(0)

    Environment.launch = launch  # type: ignore[method-assign, assignment]
    with _walked(files):
        fly(folder)


def main(
    walk: Annotated[Literal["frame", "submit", "flight"], typer.Argument()] = "frame",
    folder: Path = _ROOT,
) -> None:
    """Print the files of a walk; `flight` is the part of `submit` in the flight's process."""
    if walk == "flight":
        _fly(folder)
    else:
        (_frame if walk == "frame" else _submit)()


if __name__ == "__main__":
    typer.run(main)
