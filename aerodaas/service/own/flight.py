"""One's own flight behind the API: one mission, whose drones are the fleet."""

from __future__ import annotations

import contextlib
import threading
import time
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from concurrent.futures import TimeoutError as FutureTimeoutError
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol

from aerodaas.analytics.remote import RemoteAnalytics
from aerodaas.clock import host_time_ns, seconds
from aerodaas.config.redaction import catalogue
from aerodaas.errors import AeroDaaSError, ConfigError, SilentError
from aerodaas.messages.health import HealthReport
from aerodaas.messages.mission import GROUNDED, MissionState, MissionStatus, Place, RobotStatus
from aerodaas.mission.commands import AddNavigation, Answer, Command, StreamItem
from aerodaas.protocol.piloting import ActuateIn, ControlsIn, RearrangeIn, told_of_controls
from aerodaas.protocol.scenery import SceneryOut
from aerodaas.protocol.schemas import (
    COMMANDS,
    AccountOut,
    AnalyticsOut,
    CommandIn,
    FleetOut,
    MissionOut,
    MissionPhase,
    NavigationIn,
    PictureForm,
    RobotOut,
    Role,
)
from aerodaas.service.access.principal import Principal, require
from aerodaas.service.backend import PilotCommand
from aerodaas.service.errors import RefusedError
from aerodaas.service.live.packed_reader import PackedReader, drawn_streams, ground_of
from aerodaas.service.own.access import OWN, REMOTE, account_of

if TYPE_CHECKING:
    from aerodaas.config.model import EnvironmentConfig
    from aerodaas.dataflow.graph import Graph
    from aerodaas.runtime.reports import ActorReport, FlightState
    from aerodaas.terrain.ground import Ground

__all__ = ["FlightMeter", "FlightRun", "OwnFlight"]

_ALERTS = 50
"""Most alerts told, the newest ones."""
_PLACES = 200
"""Most waypoints of a robot whose places are known, unless more lie ahead."""


class FlightMeter:
    """Newest status of each robot, and sums over the flight."""

    def __init__(self) -> None:
        self.status: dict[str, RobotStatus] = {}
        """By robot; replaced and never changed, because other threads read it."""
        self.told: dict[str, float] = {}
        """Host time in seconds when each robot's newest status came; replaced as that is."""
        self.alerts: list[str] = []
        self.analytics: AnalyticsOut | None = None
        """Figures of the analytics scheduler; None before its first outcome."""
        self._known: dict[str, dict[str, Place]] = defaultdict(dict)
        """Places of each robot's waypoints by id, those known last at the end."""
        self._flown: dict[str, float] = defaultdict(float)
        self._charges: dict[str, tuple[float, float]] = {}
        """First and newest known charge by robot."""

    @property
    def time(self) -> float:
        """Mission seconds of the newest status."""
        return seconds(max((one.mission.stamp for one in self.status.values()), default=0))

    @property
    def places(self) -> dict[str, dict[str, Place]]:
        """Places of the waypoints that lie behind each robot, by id."""
        known = {name: dict(self._known[name]) for name in self.status}
        for name, status in self.status.items():
            for waypoint in status.mission.ahead:
                known[name].pop(waypoint.id, None)
        return known

    def record(self, state: FlightState) -> None:
        """Record a state of the run."""
        told = {}
        for name, report in state.robots.items():
            now, before = report.mission.stamp, self.status.get(name)
            # The same status again is no news: who told it may hang.
            same = before is not None and before.mission.stamp == now
            told[name] = self.told[name] if same else seconds(host_time_ns())
            if before is not None and report.mission.state not in GROUNDED:
                self._flown[name] += seconds(max(0, now - before.mission.stamp))
            self._remember(name, report.mission)
        self.told = told
        self.status = {name: report.public for name, report in state.robots.items()}
        for name, status in self.status.items():
            if (charge := status.charge) is not None:
                first, _ = self._charges.get(name, (charge, charge))
                self._charges[name] = first, charge
        self.alerts = [f"{one.kind}: {one.text}" for one in state.alerts[-_ALERTS:]]
        dispatcher = state.reports.get("dispatcher")
        if dispatcher is not None:
            self.analytics = AnalyticsOut.of(self.time, dispatcher.values)

    def _remember(self, name: str, mission: MissionStatus) -> None:
        """Add the places of the waypoints ahead, and forget those known for longest."""
        ahead = {one.id: (one.x, one.y, one.z) for one in mission.ahead}
        behind = [one for one in self._known[name].items() if one[0] not in ahead]
        spare = max(0, len(behind) - max(0, _PLACES - len(ahead)))
        self._known[name] = {**dict(behind[spare:]), **ahead}

    def usage(self, reports: Mapping[str, ActorReport]) -> dict[str, Any]:
        """Usage of the flight, as `Outcome` has it; `reports` are its actors'."""
        compute: dict[str, float] = defaultdict(float)
        calls = 0
        for name, report in reports.items():
            kind, _, place = name.partition("/")
            if kind == "analytics" and report.vitals is not None:
                compute["cloud" if place == "cloud" else "edge"] += report.vitals.cpu_seconds
            if kind == "dispatcher":
                calls += sum(one["frames"] for one in report.values.get("sites", {}).values())
        return {
            "flight_seconds": sum(self._flown.values()),
            "distance": sum(one.mission.distance for one in self.status.values()),
            "battery_used": sum(max(0.0, first - last) for first, last in self._charges.values()),
            "compute_seconds": dict(compute),
            "cloud_calls": calls,
        }


