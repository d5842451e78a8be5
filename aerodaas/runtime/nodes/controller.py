"""Controller of one drone: vehicle, mission and setpoint loop, and the streams that they feed."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np

from aerodaas.clock import Clock, host_time_ns
from aerodaas.config.model import RobotConfig, SensorConfig
from aerodaas.drivers.loading import load_vehicle
from aerodaas.errors import AeroDaaSError, failure_line
from aerodaas.geometry.frames import GeodeticOrigin
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Header
from aerodaas.messages.mission import MissionStatus, SetpointRecord
from aerodaas.messages.readings import Alert
from aerodaas.messages.vehicle import (
    ClockedVehicle,
    PlayedVehicle,
    SeaLevelVehicle,
    SteppedVehicle,
    VehicleState,
)
from aerodaas.mission.commands import (
    Answer,
    ClearNavigation,
    Command,
    Start,
    StreamItem,
)
from aerodaas.mission.loop import SetpointLoop
from aerodaas.mission.mission import Mission
from aerodaas.mission.navigation.planner import Planner
from aerodaas.mission.rehearsal import give
from aerodaas.mission.safety.ground_clearance import GroundClearance
from aerodaas.mission.safety.neighbours import Neighbour
from aerodaas.runtime.node import NEVER, Latencies, Outlet
from aerodaas.runtime.session import Session
from aerodaas.runtime.stream_names import (
    photo_stream,
    setpoint_stream,
    state_stream,
    status_stream,
)
from aerodaas.schedulers.trajectory.base import TrajectoryScheduler
from aerodaas.terrain.ground import agreed_sea_level

__all__ = ["MakePlanner", "RobotSpec", "VehicleController", "sensor_item"]

_TURNS_FAILED = 20
"""Failed loop cycles in a row (one second) after which the loop gives up the vehicle."""
_LATENCIES_KEPT = 20_000
"""A quarter of an hour's at 20 Hz."""


def sensor_item(sensor: SensorConfig, state: VehicleState, status: MissionStatus) -> object:
    """Reading of one of the vehicle's own sensors; None if the vehicle does not provide it.

    Args:
        sensor: Odometry, gps, battery or status.
        state: The vehicle's state.
        status: The mission's status.
    """
    readings: dict[str, object] = {
        "odometry": state.odometry,
        "gps": state.gps,
        "battery": state.battery,
        "status": status,
    }
    return readings[sensor.type]


@dataclass(frozen=True)
class RobotSpec:
    """Specification of one robot for its node."""

    robot: RobotConfig
    sensors: tuple[SensorConfig, ...]
    """The vehicle's own sensors (no cameras) that have readers."""
    navigation: tuple[str, ...]
    """Streams of navigation for its mission."""
    commands: tuple[str, ...]
    """Streams that carry commands from triggers and cameras."""
    initial: tuple[Command, ...]
    """Navigation known before take-off."""
    scheduler: TrajectoryScheduler


MakePlanner: TypeAlias = Callable[["RobotSpec"], Planner]


