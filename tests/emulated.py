"""Flights of an emulated PX4 or ArduCopter and its driver, on the clock of the scripted autopilot.

Both ends speak over UDP on loopback; only threads and clocks are taken away, so that the same seed
gives the same flight.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import socket
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, TypeAlias, cast

import numpy as np
import pytest
from autopilot import COMMANDS, SteppedClock, robot_of
from typing_extensions import Self

from aerodaas.clock import Clock
from aerodaas.config.model import EnvironmentConfig, MissionConfig
from aerodaas.config.sections.actuators import ActuatorConfig
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.drivers.mavlink.vehicle import MavlinkVehicle
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.geometry.frames import Vector
from aerodaas.messages.mission import MissionState
from aerodaas.messages.vehicle import PositionSetpoint, Setpoint, VehicleMode, VehicleState
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.commands import AddNavigation, Start
from aerodaas.mission.loop import SetpointLoop
from aerodaas.mission.mission import Mission
from aerodaas.mission.navigation.planner import InlinePlanner
from aerodaas.mission.safety.neighbours import Neighbour
from aerodaas.schedulers.trajectory.ordered import OrderedScheduler
from tools.mavlink_vehicle import AutopilotOptions, EmulatedAutopilot

__all__ = [
    "FAMILIES",
    "LOOPBACK",
    "Flight",
    "FlownMission",
    "Stepped",
    "flight",
    "free_port",
    "inject",
    "told",
]

LOOPBACK = "127.0.0.1"
FAMILIES = ("px4", "ardupilot")
_STEP = 0.025
"""Seconds between two turns of both ends."""
_TURN = 0.05
"""Seconds between two turns of the control loop."""


_WORKER = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw"))
_PORTS = itertools.cycle(range(20_000 + 1_000 * _WORKER, 21_000 + 1_000 * _WORKER))
"""Ports of this worker alone, below those that the kernel gives out by itself."""


def free_port() -> int:
    """A UDP port that nobody uses; each call gives another one."""
    for port in _PORTS:
        with (
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe,
            contextlib.suppress(OSError),
        ):
            probe.bind((LOOPBACK, port))
            return port
    raise AssertionError


class Stepped:
    """Both ends, connected for as long as the `with` lasts."""

    def __init__(
        self,
        monkeypatch: pytest.MonkeyPatch,
        options: AutopilotOptions | None = None,
        actuators: Sequence[ActuatorConfig] = (),
        *,
        beside: Stepped | None = None,
        port: int | None = None,
        router: int | None = None,
        **settings: Any,  # noqa: ANN401
    ) -> None:
        """Prepare both; `options` of the autopilot, `settings` of the driver.

        `beside` others it has their clock and port; the driver may listen at a `port`, and the
        autopilot speak to a `router`'s.
        """
        self.clock = SteppedClock(_STEP) if beside is None else beside.clock
        if beside is None:
            self.clock.drive(monkeypatch)
        self.port = port or (free_port() if beside is None else beside.port)
        options = replace(options or AutopilotOptions(), peer=(LOOPBACK, router or self.port))
        self.autopilot = EmulatedAutopilot(options)
        self.firmware = self.autopilot.firmware
        self.clock.turns.append(self.autopilot.turn)
        if "system" in settings:
            # A wire that may be shared is read by a thread of its own.
            self.clock.turns.append(lambda _: time.sleep(0.001))
        self._settings = {"failsafes": "ignore", "fallback": "ignore", **settings}
        robot = robot_of(self.port, **self._settings)
        self.robot = robot.model_copy(update={"actuators": list(actuators)})
        self.vehicle = MavlinkVehicle(self.robot, EnvironmentConfig(robots=[self.robot]))

    def __enter__(self) -> Self:
        try:
            self.vehicle.connect(20.0)
        except BaseException:
            self._switch_off()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self.vehicle.close()
        self._switch_off()

    def _switch_off(self) -> None:
        self.clock.turns = [turn for turn in self.clock.turns if turn != self.autopilot.turn]
        self.autopilot.stop()

    @contextlib.contextmanager
    def unconnected(self) -> Iterator[Self]:
        """Both ends, not connected yet."""
        try:
            yield self
        finally:
            self.vehicle.close()
            self._switch_off()

    @contextlib.contextmanager
    def again(self, **settings: Any) -> Iterator[MavlinkVehicle]:  # noqa: ANN401
        """Another process' driver of the same vehicle."""
        robot = robot_of(self.port, **{**self._settings, **settings})
        vehicle = MavlinkVehicle(robot, EnvironmentConfig(robots=[robot]))
        vehicle.connect()
        try:
            yield vehicle
        finally:
            vehicle.close()

    def die(self) -> None:
        """As when our process is killed: the wire is cut, nobody says goodbye."""
        self.vehicle.connection.link.close()
        self.vehicle._link = None

    @property
    def now(self) -> float:
        """Seconds of the clock."""
        return self.clock.now

    @property
    def nanoseconds(self) -> int:
        """The mission's clock."""
        return round(self.clock.now * 1e9)

    def advance(self, seconds: float) -> None:
        """Let time pass at both ends, while the control loop stands still."""
        self.clock.advance(seconds)

    def turn(self) -> VehicleState:
        """One turn of the control loop."""
        self.advance(_TURN)
        return self.vehicle.read()

    def until(self, *modes: VehicleMode, timeout: float = 30.0) -> VehicleState:
        """Turn the loop until the driver reports one of `modes`."""
        end = self.now + timeout
        while (state := self.turn()).mode not in modes:
            assert self.now < end, f"still {state.mode} after {timeout:g} s"
        return state

    def wait(self, condition: Callable[[], object], timeout: float = 15.0) -> None:
        """Turn the loop until `condition` holds."""
        end = self.now + timeout
        while not condition():
            assert self.now < end, "waited in vain"
            self.turn()

    def watch(self, duration: float) -> list[VehicleState]:
        """Turn the loop for `duration` seconds; what the driver reported in each turn."""
        return [self.turn() for _ in range(round(duration / _TURN))]

    def stream(self, setpoint: Setpoint, duration: float) -> VehicleState:
        """Send at 20 Hz, as the drone's actor does; what was reported last."""
        state = self.vehicle.read()
        for _ in range(round(duration / _TURN)):
            self.vehicle.send(setpoint)
            state = self.turn()
        return state

    def take_off(self, height: float = 2.0) -> VehicleState:
        """Take off and wait until it can be flown."""
        self.vehicle.take_off(height)
        return self.until(VehicleMode.HOLDING, VehicleMode.GUIDED)

    def guide(self, height: float = 2.0) -> VehicleState:
        """Take off and stream until the autopilot follows."""
        here = PositionSetpoint(self.take_off(height).odometry.position)
        for _ in range(200):
            self.vehicle.send(here)
            if (state := self.turn()).mode is VehicleMode.GUIDED:
                return state
        raise AssertionError("it never followed")

    def fly_to(self, place: Vector, yaw: float | None = None, speed: float = 2.0) -> float:
        """Fly until the driver believes to be there; the true distance left."""
        for _ in range(600):
            self.vehicle.send(PositionSetpoint(place, yaw, speed))
            odometry = self.turn().odometry
            faces = yaw is None or abs(odometry.yaw - yaw) < 0.1
            if float(np.linalg.norm(odometry.position - place)) < 0.15 and faces:
                return float(np.linalg.norm(self.autopilot.truth.position - place))
        raise AssertionError("never arrived")

    def heard(self, *kinds: str) -> list[Any]:
        """Messages of these names that the autopilot got."""
        return [one for _, one in list(self.autopilot.heard) if one.get_type() in kinds]

    def commands(self, number: int, component: int = 1) -> int:
        """How often one of its components got a command."""
        return sum(
            one.command == number and one.target_component == component
            for one in self.heard(*COMMANDS)
        )

    def mission(
        self, stops: Sequence[Waypoint], options: MissionConfig | None = None
    ) -> FlownMission:
        """A mission to `stops` that was started."""
        return FlownMission(self, stops, options)


