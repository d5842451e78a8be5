"""One run of an application: from its graph to a landed drone and a closed recording."""

from __future__ import annotations

import atexit
import contextlib
import os
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, TypeAlias

from aerodaas.clock import seconds
from aerodaas.config.extensions import imported, live_views
from aerodaas.config.extras import require_extra
from aerodaas.config.model import TaskConfig
from aerodaas.config.options import LiveViews, Speed, current_options
from aerodaas.config.plugins import is_built_in, load_plugin
from aerodaas.environment.recording_paths import recording_path
from aerodaas.environment.signals import (
    INTERRUPTED,
    TerminatedError,
    end_of_application,
    raise_on_signals,
)
from aerodaas.errors import (
    AeroDaaSError,
    ConfigError,
    GraphError,
    IncompleteError,
    MissionError,
    RecordingError,
    UnknownIdError,
)
from aerodaas.identifiers import told
from aerodaas.messages.mission import MissionState
from aerodaas.mission.commands import Answer, Command, End
from aerodaas.runtime.checks import check_served

if TYPE_CHECKING:
    from aerodaas.actors.run.flight import Flight
    from aerodaas.environment.environment import Environment
    from aerodaas.runtime.inline_flight import InlineFlight
    from aerodaas.runtime.live import LiveReader
    from aerodaas.runtime.plan import FlightPlan
    from aerodaas.runtime.reports import ActorReport, FlightState
    from aerodaas.service.own.flight import OwnFlight
    from aerodaas.service.own.server import FlightServer
    from aerodaas.terminal.console import FlightView

MakeFlight: TypeAlias = "Callable[..., Flight | InlineFlight]"

__all__ = ["Run"]

_LOOK_SECONDS = 0.25
"""Wall seconds between two looks at the missions."""
_BEAT_SECONDS = 0.5
_BEAT_AGE = 1.5
"""Wall seconds after the last look at which a heartbeat needs one of its own."""
_LANDING_SECONDS = 60.0
"""Wall seconds for the drones to land after an interruption."""
_STEPPED = {"simulated", "replayed"}
"""Our drivers of vehicles whose time the run controls; known without importing them."""


