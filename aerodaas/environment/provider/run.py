"""ProvidedRun: one run of an application on a provider's drones, and its commands on the wire."""

from __future__ import annotations

import atexit
import contextlib
import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from pydantic import ValidationError

from aerodaas.clock import seconds
from aerodaas.config.extras import require_extra
from aerodaas.config.options import current_options
from aerodaas.environment.provider.client import ProviderClient
from aerodaas.environment.provider.exchange import pauses
from aerodaas.environment.provider.follower import MissionFollower
from aerodaas.environment.provider.here import HereLink, HereServer
from aerodaas.environment.provider.streams import WireReader
from aerodaas.environment.provider.submission import submit
from aerodaas.environment.recording_paths import recording_path
from aerodaas.environment.signals import TerminatedError, end_of_application, raise_on_signals
from aerodaas.errors import (
    AeroDaaSError,
    ConfigError,
    GraphError,
    InvalidWaypointError,
    MissionError,
    RecordingError,
    SourceError,
)
from aerodaas.messages.waypoints import SchedulingType
from aerodaas.mission.commands import (
    Actuate,
    AddNavigation,
    Answer,
    ClearNavigation,
    Command,
    HandOver,
    RearrangeNavigation,
    ReleaseParachute,
    TakeBack,
    initial_commands,
)
from aerodaas.protocol.piloting import ActuateIn, RearrangeIn
from aerodaas.protocol.schemas import CommandIn, MissionOut, MissionPhase, NavigationIn, word_for
from aerodaas.runtime.checks import check_graph

if TYPE_CHECKING:
    from aerodaas.environment.document.compiling import WrittenMission
    from aerodaas.environment.environment import Environment
    from aerodaas.terminal.provided import ProvidedView

__all__ = ["ProvidedRun"]

_LOOK_SECONDS = 0.5
_HOME_SECONDS = 600.0
"""Wall seconds for the drones to come home after Ctrl-C."""
_ENDING_SECONDS = 60.0
"""The same where the process is being ended."""
_OWN = (
    "address",
    "live",
    "show",
    "console",
    "replay",
    "speed",
    "simulated_time",
    "scheduler",
    "model",
)
"""Options of a run by one's own runtime."""