Flight: TypeAlias = Callable[..., Stepped]
"""Makes one; takes the arguments of `Stepped` but the first."""


@pytest.fixture
def flight(monkeypatch: pytest.MonkeyPatch) -> Flight:
    """Makes flights of an emulated autopilot on a clock that the test moves."""
    return partial(Stepped, monkeypatch)


class FlownMission:
    """A mission of both ends, turn by turn."""

    def __init__(
        self,
        ends: Stepped,
        stops: Sequence[Waypoint],
        options: MissionConfig | None = None,
    ) -> None:
        self.ends = ends
        ends.vehicle.use_clock(cast("Clock", self))
        update = {} if options is None else {"mission": options}
        self.mission = Mission(
            ends.robot.model_copy(update=update),
            InlinePlanner(OrderedScheduler()),
            takeoff=ends.vehicle.read().odometry.position,
            vehicle=ends.vehicle,
        )
        self.neighbours: list[Neighbour] = []
        self.states: list[MissionState] = []
        self.modes: list[VehicleMode] = []
        self.mission.handle(AddNavigation(AeroNavigation(data=list(stops))), self.now())
        self.mission.handle(Start(), self.now())
        self.loop = SetpointLoop(ends.vehicle, self.mission)

    def now(self) -> int:
        """The mission's clock, nanoseconds."""
        return self.ends.nanoseconds

    def turn(self) -> None:
        """One turn of the loop."""
        self.ends.advance(_TURN)
        self.loop.step(self.now(), self.neighbours)
        assert self.loop.state is not None
        self.modes.append(self.loop.state.mode)
        if self.states[-1:] != [self.mission.state]:
            self.states.append(self.mission.state)

    def run(self, seconds: float) -> None:
        """Turn the loop for a while."""
        for _ in range(round(seconds / _TURN)):
            self.turn()

    def until(
        self, condition: MissionState | VehicleMode | Callable[[], object], seconds: float = 120.0
    ) -> None:
        """Turn until the mission is in a state, the vehicle in a mode, or a condition holds."""
        end = self.ends.now + seconds
        while not self._holds(condition):
            assert self.ends.now < end, self.story
            self.turn()

    def _holds(self, condition: MissionState | VehicleMode | Callable[[], object]) -> bool:
        if isinstance(condition, MissionState):
            return self.mission.state is condition
        if isinstance(condition, VehicleMode):
            return self.modes[-1:] == [condition]
        return bool(condition())

    def fly(self, each: Callable[[Mission], None] = lambda _: None) -> Mission:
        """Fly to the end; `each` is called at each turn."""
        end = self.ends.now + 200.0
        while not self.mission.finished:
            assert self.ends.now < end, self.story
            self.turn()
            each(self.mission)
        return self.mission

    def told(self, *kinds: str) -> list[str]:
        """Texts of its alerts, or of those of some kinds."""
        return told(self.mission, *kinds)

    @property
    def visited(self) -> list[str]:
        """Waypoints that count as visited."""
        return list(self.mission.status.visited)

    @property
    def story(self) -> str:
        """For a failed assertion."""
        status = self.mission.status
        return f"{self.states} {status.reason!r} {status.visited} {self.told()}"


def told(mission: Mission, *kinds: str) -> list[str]:
    """Texts of a mission's alerts, or of those of some kinds."""
    return [alert.text for alert in mission.alerts if not kinds or alert.kind in kinds]


def inject(ends: Stepped, message: Any, ids: tuple[int, int] = (1, 1)) -> None:  # noqa: ANN401
    """Have the vehicle, or another system at its address, say something."""
    ends.autopilot.inject(bytes(message.pack(mavlink.MAVLink(None, *ids))))