_LOOK_SECONDS = 0.1
"""Wall seconds between two looks at the drones while somebody watches."""
_WATCHED_SECONDS = 2.0
"""Wall seconds after which a flight that nobody asked for is not watched any more."""
_ITEM_SECONDS = 0.5
_FAREWELL = 1.0
"""Wall seconds in which watchers are told that the flight is over."""
_PATIENCE = 5.0
"""Wall seconds for a drone's answer; its loop runs at 20 Hz."""
_MOST_ASKED = 32
"""Most commands at once that drones have not answered; further ones wait."""
_NAMED = 8
"""Most waypoints that an alert names."""


class FlightRun(Protocol):
    """The flight, called from several threads."""

    @property
    def config(self) -> EnvironmentConfig:
        """Environment of the flight."""
        ...

    @property
    def graph(self) -> Graph:
        """Its nodes and edges."""
        ...

    @property
    def state(self) -> FlightState | None:
        """State that was polled last."""
        ...

    def poll(self, newest: int = 200) -> FlightState:
        """Its present state; raises AeroDaaSError."""
        ...

    def command(self, robot: str, command: Command) -> Answer:
        """Execute a command on a robot's mission.

        Args:
            robot: Id of the robot.
            command: The command.

        Raises:
            AeroDaaSError: If the robot does not fly or does not answer.
        """
        ...

    def publish_alert(self, kind: str, text: str) -> None:
        """Publish an alert.

        Args:
            kind: Short machine-readable name.
            text: One sentence for the operator.
        """
        ...

    @property
    def over(self) -> bool:
        """Whether every mission has ended."""
        ...