class ProvidedRun:
    """The flight of one environment's robots by their provider; made by `Environment`."""

    def __init__(self, environment: Environment, client: ProviderClient, number: int = 1) -> None:
        """The flight `number` of this environment, counted from 1."""
        self.options = current_options.get()
        self.config = environment.config
        self.graph = environment.graph
        self.on_end: list[Callable[[], None]] = []
        self.recording = recording_path(self.options, self.config, number)
        self._environment = environment
        self._client = client
        self._follower: MissionFollower | None = None
        self._here: HereLink | None = None
        self._view: ProvidedView | None = None
        self._finished = threading.Event()
        self._called_home = False
        self._began = self._flying_since = time.monotonic()

    @property
    def mission(self) -> MissionOut | None:
        """The mission's newest known state at the provider; None before its submission."""
        return None if self._follower is None else self._follower.mission

    @property
    def over(self) -> bool:
        """True once the provider's mission has ended."""
        return self._follower is not None and self._follower.mission.phase.over

    def start(self) -> None:
        """Submit the mission and return once it flies.

        Raises the project's errors: for what cannot be submitted before anything is sent, and
        MissionError with the provider's reason for a mission that is refused.
        """
        from aerodaas.terminal.console import StartupView  # noqa: PLC0415 - slow to load
        from aerodaas.terminal.provided import ProvidedView  # noqa: PLC0415

        self._require_possible()
        written = self._written()
        for text in self.graph.unused:
            self._say(text)
        raise_on_signals()
        with StartupView(self.options) as starting:
            mission = submit(
                self._client, written.document, written.models, self.options, starting.begin
            )
            view = self._view = ProvidedView(shown=self.options.view)
            follower = self._follower = MissionFollower(
                self._client, mission, self._say, on_state=view.print_alerts
            )
            try:
                follower.start()
                self._connect_here(written)
                self._await_flight(starting.begin)
            except BaseException:
                self._give_up()
                raise
        self._flying_since = time.monotonic()
        known = frozenset(self.graph.nodes)

        def read(stream: str) -> WireReader:
            if stream not in known:
                raise GraphError(
                    f"{stream} does not run: call get_data_stream() before start_mission()"
                )
            here = self._here
            if here is None:
                return WireReader(self._client, follower, stream)
            return WireReader(self._client, follower, stream, here.revealed)

        self.graph.reader = read
        self.graph.flying = True
        atexit.register(self.abandon)
        for callback in self.graph.on_launch:
            callback()

    def command(self, robot: str, command: Command) -> Answer:
        """Send a robot's mission a command."""
        if self.over or self._finished.is_set():
            raise MissionError(f"{robot} is no longer flying")
        return _send_command(self._client, self._id, robot, command)

    def wait(self) -> None:
        """Watch until the mission has ended; raises the error that it ended with.

        Ctrl-C has the provider bring the drones home first; after a second one they come home
        without being watched.
        """
        if self._finished.is_set():
            return
        try:
            self._watch(float("inf"))
        except KeyboardInterrupt:
            self._say("the drones come home; Ctrl-C again leaves that to the provider")
            self._come_home(_HOME_SECONDS)
            raise
        except SystemExit as error:
            reason = error.reason if isinstance(error, TerminatedError) else "the application exits"
            self._say(f"{reason}: the drones come home")
            self._come_home(_ENDING_SECONDS)
            raise
        finally:
            self._finish()
        self._raise_problems()

    def abandon(self) -> None:
        """Have the drones come home: the application has ended without waiting."""
        if not self._finished.is_set():
            self._say(f"{end_of_application()}: the drones come home")
            self._come_home(_ENDING_SECONDS)
            self._finish()

    @property
    def _following(self) -> MissionFollower:
        assert self._follower is not None  # noqa: S101 - started
        return self._follower

    @property
    def _id(self) -> str:
        return self._following.mission.id

    def _require_possible(self) -> None:
        """Raise ConfigError, RecordingError for what a provider's flight cannot have."""
        require_extra("remote", "following a provider's mission")
        given = [name for name in _OWN if getattr(self.options, name) not in (None, ())]
        if given:
            raise ConfigError(
                f"--{given[0].replace('_', '-')} is for flights of one's own, and "
                f"{self._client.address.base} flies this one"
            )
        if self.recording is not None and self.recording.exists():
            raise RecordingError(
                f"{self.recording} already exists and is not overwritten; "
                "give --record another path or move the file away"
            )

    def _written(self) -> WrittenMission:
        """The application as a document, after the checks that need no provider."""
        from aerodaas.environment.document.compiling import (  # noqa: PLC0415 - imports this
            compile_mission,
        )
        from aerodaas.mission.rehearsal import rehearse  # noqa: PLC0415 - loads geometry

        application = self.options.application
        name = application.stem if application else self.config.name
        written = compile_mission(self._environment, name, here=True)
        edges = self.graph.navigation
        flying = {edge.robot for edge in edges}
        check_graph(self.graph, self.config, flying)
        for robot in self.config.robots:
            if robot.id in flying:
                mine = [edge for edge in edges if edge.robot == robot.id]
                scheduler = self._environment.trajectory_scheduler()
                rehearse(robot, initial_commands(mine), self.config, scheduler)
        return written

    def _connect_here(self, written: WrittenMission) -> None:
        """Serve what stays at this side, if anything does."""
        if not written.document.here:
            return
        server = HereServer(self._environment, written.document)
        server.open()
        self._here = HereLink(self._client, self._following, server, self._say)

    def _await_flight(self, step: Callable[[str], None]) -> None:
        """Return once the drones fly, or have flown; raises MissionError if they will not."""
        from aerodaas.terminal.provided import phase_text  # noqa: PLC0415 - slow to load

        follower, mission = self._following, self._following.mission
        while not (mission.phase is MissionPhase.FLYING and (mission.status or mission.attach)):
            if mission.phase.over:
                if mission.phase is not MissionPhase.LANDED:
                    raise MissionError(self._reason(mission))
                return
            step(phase_text(mission))
            mission = follower.await_change(follower.changes, _LOOK_SECONDS)

    def _watch(self, until: float) -> None:
        follower = self._following
        assert self._view is not None  # noqa: S101 - started
        with self._view as view:
            while time.monotonic() < until:
                mission = follower.await_change(follower.changes, _LOOK_SECONDS)
                view.update(mission)
                if mission.phase.over:
                    return

    def _come_home(self, patience: float) -> None:
        """Have the provider end the mission, and watch it for a limited time."""
        self._called_home = True
        until, waiting = time.monotonic() + patience, pauses()
        while not self.over and time.monotonic() < until:
            try:
                self._client.cancel(self._id)
                break
            except SourceError:
                time.sleep(min(next(waiting), max(0.0, until - time.monotonic())))
            except AeroDaaSError as error:
                # It is over already, or not ours to end: what follows tells.
                self._say(str(error))
                break
        with contextlib.suppress(AeroDaaSError):
            self._watch(until)

    def _give_up(self) -> None:
        """End a mission that has not begun to fly for this application."""
        if not self.over:
            with contextlib.suppress(AeroDaaSError):
                self._client.cancel(self._id)
        self._close()
        self._finished.set()
        self._report()

    def _report(self) -> None:
        report = self.options.provider.report
        if report is not None:
            report(self._following.mission)

    def _close(self) -> None:
        self._following.close()
        if self._here is not None:
            self._here.close()

    def _finish(self) -> None:
        from aerodaas.terminal.console import show_results, show_speed  # noqa: PLC0415 - slow

        self._finished.set()
        self.graph.flying = False
        atexit.unregister(self.abandon)
        self._close()
        mission = self._following.mission
        if not mission.phase.over:
            self._say(f"the mission goes on at the provider: aerodaas missions watch {mission.id}")
            return
        flown = time.monotonic() - self._flying_since
        here = self._fetch(mission)
        for hook in self.on_end:
            hook()
        stamps = [one.mission.stamp for one in mission.status.values()]
        time_flown = seconds(max(stamps, default=0))
        show_speed(self.options, time_flown, flown, self._flying_since - self._began)
        if here and self.recording is not None:
            show_results(self.options, [self.recording])
        self._report()

    def _fetch(self, mission: MissionOut) -> bool:
        """Fetch the recording; returns whether it is here."""
        from aerodaas.terminal.progress import download_view  # noqa: PLC0415 - slow to load

        path = self.recording
        if path is None or not mission.recording:
            return False
        try:
            with download_view(shown=self.options.view, what="recording") as progress:
                self._client.recording(mission.id, path, progress)
        except (AeroDaaSError, OSError) as error:
            remedy = f"aerodaas missions fetch {mission.id} -o {path}"
            self._say(f"the recording could not be fetched: {error}; {remedy}")
            return False
        return True

    def _raise_problems(self) -> None:
        mission = self._following.mission
        bad = {MissionPhase.REFUSED, MissionPhase.FAILED}
        cancelled = mission.phase is MissionPhase.CANCELLED and not self._called_home
        if mission.phase in bad or cancelled:
            raise MissionError(self._reason(mission))

    @staticmethod
    def _reason(mission: MissionOut) -> str:
        return f"mission {mission.id} {mission.phase.value}: {mission.reason or 'without a reason'}"

    def _say(self, text: str) -> None:
        from rich.console import Console  # noqa: PLC0415 - only when there is something to say

        view = self._view
        if view is not None:
            view.show_message(text)
        else:
            Console(stderr=True, highlight=False, soft_wrap=True).print(text, markup=False)