class Run:
    """The flight of one environment's robots; made by `Environment.launch`."""

    def __init__(
        self, environment: Environment, number: int = 1, speed: Speed | None = None
    ) -> None:
        """The flight `number` of this environment, counted from 1, at the application's `speed`."""
        self.options = current_options.get().at_speed(speed)
        self._shown: dict[str, Any] = {}
        """Place of each live view of an extension, by the view's name."""
        self.config = environment.config
        self.graph = environment.graph
        self.on_end: list[Callable[[], None]] = []
        self.recording = recording_path(self.options, self.config, number)
        self.state: FlightState | None = None
        self._api: OwnFlight | None = None
        self._console: FlightServer | None = None
        self._servers: list[FlightServer] = []
        self._environment = environment
        self._flight: Flight | InlineFlight | None = None
        self._view: FlightView
        self._over = self._awaited = False
        self._finished = threading.Event()
        self._polling = threading.Lock()
        self._began = time.monotonic()
        self._launched = self._began
        self._looked = 0.0

    @property
    def in_simulated_time(self) -> bool:
        """Whether mission time advances as fast as the machine can process it."""
        simulated = all(_is_stepped(robot.driver) for robot in self.config.robots)
        wanted = self.options.simulated_time
        if wanted and not simulated:
            raise ConfigError('--speed max needs every robot to be simulated; use "--speed 1"')
        return simulated and self.options.speed is None if wanted is None else wanted

    @property
    def _everything_on_ray(self) -> bool:
        """Whether every camera and analysis of a flight runs in an actor."""
        options = self.options
        return not self.in_simulated_time or options.runtime == "ray" or options.address is not None

    @property
    def _uses_ray(self) -> bool:
        """Whether anything of a flight runs in an actor: a part with its own environment does."""
        own = self.config.runtime_env
        nodes = self.graph.nodes.values()
        isolated = (node.runtime_env or told(node.id, own) for node in nodes)
        return self._everything_on_ray or any(env is not None for env in isolated)

    def start(self) -> None:
        """Start all nodes; raises the project's errors, with nothing left running."""
        from aerodaas.recording.provenance import Provenance  # noqa: PLC0415
        from aerodaas.terminal.console import FlightView, StartupView  # noqa: PLC0415

        # Before Ray, which takes seconds to start: errors of the graph should appear at once.
        self._check_served()
        # Before the plan, which has the cameras run that are only recorded.
        document = self._document()
        plan = self.plan()
        if self.recording is not None and self.recording.exists():
            raise RecordingError(
                f"{self.recording} already exists and is not overwritten; "
                "give --record another path or move the file away"
            )
        self._listen()
        with StartupView(self.options) as starting:
            make_flight = self._runtime(plan, starting.begin)
            raise_on_signals()
            provenance = Provenance.collect(
                app=self.options.application,
                config=self.config,
                speed=self._speed_text(),
                document=document,
            )
            options = self.options
            views = LiveViews(options.live, self._shown)
            flight = make_flight(plan, self.recording, provenance, views)
            starting.begin("opening vehicles, cameras and models")
            try:
                flight.launch(starting.step)
            except BaseException:
                flight.stop()
                self._close_servers()
                raise
        self._view = FlightView(self.options, self.config)
        self._flight = flight
        self._launched = time.monotonic()

        def read(stream: str) -> LiveReader:
            reader = flight.reader(stream, lambda: self._over)
            if reader is None:
                raise GraphError(
                    f"{stream} does not run: call get_data_stream() before start_mission()"
                )
            return reader

        for text in self.graph.unused:
            flight.publish_alert("unused", text)
        self.graph.reader = read
        self.graph.flying = True
        for callback in self.graph.on_launch:
            callback()
        threading.Thread(target=self._keep_alive, name="heartbeat", daemon=True).start()
        if self._servers:
            self._serve()
        if self._console is not None:
            from aerodaas.terminal.console import show_console  # noqa: PLC0415

            show_console(self._console.address(), self._console.address(viewer=True))
        atexit.register(self.abandon)

    def _runtime(self, plan: FlightPlan, begin_step: Callable[[str], None]) -> MakeFlight:
        """The class of the flight: in this process, or on Ray, which is then started."""
        if self._uses_ray:
            self._connect(plan, begin_step)
        if not self.in_simulated_time:
            from aerodaas.actors.run.flight import Flight  # noqa: PLC0415 - loads ray

            return Flight
        from aerodaas.runtime.inline_flight import InlineFlight  # noqa: PLC0415

        if not self._uses_ray:
            return InlineFlight
        from aerodaas.actors.node_proxy import Proxies  # noqa: PLC0415 - loads ray

        return partial(InlineFlight, proxies=Proxies(everything=self._everything_on_ray))

    def _connect(self, plan: FlightPlan, begin_step: Callable[[str], None]) -> None:
        from aerodaas.actors.cluster import (  # noqa: PLC0415 - ray only where it is needed
            ray_cluster as cluster,
        )

        cluster.begin(self.options.address)
        import aerodaas.actors.run.flight  # noqa: F401, PLC0415 - loads while Ray starts

        application = plan.session.application
        modules = application.files if application is not None else ()
        cluster.connect(self.options.address, begin_step, modules)

    def _check_served(self) -> None:
        """Raise ConfigError for what cannot be served to others while flying."""
        check_served("--live-address", self.options.live)
        check_served("--console-address", self.options.console)
        if self.options.console is not None:
            require_extra("remote", "--console")
        if self.options.live and self.recording is None:
            raise ConfigError('--live serves what is recorded; set "recording.enabled" to true')
        if self.options.show and self.recording is None:
            raise ConfigError('--show shows what is recorded; set "recording.enabled" to true')
        known = live_views()
        for name in self.options.show:
            if name not in known:
                raise UnknownIdError("live view", name, sorted(known))
            self._shown[name] = imported(known[name].prepare)()

    def _listen(self) -> None:
        """Listen for those who are to be served while flying."""
        if self.options.console is not None:
            from aerodaas.service.own.server import FlightServer  # noqa: PLC0415 - only where asked

            self._console = FlightServer(self.options.console, "--console-address")
            self._servers.append(self._console)
        self._listen_for_remote()

    def _listen_for_remote(self) -> None:
        """Listen for a remote user, if the application asks for it."""
        from aerodaas.analytics.remote import RemoteAnalytics  # noqa: PLC0415 - slow to load

        works = (node.work for node in self.graph.nodes.values())
        wanted = [one.settings for one in works if isinstance(one, RemoteAnalytics)]
        if not wanted or not self.options.remote:
            return
        if any(one != wanted[0] for one in wanted):
            raise ConfigError(
                "one API serves all robots of a flight: give each RemoteAnalytics the same "
                "address and token"
            )
        from aerodaas.service.own.server import FlightServer  # noqa: PLC0415 - only where asked

        self._servers.append(FlightServer.of_remote(wanted[0]))

    def _serve(self) -> None:
        """Serve the flight, which has begun, by each server that does not serve it yet."""
        from aerodaas.service.own.flight import OwnFlight  # noqa: PLC0415 - only where asked for

        if self._servers and self._api is None:
            application = self.options.application
            self._api = OwnFlight(self, application.stem if application else self.config.name)
        for server in self._servers:
            if self._api is not None and not server.serving:
                server.show(self._api)

    def _close_servers(self) -> None:
        if self._api is not None:
            self._api.close()
        for server in self._servers:
            server.close()

    def console(self, address: str, *, viewer: bool) -> str:
        """Serve the console from now on, unless it is served already.

        Args:
            address: Host and port to listen on; ignored if the console is served already.
            viewer: Return the address of those who may watch but not command.

        Returns:
            The address of its page.

        Raises:
            MissionError: Once the run is over.
            ConfigError: For what cannot be listened on.
        """
        if self._flight is None or self._over:
            raise MissionError("the mission is over: there is nothing to be watched")
        require_extra("remote", "the console")
        check_served("address", address)
        if self._console is None:
            from aerodaas.service.own.server import FlightServer  # noqa: PLC0415 - only where asked

            self._console = FlightServer(address, "address")
            self._console.framed = True
            self._servers.append(self._console)
            self._serve()
        return self._console.address(viewer=viewer)

    def end_sensing(self) -> None:
        """End a run without drones."""
        if self._flight is not None:
            self._flight.end_sensing()

    def publish_alert(self, kind: str, text: str) -> None:
        """Publish an alert of this process; nothing once the run is over."""
        if self._flight is not None and not self._finished.is_set():
            self._flight.publish_alert(kind, text)

    def command(self, robot: str, command: Command) -> Answer:
        """Send a robot's mission a command."""
        if self._flight is None or self._finished.is_set():
            raise MissionError(f"{robot} is no longer flying")
        return self._flight.command(robot, command)

    @property
    def over(self) -> bool:
        """True once every mission has ended."""
        return self._over

    def poll(self, newest: int = 200) -> FlightState:
        """Return the present state, with the `newest` latencies of each robot."""
        assert self._flight is not None  # noqa: S101 - launched
        with self._polling:
            self._looked = time.monotonic()
            self.state = self._flight.poll(newest)
            self._view.print_alerts(self.state)
        # One who began to look before the end may come back after it.
        self._over = self._over or self.state.over
        return self.state

    def _keep_alive(self) -> None:
        """Send the drones heartbeats and print alerts, also while the application is busy."""
        said = ""
        while not self._finished.wait(_BEAT_SECONDS):
            if time.monotonic() - self._looked < _BEAT_AGE:
                continue
            try:
                self.poll()
            except AeroDaaSError as error:
                # A thread that waits for the run meets the same error and raises it.
                if not self._awaited and str(error) != said:
                    said = str(error)
                    self._view.say(said)
            except Exception:
                assert self._flight is not None  # noqa: S101 - launched
                if self._flight.reachable:
                    raise
                # The application has left the cluster, at any point of the call: no call can be
                # made any more.
                return

    def reports(self) -> dict[str, ActorReport]:
        """The newest report of each part, by its name; in real time a part is an actor."""
        assert self._flight is not None  # noqa: S101 - launched
        return self._flight.reports()

    def wait(self) -> None:
        """Watch until every mission has ended; raises the error that one ended with.

        Ctrl-C lands the drones first; after a second one they land by themselves.
        """
        if self._finished.is_set():
            return
        assert self._flight is not None  # noqa: S101 - launched
        self._awaited = True
        try:
            self._watch(float("inf"))
        except KeyboardInterrupt:
            self._land(INTERRUPTED)
            raise
        except SystemExit as error:
            self._land(
                error.reason if isinstance(error, TerminatedError) else "the application exits"
            )
            raise
        except AeroDaaSError:
            self._land("the run failed")
            raise
        finally:
            self._finish()
        self._raise_problems()

    def plan(self) -> FlightPlan:
        """Plan the nodes of the flight; raises the errors of a graph that cannot fly."""
        from aerodaas.mission.rehearsal import rehearse  # noqa: PLC0415 - loads geometry
        from aerodaas.runtime.plan import make_plan  # noqa: PLC0415
        from aerodaas.runtime.session import Session  # noqa: PLC0415

        self._check_world()
        self._take_tasks()
        speed = None if self.in_simulated_time else (self.options.speed or 1.0)
        scheduler = self._environment.trajectory_scheduler()
        dispatch_with = self._environment.analytics_scheduler()
        self._change_models()
        application = self._application()
        session = Session(
            self.config,
            speed,
            timetables=self._timetables(),
            edge=None if self.in_simulated_time else self.options.edge,
            locks=self.options.locks,
            application=application,
        )
        compute = self._environment.compute()
        joins = self.options.address or os.environ.get("RAY_ADDRESS")
        plan = make_plan(
            session,
            self.graph,
            compute,
            scheduler,
            dispatch_with,
            here=not joins,
            senses_only=self.options.senses_only,
        )
        for spec in (one for group in plan.drones for one in group):
            rehearse(spec.robot, spec.initial, self.config, spec.scheduler)
        return plan

    def _application(self) -> Any:  # noqa: ANN401 - the actors' own
        """Definitions of the application for actors; None inline.

        Raises GraphError, with the name, for an object that cannot be sent: inline, too, so that
        what flies in simulated time flies in real time.
        """
        from aerodaas.runtime.sending import require_sendable  # noqa: PLC0415

        environment = self._environment
        used = (environment.trajectory_scheduler(), environment.analytics_scheduler())
        plugins = [one for one in used if one is not None]
        application = None
        if self._uses_ray:
            from aerodaas.actors.run.application import capture  # noqa: PLC0415

            application = capture(self.graph, self.config, *plugins)
        require_sendable(self.graph, *plugins)
        return application

    def _check_world(self) -> None:
        """Raise ConfigError for an invalid scenario here rather than in flight."""
        from aerodaas.simulation.scenario import load_scenario  # noqa: PLC0415 - only here

        if any(robot.driver == "simulated" for robot in self.config.robots):
            load_scenario(self.config.simulation.world)

    def _timetables(self) -> dict[str, tuple[int, ...]]:
        """Timetables of a replay's sources; empty in any other flight."""
        if self.options.replay is None:
            return {}
        from aerodaas.recording.replay.environment import (  # noqa: PLC0415 - loads decoders
            read_timetables,
        )

        return read_timetables(self.options.replay)

    def _change_models(self) -> None:
        """Set the command line's model in every detector."""
        if self.options.model is None:
            return
        from aerodaas.analytics.detection.detector import OnnxDetector  # noqa: PLC0415 - 20 MB

        for node in self.graph.nodes.values():
            if isinstance(node.work, OnnxDetector):
                node.work = node.work.with_model(self.options.model)

    def _take_tasks(self) -> None:
        """Merge the application's task profiles into those of the environment file."""
        schedulers = self.config.schedulers
        own = {
            node.id: task
            for node in self.graph.nodes.values()
            if isinstance(task := getattr(node.work, "task", None), TaskConfig)
            and told(node.id, schedulers.tasks) is None
        }
        schedulers = schedulers.model_copy(update={"tasks": {**own, **schedulers.tasks}})
        self.config = self.config.model_copy(update={"schedulers": schedulers})

    def _document(self) -> str:
        """Mission document of what flies; empty for an application that no document can hold."""
        from aerodaas.environment.document.compiling import write_mission  # noqa: PLC0415 - a cycle

        name = self.options.application.stem if self.options.application else ""
        try:
            return write_mission(self._environment, name, here=True).text()
        except Exception:  # noqa: BLE001 - what is noted down keeps nobody from flying
            return ""

    def _speed_text(self) -> str:
        return "max" if self.in_simulated_time else f"{self.options.speed or 1.0:g}"

    def _watch(self, until: float) -> None:
        assert self._flight is not None  # noqa: S101 - launched
        with self._view as watching:
            while time.monotonic() < until:
                state = self.poll()
                watching.update(state)
                if state.over:
                    return
                self._flight.await_end(_LOOK_SECONDS)

    def _land(self, reason: str) -> None:
        """Land every drone, and wait for a limited time."""
        assert self._flight is not None  # noqa: S101 - launched
        for robot in dict.fromkeys(edge.robot for edge in self.graph.navigation):
            # One that does not answer keeps no other one in the air.
            with contextlib.suppress(AeroDaaSError):
                self._flight.command(robot, End(reason))
        with contextlib.suppress(AeroDaaSError):
            self._watch(time.monotonic() + _LANDING_SECONDS)

    def _finish(self) -> None:
        from aerodaas.terminal.console import (  # noqa: PLC0415
            show_headless,
            show_left,
            show_results,
            show_speed,
        )

        assert self._flight is not None  # noqa: S101 - launched
        self._finished.set()
        self._over = True
        self.graph.flying = False
        atexit.unregister(self.abandon)
        self._close_servers()
        flown = time.monotonic() - self._launched
        with self._polling:
            if self._flight.flying:
                self._flight.detach()
                show_left(self._flight.recordings)
                return
            reports = self._flight.stop()
        if self.state is not None:
            # What was told at the very end.
            self.state = replace(self.state, reports=reports, notes=self._flight.notes)
            self._view.print_alerts(self.state)
        for hook in self.on_end:
            hook()
        stamps = [robot.mission.stamp for robot in self.state.robots.values()] if self.state else []
        show_speed(
            self.options, seconds(max(stamps, default=0)), flown, self._launched - self._began
        )
        source = self.config.recording.application_source
        show_results(self.options, self._flight.recordings, source_recorded=source)
        if self._flight.headless:
            show_headless(self._flight.headless, self._flight.recordings)

    def abandon(self) -> None:
        """Land and stop: the application has ended without waiting."""
        if not self._finished.is_set() and self._flight is not None and self._flight.reachable:
            self._land(end_of_application())
            self._finish()

    def _raise_problems(self) -> None:
        assert self._flight is not None  # noqa: S101 - launched
        reports = self._flight.reports().values()
        problems = [str(report.error) for report in reports if report.error]
        problems += [
            line
            for report in reports
            for line in (*report.values.get("last_errors", ()), *report.problems)
        ]
        robots = self.state.robots if self.state else {}
        problems += [
            f"{name}: mission aborted: {robot.mission.reason}"
            for name, robot in robots.items()
            if robot.mission.state is MissionState.ABORTED
        ]
        unfinished = [
            f"{name}: the mission was not completed: {robot.mission.unfinished}"
            for name, robot in robots.items()
            if robot.mission.state is MissionState.LANDED and robot.mission.unfinished
        ]
        if problems or unfinished:
            error = MissionError if problems else IncompleteError
            raise error("; ".join(dict.fromkeys([*problems, *unfinished])))


def _is_stepped(driver: str) -> bool:
    """Whether the vehicles of a driver are `SteppedVehicle`s: the run controls their time."""
    if is_built_in("drivers", driver):
        return driver in _STEPPED
    return hasattr(load_plugin("drivers", driver), "advance_to")
