"""Missions on a real autopilot in simulation, flown by the test's own 20 Hz loop."""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from typing_extensions import Self

from aerodaas.clock import ScaledClock
from aerodaas.config.model import EnvironmentConfig, RobotConfig
from aerodaas.config.sections.actuators import ActuatorConfig
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.drivers.mavlink.vehicle import MavlinkVehicle
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.messages.mission import MissionState, MissionStatus
from aerodaas.messages.vehicle import VehicleMode, VehicleState
from aerodaas.messages.waypoints import NavigationType, SchedulingType, Waypoint
from aerodaas.mission.commands import AddNavigation, Command, Start
from aerodaas.mission.loop import SetpointLoop
from aerodaas.mission.mission import Mission
from aerodaas.mission.navigation.planner import InlinePlanner
from aerodaas.schedulers.trajectory.nearest_neighbor import NearestNeighborScheduler
from aerodaas.testing.channel import Impairment
from sitl.relay import Relay

__all__ = ["FAR", "FARM", "PERFECT", "SitlFlight", "robot_at", "survey"]

_PERIOD = 0.05
PERFECT = Impairment()
"""A link that loses nothing."""


def survey(*places: tuple[float, float], hover: float = 1.0) -> AddNavigation:
    """Waypoints three metres up, in any order."""
    stops = [Waypoint(f"wp{i}", x, y, 3.0, hover) for i, (x, y) in enumerate(places, 1)]
    kind = NavigationType.DISTANCE_DRIVEN
    return AddNavigation(AeroNavigation(kind, stops, SchedulingType.UNORDERED))


FARM = survey((0, 0), (0, 10), (10, 10), (10, 0), hover=5.0)
FAR = survey((0, 60))


def robot_at(
    url: str,
    settings: Mapping[str, Any] | None = None,
    own: Mapping[str, Any] | None = None,
    **limits: Any,  # noqa: ANN401
) -> RobotConfig:
    """The robot that flies what is found at `url`.

    `settings` of its driver, its `own` ones and its `limits` go on top. Whether the sun is up where
    the simulator stands depends on when a test runs, and is no finding of its.
    """
    own = own or {}
    return RobotConfig.model_validate(
        {
            **own,
            "preflight": {"daylight": "ignore", **own.get("preflight", {})},
            "id": "drone",
            "driver": "mavlink",
            "settings": {"url": url, "ready_timeout": 120.0, **(settings or {})},
            "limits": {
                "cruise_speed": 2.0,
                "takeoff_height": 3.0,
                "takeoff_timeout": 60.0,
                "preflight_timeout": 60.0,
                "arrival_radius": 0.5,
                "battery_return": 0.1,
                "battery_land": 0.05,
                **limits,
            },
        }
    )