def _send_command(client: ProviderClient, mission: str, robot: str, command: Command) -> Answer:
    """Send a command over the wire; raises GraphError for one that cannot be given from afar."""
    if isinstance(command, AddNavigation):
        if command.navigation:
            return client.add_navigation(mission, _navigation(robot, command))
        if not command.clear_first:
            return Answer(accepted=False, text="the navigation is empty: there is nothing to fly")
        command = ClearNavigation()
    if isinstance(command, RearrangeNavigation):
        return client.rearrange(mission, _change(robot, command))
    if isinstance(command, Actuate):
        wanted = ActuateIn(robot=robot, actuator=command.actuator, position=command.position)
        return client.actuate(mission, wanted)
    if isinstance(command, ReleaseParachute):
        raise GraphError(f"{robot} flies at a provider, and no parachute is fired from afar")
    if isinstance(command, HandOver | TakeBack):
        raise GraphError(f"{robot} flies at a provider, which hands no waypoints over")
    word = word_for(command)
    if word is None:
        raise GraphError(
            f"{robot} flies at a provider: streams of navigation are connected before "
            "start_mission(); in flight, waypoints can be added"
        )
    return client.command(mission, CommandIn(robot=robot, command=word))


def _navigation(robot: str, command: AddNavigation) -> NavigationIn:
    navigation = command.navigation
    if navigation.commands:
        raise GraphError(f"{robot} flies at a provider, where velocity commands come from analyses")
    try:
        return NavigationIn(
            robot=robot,
            waypoints=list(navigation.waypoints),
            ordered=navigation.scheduling_type is SchedulingType.ORDERED,
            index=command.index,
            deadline=command.deadline,
            clear_first=command.clear_first,
        )
    except ValidationError as error:
        first = error.errors()[0]
        raise InvalidWaypointError(f"{robot}: {first['msg']}") from None


def _change(robot: str, command: RearrangeNavigation) -> RearrangeIn:
    try:
        return RearrangeIn(robot=robot, order=list(command.order), remove=list(command.remove))
    except ValidationError as error:
        first = error.errors()[0]
        raise InvalidWaypointError(f"{robot}: {first['msg']}") from None