class VehicleController:
    """Controller of one robot, called by its node."""

    def __init__(
        self,
        spec: RobotSpec,
        session: Session,
        publish: Callable[[Message[Any]], None],
        make_planner: MakePlanner,
    ) -> None:
        """Create the vehicle; `open` connects it and creates the mission.

        Args:
            spec: The robot.
            session: The run.
            publish: Called with each message to publish.
            make_planner: Makes the planner of the robot's trajectory scheduler.
        """
        self._send = publish
        self._make_planner = make_planner
        self.spec = spec
        self.id = spec.robot.id
        self.latencies = Latencies(_LATENCIES_KEPT)
        """Milliseconds from capture to the arrival of the resulting navigation."""
        self._session = session
        self._alerts_read = 0
        self._photographed = 0
        """How many of the mission's pictures have been published."""
        self._turned = -1
        self._outlets: Mapping[str, Outlet] = {}
        self._due = {sensor.id: self._next_due(sensor, -1) for sensor in spec.sensors}
        self._failures = 0
        """Loop cycles in a row that raised."""
        self._alerts: list[Alert] = []
        self.vehicle = load_vehicle(spec.robot, session.environment)
        self._stepped: SteppedVehicle | None = None
        self._played: PlayedVehicle | None = None

    def connect(self) -> None:
        """Connect the vehicle; in any thread."""
        self.vehicle.connect()

    def disconnect(self) -> None:
        """Disconnect it; in any thread."""
        self.vehicle.close()

    def open(self, outlets: Mapping[str, Outlet]) -> None:
        """Create the mission of the connected vehicle; `outlets` are by stream."""
        self._outlets = outlets
        # Once: to ask a protocol about an instance looks up all its members each time.
        self._stepped = self.vehicle if isinstance(self.vehicle, SteppedVehicle) else None
        self._played = self.vehicle if isinstance(self.vehicle, PlayedVehicle) else None
        robot, environment = self.spec.robot, self._session.environment
        sea_level = self._sea_level()
        takeoff = self.vehicle.read().odometry.position
        home = environment.home
        self.mission = Mission(
            robot,
            self._make_planner(self.spec),
            takeoff=takeoff,
            origin=GeodeticOrigin(home.latitude, home.longitude, home.altitude) if home else None,
            wind=np.array(environment.simulation.wind, dtype=np.float64),
            obeyed=self.vehicle.capabilities.obeys,
            clearance=GroundClearance.of(environment, robot.limits, takeoff, sea_level),
            sea_level=sea_level,
            vehicle=self.vehicle,
        )
        self.loop = SetpointLoop(self.vehicle, self.mission)
        self.state: VehicleState = self.vehicle.read()
        """The newest state used by the loop or a sensor."""
        give(self.id, self.spec.initial, lambda command: self.handle(command, 0))

    def _sea_level(self) -> float | None:
        """Metres of the local frame's zero above the sea: the environment's word, or the vehicle's.

        Raises ConfigError if they contradict each other.
        """
        home = self._session.environment.home
        told = self.vehicle.sea_level if isinstance(self.vehicle, SeaLevelVehicle) else None
        return agreed_sea_level(None if home is None else home.above_sea, told)

    @staticmethod
    def streams(spec: RobotSpec) -> list[str]:
        """Streams that the controller of this robot publishes, except replies."""
        robot = spec.robot.id
        return [
            *(state_stream(robot), status_stream(robot), setpoint_stream(robot)),
            photo_stream(robot),
            *(f"{robot}/{sensor.id}" for sensor in spec.sensors),
        ]

    def start(self, clock: Clock) -> None:
        """Start the mission with the time of `clock`."""
        if isinstance(self.vehicle, ClockedVehicle):
            self.vehicle.use_clock(clock)
            # It was read while connecting, by the vehicle's own clock.
            self.state = replace(self.state, stamp=clock.now())
        if not self._session.simulated:
            # A replay needs the state in which the mission takes off; in simulated time the first
            # cycle, at 0 s, publishes it.
            self._publish(state_stream(self.id), self.state, clock.now())
        self.handle(Start(), clock.now())

    def advance_to(self, stamp: int) -> None:
        """Advance a simulated vehicle's time."""
        if self._stepped is not None:
            self._stepped.advance_to(stamp)

    def handle(self, command: Command, now: int) -> Answer:
        """Execute a command; one that raises is refused, with an alert.

        Args:
            command: The command.
            now: Mission clock, nanoseconds.
        """
        return self.mission.handle(command, now)

    def _raise_alert(self, now: int, kind: str, text: str) -> None:
        self._alerts.append(Alert(Header(len(self._alerts), now, self.id), kind, text))

    def receive(self, message: Message[Any], now: int) -> None:
        """Handle a received message: navigation, or a trigger's command.

        Args:
            message: The message; one of other streams or without item is ignored.
            now: Mission clock, nanoseconds.
        """
        if message.item is None:
            return
        if message.stream in self.spec.navigation:
            self.latencies.append((host_time_ns() - message.captured) / 1e6)
            self.mission.handle(StreamItem(message.stream, message.item, message.header), now)
        elif message.stream in self.spec.commands:
            self.mission.handle(message.item, now)

    def step(self, now: int, neighbours: Iterable[Neighbour]) -> SetpointRecord:
        """Execute one cycle of the setpoint loop and publish setpoint and status.

        A cycle that raises, because of an application's data, empties the queue and lets the
        drone hover; the error is raised only after a second of such cycles.

        Args:
            now: Mission clock, nanoseconds.
            neighbours: The other drones to keep away from.

        Returns:
            The setpoints requested and sent.
        """
        try:
            record = self.loop.step(now, neighbours)
            self._failures = 0
        except Exception as error:
            self._failures += 1
            if self._failures >= _TURNS_FAILED or self.loop.state is None:
                raise
            record = self._recover(error, now)
        self._turned = now
        self._publish(setpoint_stream(self.id), record, now)
        self._publish(status_stream(self.id), self.mission.status, now)
        photos = self.mission.photos
        while self._photographed < len(photos):
            self._publish(photo_stream(self.id), photos[self._photographed], now)
            self._photographed += 1
        return record

    def _recover(self, error: Exception, now: int) -> SetpointRecord:
        if self._failures == 1:
            text = f"the queue was emptied, for flying by it raised {failure_line(error)}"
            self._raise_alert(now, "turn_failed", text)
            self.mission.handle(ClearNavigation(), now)
            with contextlib.suppress(AeroDaaSError):
                self.vehicle.hold()
        return SetpointRecord(now, None, None)

    def observe(self, now: int) -> None:
        """Publish the vehicle's state and the readings of the sensors that are due.

        At the time of a loop cycle the state is the one that the cycle used, so that a replay gets
        the mission's own input.
        """
        seen = self.loop.state if self._turned == now else None
        state = self.state = seen or self.vehicle.read()
        self._publish(state_stream(self.id), state, now)
        for sensor in self.spec.sensors:
            if self._due[sensor.id] <= now:
                self._due[sensor.id] = self._next_due(sensor, now)
                item = sensor_item(sensor, state, self.mission.status)
                self._publish(f"{self.id}/{sensor.id}", item, now)

    def _next_due(self, sensor: SensorConfig, after: int) -> int:
        return self._session.next_due(f"{self.id}/{sensor.id}", sensor.rate, after)

    @property
    def next_reading(self) -> int:
        """Mission time at which the next sensor is due; NEVER without sensors."""
        return min(self._due.values(), default=NEVER)

    @property
    def over(self) -> bool:
        """True after the mission has ended, landed or aborted, or the replay has finished."""
        return self.mission.finished or (self._played is not None and self._played.finished)

    @property
    def status(self) -> MissionStatus:
        """Current status of the mission."""
        return self.mission.status

    def new_alerts(self) -> list[Alert]:
        """Alerts since the last call."""
        alerts = list(self.mission.alerts[self._alerts_read :])
        self._alerts_read += len(alerts)
        alerts += self._alerts
        self._alerts.clear()
        return alerts

    def abandon(self) -> None:
        """Make the vehicle land by itself, after a failure of the node."""
        with contextlib.suppress(AeroDaaSError):
            self.vehicle.land()

    def _publish(self, stream: str, item: object, now: int) -> None:
        outlet = self._outlets[stream]
        self._send(outlet.measure(item, Header(outlet.sent, now, stream), host_time_ns()))