class SitlFlight:
    """One mission on its way."""

    def __init__(
        self,
        url: str,
        *commands: Command,
        settings: Mapping[str, Any] | None = None,
        own: Mapping[str, Any] | None = None,
        link: Impairment = PERFECT,
        actuators: Sequence[ActuatorConfig] = (),
        **limits: Any,  # noqa: ANN401
    ) -> None:
        """Connect through a relay with `link`'s faults, and start the mission of `commands`."""
        self.relay = Relay(url)
        self.relay.spoil(link)
        robot = robot_at(self.relay.url, settings, own, **limits)
        robot = robot.model_copy(update={"actuators": list(actuators)})
        self.vehicle = MavlinkVehicle(robot, EnvironmentConfig(robots=[robot]))
        try:
            self._connect(robot, commands)
        except BaseException:
            self.close()
            raise

    def _connect(self, robot: RobotConfig, commands: tuple[Command, ...]) -> None:
        self.vehicle.connect(60.0)
        self.clock = ScaledClock()
        takeoff = self.vehicle.read().odometry.position
        self.mission = Mission(
            robot,
            InlinePlanner(NearestNeighborScheduler()),
            takeoff=takeoff,
            sea_level=self.vehicle.sea_level,
            vehicle=self.vehicle,
        )
        self.loop = SetpointLoop(self.vehicle, self.mission)
        self.states: list[MissionState] = []
        self.modes: list[VehicleMode] = []
        self.vehicle.use_clock(self.clock)
        for command in commands:
            answer = self.tell(command)
            assert answer.accepted, answer.text
        self.tell(Start())

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def tell(self, command: Command) -> Any:  # noqa: ANN401
        """Hand a command to the mission."""
        return self.mission.handle(command, self.clock.now())

    def run(
        self,
        seconds: float,
        until: Callable[[], bool] = lambda: False,
        each: Callable[[VehicleState], None] = lambda _: None,
    ) -> bool:
        """Turn the loop until `until` holds, the mission is over, or time is; True if not time."""
        end = time.monotonic() + seconds
        due = time.monotonic()
        while time.monotonic() < end:
            time.sleep(max(0.0, due - time.monotonic()))
            due = max(due + _PERIOD, time.monotonic())
            self.loop.step(self.clock.now())
            state = self.loop.state
            assert state is not None
            if not self.states or self.states[-1] is not self.mission.state:
                self.states.append(self.mission.state)
            if not self.modes or self.modes[-1] is not state.mode:
                self.modes.append(state.mode)
            each(state)
            if until() or self.mission.finished:
                return True
        return False

    def run_to(self, *states: MissionState, seconds: float = 90.0) -> None:
        """Fly until the mission is in one of `states`; fail if it never is."""
        self.run(seconds, lambda: self.mission.state in states)
        assert self.mission.state in states, self.story

    def wait_for_ground(self, seconds: float = 120.0) -> None:
        """Whoever flies: wait until the motors stand."""
        end = time.monotonic() + seconds
        while self.vehicle.read().armed:
            assert time.monotonic() < end, self.story
            time.sleep(0.1)

    def command_as_station(self, number: int, *values: float) -> None:
        """Have a ground station command the vehicle, over the same link."""
        mav = mavlink.MAVLink(None, 255, 190)
        target = self.vehicle.connection.target
        filled = [*values, *[0.0] * (7 - len(values))]
        message = mavlink.MAVLink_command_long_message(*target, number, 0, *filled)
        self.relay.inject(message.pack(mav))

    def set_parameter(self, name: str, value: float) -> None:
        """Set a parameter of the autopilot's, or of its simulator's."""
        self.vehicle.parameters.set(name, value)

    @property
    def px4(self) -> bool:
        """Whether it is PX4 that flies."""
        return self.vehicle.connection.autopilot.name == "PX4"

    def tell_outcome(self, what: str) -> None:
        """Print what docs/benchmarks.md has of the flight: the truth, and the alerts."""
        witness = self.relay.witness
        up = math.nan if witness.place is None else witness.place[2]
        told = self._told()
        lines = [
            f"{what}: {self.vehicle.connection.autopilot.name}",
            f"  states {[state.value for state in self.states]}; modes {witness.modes}",
            f"  ended {self.status.state.value}: {self.status.reason!r}; {self.status.visited}",
            f"  truly {witness.away:.1f} m from home, {up:.1f} m up; armed {witness.armed}",
            f"  {len(self.mission.alerts)} alerts: {told}",
            f"  its texts: {list(dict.fromkeys(witness.texts))[-8:]}",
        ]
        print("", *lines, sep="\n")  # noqa: T201 - the result itself

    def _told(self) -> dict[str, int]:
        """What people were told, and how often."""
        return dict(Counter(alert.text for alert in self.mission.alerts))

    @property
    def status(self) -> MissionStatus:
        """What the mission says."""
        return self.mission.status

    @property
    def story(self) -> str:
        """What happened, for a failed assertion."""
        states = [state.value for state in self.states]
        modes = [mode.value for mode in self.modes]
        texts = self.vehicle.read().faults if self.vehicle.connected else ()
        alerts = self._told()
        return f"{states} {self.status.reason!r} {modes} {alerts} {texts}"

    def close(self) -> None:
        """Let go."""
        self.vehicle.close()
        self.relay.close()