class OwnFlight:
    """The flight as `Missions` and as `Fleet`; safe in any thread."""

    def __init__(self, run: FlightRun, name: str) -> None:
        """Show `run`, an application called `name`."""
        self._run = run
        self._name = name
        self.meter = FlightMeter()
        self._lock = threading.Lock()
        self._looking = threading.Lock()
        self._began = time.time()
        self._version = 0
        self._text: tuple[int, str] = (-1, "")
        self._asked = 0.0
        self._commanded = False
        """Whether a drone has obeyed a command since the last look."""
        self._closed = threading.Event()
        self._commands = ThreadPoolExecutor(_MOST_ASKED, "commands")
        threading.Thread(target=self._poll_while_watched, name="console", daemon=True).start()

    def end(self) -> None:
        """Poll no more: the flight is over."""
        if self._run.state is not None:
            self._record(self._run.state)
        self._closed.set()

    def close(self) -> None:
        """End, and tell whoever watches that the flight is over."""
        self.end()
        if self._watched:
            time.sleep(_FAREWELL)

    @property
    def config(self) -> EnvironmentConfig:
        """Environment of the flight."""
        return self._run.config

    def publish_alert(self, kind: str, text: str) -> None:
        """As `FlightRun.publish_alert`."""
        self._run.publish_alert(kind, text)

    @property
    def over(self) -> bool:
        """Whether the flight is over."""
        return self._closed.is_set()

    def account(self, principal: Principal) -> AccountOut:
        """The account that asks."""
        return account_of(principal)

    def seen_by(self, principal: Principal) -> FleetOut:
        """The drones, and what may be known of where they fly."""
        del principal
        return self._fleet

    @cached_property
    def _fleet(self) -> FleetOut:
        config = self.config
        robots = [
            RobotOut(id=robot.id, sensors=[one.full_id for one in robot.sensors], mission=OWN)
            for robot in config.robots
        ]
        environment = catalogue(config).model_dump(mode="json", by_alias=True)
        return FleetOut(name=config.name, robots=robots, environment=environment)

    def fleet_scenery(self) -> SceneryOut:
        """Ground below the flight on the map."""
        return self._scenery

    @cached_property
    def _scenery(self) -> SceneryOut:
        return SceneryOut.of(self.config)

    def preflight(self, robot: str) -> HealthReport:
        """A robot's list before take-off; raises RefusedError for an unknown robot."""
        if robot not in {one.id for one in self.config.robots}:
            raise RefusedError(404, f"there is no robot {robot}")
        self._refresh()
        status = self.meter.status.get(robot)
        return HealthReport() if status is None else status.health

    def missions(self, principal: Principal) -> list[MissionOut]:
        """The one mission."""
        return [self.mission(principal, OWN)]

    def mission(self, principal: Principal, mission: str) -> MissionOut:
        """The flight as a provider would show it."""
        del principal
        _require_own(mission)
        self._refresh()
        return self._shown()

    def scenery(self, principal: Principal, mission: str) -> SceneryOut:
        """Ground below the flight on the map."""
        del principal
        _require_own(mission)
        return self._scenery

    def fly(self, principal: Principal, mission: str, command: PilotCommand) -> Answer:
        """As `Missions.fly`; an alert tells of the command, and SilentError of no answer."""
        self.require_pilot(principal, mission)
        given, told = _worded(command)
        if isinstance(given, AddNavigation):
            given = self._as_stream_item(command.robot, given)
        sender = "a remote user" if principal.account == REMOTE else "the console"
        asked = f"{sender} asked {command.robot} to {told}" if told else ""
        asking = self._commands.submit(self._run.command, command.robot, given)
        try:
            answer = asking.result(_PATIENCE)
        except FutureTimeoutError:
            # One that still waits for its turn is never given: nobody expects it any more.
            asking.cancel()
            text = f"the drone did not answer within {_PATIENCE:g} s"
            self._alert(asked, text)
            raise SilentError(text) from None
        self._commanded = True
        word = "accepted" if answer.accepted else "refused"
        self._alert(asked, f"{word}{': ' if answer.text else ''}{answer.text}")
        return answer

    def require_pilot(self, principal: Principal, mission: str) -> None:
        """Check that the account may command the flight."""
        _require_own(mission)
        require(principal, Role.PILOT)

    def environment(self, principal: Principal, mission: str) -> EnvironmentConfig:
        """The flight's environment."""
        self.require_pilot(principal, mission)
        return self.config

    def flies(self, principal: Principal, mission: str) -> bool:
        """False: the application, which is here, is the flight's user."""
        del principal, mission
        return False

    def record_presence(self, mission: str) -> None:
        """Do nothing: see `flies`."""

    def version(self, mission: str) -> int:
        """A number that grows with each change; -1 once the flight is over."""
        del mission
        self._asked = time.monotonic()
        return -1 if self.over else self._version

    def text(self, mission: str) -> tuple[str, bool]:
        """The flight as JSON, made once for all that watch it, and whether it is over."""
        with self._lock:
            version = self.version(mission)
            if self._text[0] != version or version < 0:
                self._text = version, self._shown().model_dump_json()
            return self._text[1], version < 0

    def items(
        self, mission: str, stream: str, form: PictureForm
    ) -> Iterator[tuple[dict[str, Any], bytes]]:
        """As `Missions.items`; an empty one a while without any."""
        del mission
        reader = self.reader(stream, form)
        while not self.over:
            yield reader.next_packed(_ITEM_SECONDS) or ({}, b"")

    def reader(self, stream: str, form: PictureForm = PictureForm.WHOLE) -> PackedReader:
        """A reader of a stream.

        Args:
            stream: Name of the stream.
            form: Form of its pictures.

        Raises:
            ConfigError: If there is no such stream.
        """
        graph = self._run.graph
        if stream not in graph.nodes or graph.reader is None:
            raise ConfigError(f"no stream of this mission is called {stream!r}")
        return PackedReader(graph.reader(stream), stream, form, self._ground)

    @cached_property
    def _ground(self) -> Ground | None:
        """Terrain below the flight; it is read when a stream is watched."""
        return ground_of(self.config)

    def _as_stream_item(self, robot: str, command: AddNavigation) -> Command:
        """Waypoints as the stream of a `RemoteAnalytics`, as the application has added that.

        So its priority, deadline and order apply; a command with settings of its own stays.
        """
        if command.clear_first or command.deadline is not None:
            return command
        graph = self._run.graph
        for edge in graph.navigation:
            stream = edge.navigation.stream
            if edge.robot != robot or stream is None:
                continue
            if isinstance(graph.nodes[stream.name].work, RemoteAnalytics):
                navigation, index = command.navigation, command.index
                return StreamItem(stream.name, navigation, index=index, replaces=False)
        return command

    def _alert(self, asked: str, answer: str) -> None:
        """Have an alert tell people of a command and its answer; not of one without words."""
        if asked:
            self._run.publish_alert("console_command", f"{asked}: {answer}")

    def _shown(self) -> MissionOut:
        states = {one.mission.state for one in self.meter.status.values()}
        ended = MissionPhase.FAILED if MissionState.ABORTED in states else MissionPhase.LANDED
        return MissionOut(
            id=OWN,
            name=self._name,
            tenant=OWN,
            account=OWN,
            phase=ended if self.over else MissionPhase.FLYING,
            robots=[robot.id for robot in self.config.robots],
            submitted=self._began,
            started=self._began,
            status=self.meter.status,
            places=self.meter.places,
            told={} if self.over else self.meter.told,
            alerts=self.meter.alerts,
            analytics=self.meter.analytics,
            streams={} if self.over else drawn_streams(self._run.graph),
        )

    def _refresh(self) -> None:
        """Poll the drones, unless somebody watches, so that it is done anyway.

        Who commands and then reads sees its own command's effect.
        """
        watched, self._asked = self._watched, time.monotonic()
        if self._commanded or not watched:
            self._poll()

    @property
    def _watched(self) -> bool:
        return time.monotonic() - self._asked < _WATCHED_SECONDS

    def _poll_while_watched(self) -> None:
        while not self._closed.wait(_LOOK_SECONDS):
            if self._watched:
                self._poll()

    def _poll(self) -> None:
        if self.over or self._run.over:
            return
        self._commanded = False
        # The thread that waits for the run meets the same error and handles it.
        with contextlib.suppress(AeroDaaSError):
            self._record(self._run.poll(0))

    def _record(self, state: FlightState) -> None:
        with self._looking:
            self.meter.record(state)
            self._version += 1


def _require_own(mission: str) -> None:
    if mission != OWN:
        raise RefusedError(404, f"there is no mission {mission}: this one is called {OWN}")


def _worded(command: PilotCommand) -> tuple[Command, str]:
    """A command as the mission takes it, and what people are told that somebody asked for."""
    match command:
        case CommandIn():
            return COMMANDS[command.command], command.command
        case NavigationIn():
            ids = [waypoint.id for waypoint in command.waypoints]
            return command.command(), f"visit {_listed(ids)}"
        case RearrangeIn():
            told = [f"fly {_listed(command.order)} in this order"] if command.order else []
            told += [f"leave out {_listed(command.remove)}"] if command.remove else []
            return command.command(), " and ".join(told) or "do nothing"
        case ActuateIn():
            return command.command(), f"move {command.actuator} to {command.position}"
        case ControlsIn():
            return command.command, told_of_controls(command.command)


def _listed(ids: Sequence[str]) -> str:
    """Some ids by name, and how many they are where that would be too long to read."""
    named = ", ".join(ids[:_NAMED])
    return named if len(ids) <= _NAMED else f"{named}, … ({len(ids)})"
