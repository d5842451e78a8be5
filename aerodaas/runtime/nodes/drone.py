"""Drone node: the 20 Hz setpoint loop of the robots that share a process."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from aerodaas.clock import Clock, host_time_ns
from aerodaas.drivers.loading import link_of
from aerodaas.errors import MissionError, failure_line
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Header
from aerodaas.messages.mission import RobotStatus
from aerodaas.mission.commands import Answer, Command, ReturnHome
from aerodaas.mission.safety.neighbours import SILENT, Neighbours, Whereabouts
from aerodaas.runtime.node import NEVER, Host, Node
from aerodaas.runtime.nodes.controller import MakePlanner, RobotSpec, VehicleController
from aerodaas.runtime.session import CONTROL_RATE, MESSAGE_DEPTH, Session, next_due
from aerodaas.runtime.stream_names import whereabouts_stream

__all__ = ["DroneNode", "failure_of"]


class DroneNode(Node):
    """Flies `robots`: reads each vehicle, updates its mission, sends its setpoint."""

    def __init__(
        self,
        session: Session,
        name: str,
        robots: tuple[RobotSpec, ...],
        make_planner: MakePlanner,
        *,
        neighbours: Sequence[str] = (),
        observed: Mapping[str, float] | None = None,
    ) -> None:
        """Create the vehicles of `robots`; `open` connects them.

        Args:
            session: The run.
            name: Name of the node.
            robots: Robots that share the loop.
            make_planner: Makes the planner of a robot's trajectory scheduler.
            neighbours: Names of the other drone nodes, from whose robots to keep separation.
            observed: Rates in Hz, by source, of what measures a simulated vehicle: its state is
                published at each of their times, too. None where vehicles are observed once a
                cycle.
        """
        reads = dict.fromkeys(_streams(robots), MESSAGE_DEPTH)
        reads.update(dict.fromkeys(map(whereabouts_stream, neighbours), 1))
        super().__init__(name, reads)
        self.failures: dict[str, Exception] = {}
        """What ended the loop for single robots, while it goes on for the others."""
        self._session = session
        self._specs = robots
        self._make_planner = make_planner
        self._neighbours = frozenset(map(whereabouts_stream, neighbours))
        self._whereabouts = Neighbours()
        """Where each robot of this node and of the others is."""
        self._observed = observed
        self._observed_at: dict[str, int] = {}
        """Mission time at which each source measures next."""
        self._controllers: dict[str, VehicleController] = {}
        self._due = NEVER
        self._out: list[Message[Any]] = []

    def open(self, host: Host) -> None:
        """Connect the vehicles; raises VehicleError for one that does not answer."""
        super().open(host)
        controllers = [
            VehicleController(spec, self._session, self._out_append, self._make_planner)
            for spec in self._specs
        ]
        try:
            _at_once(VehicleController.connect, controllers)
        except BaseException:
            # What one has set at its vehicle is put back, though another was not found.
            _at_once(VehicleController.disconnect, controllers)
            raise
        for spec, controller in zip(self._specs, controllers, strict=True):
            for stream in VehicleController.streams(spec):
                self.outlet(stream)
            controller.open(self.outlets)
            self._controllers[controller.id] = controller
        if self._neighbours:
            self.outlet(whereabouts_stream(self.name))

    def _out_append(self, message: Message[Any]) -> None:
        self._out.append(message)

    def start(self, clock: Clock) -> Sequence[Message[Any]]:
        """Start the missions; the first cycle of the loop is due at once."""
        self._due = clock.now()
        for source in self._observed or ():
            self._observed_at[source] = self._next_measurement(source, clock.now() - 1)
        for controller in self._controllers.values():
            controller.start(clock)
        return self._published()

    @property
    def due(self) -> int:
        """Mission time of the loop's next cycle, or of a measurement of a simulated vehicle."""
        if self._observed is None:
            return self._due
        readings = [controller.next_reading for controller in self._controllers.values()]
        return min([self._due, *readings, *self._observed_at.values()])

    def step(self, now: int, inputs: Sequence[Message[Any]]) -> Sequence[Message[Any]]:
        """Handle messages, and execute a cycle of the loop if one is due.

        Args:
            now: Mission clock, nanoseconds.
            inputs: New messages, each stream's in order.

        Raises:
            Exception: What the loop of the only robot raises for a second.
        """
        for message in inputs:
            self._receive(message, now)
        if now >= self.due:
            self._cycle(now)
        return self._published()

    def _published(self) -> list[Message[Any]]:
        published, self._out = self._out, []
        return published

    def _cycle(self, now: int) -> None:
        steers = now >= self._due
        for controller in self._controllers.values():
            self._guarded(controller, self._advance, now, steers)
        if steers:
            self._due = next_due(CONTROL_RATE, now)
        if self._neighbours:
            self._publish_whereabouts(now)
        for source, due in self._observed_at.items():
            if due <= now:
                self._observed_at[source] = self._next_measurement(source, now)
        for controller in self._controllers.values():
            self._guarded(controller, VehicleController.observe, now)

    def _next_measurement(self, source: str, after: int) -> int:
        return self._session.next_due(source, (self._observed or {})[source], after)

    def _advance(self, controller: VehicleController, now: int, steers: bool) -> None:  # noqa: FBT001
        controller.advance_to(now)
        if steers:
            self._steer(controller, now)

    def _steer(self, controller: VehicleController, now: int) -> None:
        separation = controller.mission.limits.separation
        controller.step(now, self._whereabouts.around(controller.id, now, separation))
        state = controller.loop.state
        if state is not None:
            self._whereabouts.update(controller.id, Whereabouts.of(state))
        source = f"drone/{controller.id}"
        for alert in controller.new_alerts():
            self.host.alert(alert.kind, alert.text, now, alert.values, source)

    def _guarded(
        self,
        controller: VehicleController,
        action: Callable[..., object],
        *args: Any,  # noqa: ANN401
    ) -> None:
        """Call an action of one robot's loop; its failure is its own, while others fly."""
        if controller.id in self.failures:
            return
        try:
            action(controller, *args)
        except Exception as error:
            if len(self._controllers) == 1:
                raise
            self.failures[controller.id] = error
            controller.abandon()
            self.host.alert("drone_failed", failure_of(controller.id, error))

    def _publish_whereabouts(self, now: int) -> None:
        """Publish where this node's robots are, for the other drones' nodes."""
        outlet = self.outlet(whereabouts_stream(self.name))
        header = Header(outlet.sent, now, outlet.stream)
        places = self._whereabouts.of(self._controllers)
        self._out.append(outlet.measure(places, header, host_time_ns()))
        for name in self._whereabouts.newly_silent(now, self._controllers):
            self.host.alert("neighbour_silent", _silent(name))

    def _receive(self, message: Message[Any], now: int) -> None:
        if message.stream in self._neighbours:
            for name, where in (message.item or {}).items():
                self._whereabouts.update(name, where)
            return
        for controller in self._controllers.values():
            controller.receive(message, now)

    def command(self, robot: str, command: Command, now: int) -> Answer:
        """Execute a command on one robot's mission.

        Args:
            robot: Id of the robot.
            command: The command.
            now: Mission clock, nanoseconds.

        Raises:
            MissionError: If the robot does not fly.
        """
        if robot in self.failures:
            return Answer(accepted=False, text=failure_of(robot, self.failures[robot]))
        if robot not in self._controllers:
            raise MissionError(f"{robot} does not fly")
        return self._controllers[robot].handle(command, now)

    def return_home(self, reason: str, now: int) -> None:
        """Have every drone return home.

        Args:
            reason: Why, as its mission says it.
            now: Mission clock, nanoseconds.
        """
        for controller in self._controllers.values():
            controller.handle(ReturnHome(reason), now)

    def abandon(self) -> None:
        """Make every vehicle that still flies land by itself."""
        for controller in self._controllers.values():
            if not controller.over:
                controller.abandon()

    @property
    def over(self) -> bool:
        """True once every mission has ended or failed."""
        return all(
            name in self.failures or controller.over
            for name, controller in self._controllers.items()
        )

    @property
    def robots(self) -> tuple[str, ...]:
        """Ids of the robots."""
        return tuple(self._controllers)

    def reports(self) -> dict[str, RobotStatus]:
        """Status and state of each robot, without latencies."""
        return {
            name: RobotStatus(controller.status, controller.state, controller.loop.health)
            for name, controller in self._controllers.items()
        }

    def latencies(self, robot: str, newest: int) -> tuple[float, ...]:
        """Newest latencies from capture to command, milliseconds.

        Args:
            robot: Id of the robot.
            newest: How many.
        """
        return self._controllers[robot].latencies.newest(newest)

    def behaviours_alone(self) -> dict[str, str]:
        """Behaviour of each vehicle without its process, by robot."""
        return {
            name: controller.vehicle.capabilities.alone
            for name, controller in self._controllers.items()
        }

    def close(self) -> None:
        """Disconnect the vehicles."""
        _at_once(VehicleController.disconnect, list(self._controllers.values()))


def failure_of(robot: str, error: Exception) -> str:
    """The line that tells why a robot's loop ended.

    Args:
        robot: Id of the robot.
        error: What the loop raised.
    """
    return f"{robot}: {failure_line(error)}"


def _at_once(
    action: Callable[[VehicleController], object], controllers: Sequence[VehicleController]
) -> None:
    """Call it for all; for those that share a link, and wait for their vehicles, at the same time.

    Raises the first one's error once all are done.
    """
    if len(controllers) <= 1 or any(link_of(one.spec.robot) is None for one in controllers):
        for controller in controllers:
            action(controller)
        return
    with ThreadPoolExecutor(len(controllers)) as threads:
        outcomes = [threads.submit(action, controller) for controller in controllers]
    for outcome in outcomes:
        outcome.result()


def _streams(robots: Iterable[RobotSpec]) -> list[str]:
    """Streams that the node of these robots reads."""
    return [stream for robot in robots for stream in (*robot.navigation, *robot.commands)]


def _silent(robot: str) -> str:
    return (
        f"{robot} has told nothing of its place for {SILENT:g} s: the others keep away from where "
        "it was as from what does not give way"
    )
