"""The mission of one drone: commands and vehicle states in, one action per turn out.

A mission is pure: it reads no clock, never sleeps and starts no thread, so that it can be flown by
the drone's actor, in a test or in a study with the same result. What it cannot do at once, plans,
it asks of a `Planner`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence, Sized

import numpy as np

from aerodaas.clock import seconds
from aerodaas.config import RobotConfig
from aerodaas.data import Alert, Header
from aerodaas.errors import InvalidWaypointError
from aerodaas.geometry import GeodeticOrigin, Vector, body_to_enu, wrap_angle
from aerodaas.navigation.actions import Action, Fly, Hold, Land, Return, TakeOff, Wait
from aerodaas.navigation.commands import (
    AddNavigation,
    Answer,
    ClearNavigation,
    CloseStream,
    Command,
    End,
    OpenStream,
    Pause,
    Resume,
    ReturnHome,
    Start,
    StreamItem,
)
from aerodaas.navigation.control import stopping_point
from aerodaas.navigation.energy import EnergyMeter, EnergyModel
from aerodaas.navigation.geofence import Geofence
from aerodaas.navigation.navigator import LiveCommand, Navigator
from aerodaas.navigation.planner import Planner
from aerodaas.navigation.queue import Stop
from aerodaas.navigation.state_machine import FLYING, TERMINAL, MissionStateMachine
from aerodaas.navigation.supervisor import CALM, Demand, Supervisor, has_position
from aerodaas.schedulers.waypoint.base import Situation
from aerodaas.status import MissionState, MissionStatus
from aerodaas.vehicle import PositionSetpoint, VehicleMode, VehicleState, VelocitySetpoint
from aerodaas.waypoints import AeroNavigation, SchedulingType

__all__ = ["Mission"]

_DONE = Answer(accepted=True)


class Mission:
    """One flight, from the ground to the ground.

    The drone's actor turns the crank 20 times a second::

        action = mission.update(vehicle.read(), clock.now())

    and carries the action out (`aerodaas.navigation.loop.SetpointLoop` does both). Commands may be
    handled between turns, by the same thread.
    """

    def __init__(
        self,
        robot: RobotConfig,
        planner: Planner,
        *,
        takeoff: Vector,
        origin: GeodeticOrigin | None = None,
        wind: Vector | None = None,
    ) -> None:
        """Plan with `planner` for a drone that stands at `takeoff`, ENU metres.

        `origin` pins global waypoints; `wind` (ENU m/s) is for the energy model. Raises ConfigError
        for a geofence that is none.
        """
        limits = robot.limits
        self.fence = Geofence(limits.geofence)
        self.home = takeoff.astype(np.float64)
        self._limits = limits
        self._options = robot.mission
        self._name = robot.id
        self._machine = MissionStateMachine()
        self._meter = EnergyMeter(
            EnergyModel(limits.endurance, np.zeros(3) if wind is None else wind)
        )
        self._supervisor = Supervisor(limits, self.home, self.fence, self._meter)
        self._navigator = Navigator(
            planner,
            self.fence,
            home=self.home,
            max_range=limits.max_range,
            origin=origin,
            command_timeout=limits.command_timeout,
            resume_after=robot.mission.resume_after,
        )
        self._streams: dict[str, OpenStream] = {}
        self._paused = False
        self._groups = 0
        self._assessment = CALM
        self._plan_fault = ""
        self._alerts: list[Alert] = []
        self._alert_count = 0
        self._visited: list[str] = []
        self._given_up: dict[str, str] = {}
        self._distance = 0.0
        self._last: VehicleState | None = None
        self._now = 0
        self._elapsed = 0.0
        self._last_word = 0
        self._anchor: Vector | None = None
        self._serving: Stop | None = None
        self._nearest = math.inf
        self._nearer_at = 0
        self._return_height: float | None = None

    @property
    def state(self) -> MissionState:
        """The present state."""
        return self._machine.state

    @property
    def finished(self) -> bool:
        """Whether the mission is over, completed or not."""
        return self.state in TERMINAL

    @property
    def status(self) -> MissionStatus:
        """Everything that the mission says about itself."""
        stops = [stop.waypoint for stop in self._navigator.queue]
        serving = self._serving is not None and self._serving is self._navigator.queue.head
        texts = [finding.text for finding in self._assessment.findings]
        faults = (*texts, self._navigator.fault, self._plan_fault)
        return MissionStatus(
            self._now,
            self.state,
            self._machine.reason,
            stops[0] if serving else None,
            tuple(stops[1:] if serving else stops),
            tuple(self._visited),
            tuple(self._given_up),
            self._distance,
            tuple(text for text in faults if text),
        )

    def take_alerts(self) -> list[Alert]:
        """Return what people should be told since the last call, oldest first."""
        alerts, self._alerts = self._alerts, []
        return alerts

    # Commands.

    def handle(self, command: Command, now: int) -> Answer:  # noqa: PLR0911 - one a command
        """Obey `command` at `now` (mission clock, nanoseconds), or say why not; raises nothing."""
        self._now = max(self._now, now)
        if self.finished:
            return Answer(accepted=False, text=f"the mission is over: {self.state.value}")
        match command:
            case Start():
                return self._start()
            case AddNavigation():
                if command.clear_first:
                    self._clear()
                stream = OpenStream("", index=command.index, deadline=command.deadline)
                return self._add(command.navigation, stream, command.cause)
            case OpenStream():
                self._streams[command.name] = command
                self._last_word = self._now
                return _DONE
            case StreamItem():
                return self._receive(command)
            case CloseStream():
                self._streams.pop(command.name, None)
                return _DONE
            case ClearNavigation():
                self._clear()
                return _DONE
            case Pause():
                return self._pause()
            case Resume():
                return self._resume()
            case ReturnHome():
                return self._leave(MissionState.RETURNING, command.reason)
            case End():
                return self._leave(MissionState.LANDING, command.reason)

    def _start(self) -> Answer:
        if self.state is not MissionState.IDLE:
            return Answer(accepted=False, text="the mission has already been started")
        self._to(MissionState.PREFLIGHT)
        return _DONE

    def _pause(self) -> Answer:
        if self.state in {MissionState.RETURNING, MissionState.LANDING}:
            text = f"the drone is {self.state.value}, which is not paused"
            return Answer(accepted=False, text=text)
        self._paused = True
        return _DONE

    def _resume(self) -> Answer:
        if not self._paused:
            return Answer(accepted=False, text="the mission is not paused")
        self._paused = False
        self._last_word = self._now
        if self.state is MissionState.PAUSED:
            self._to(MissionState.HOLDING, "resumed")
        return _DONE

    def _leave(self, state: MissionState, reason: str) -> Answer:
        if self.state in {MissionState.IDLE, MissionState.PREFLIGHT}:
            self._to(MissionState.ABORTED, f"{reason} before take-off")
        elif self.state is MissionState.LANDING and state is MissionState.RETURNING:
            return Answer(accepted=False, text="the drone is already landing")
        else:
            self._to(state, reason)
        return _DONE

    def _clear(self) -> None:
        self._navigator.clear()
        self._serving = None
        self._plan_fault = ""
        self._last_word = self._now

    def _receive(self, message: StreamItem) -> Answer:
        stream = self._streams.get(message.name)
        if stream is None:
            return Answer(accepted=False, text=f"no stream called {message.name!r} is open")
        item = message.item
        if item is None or (isinstance(item, Sized) and not len(item)):
            return _DONE
        if stream.clear_first:
            self._clear()
            stream = OpenStream(
                stream.name,
                stream.feeds,
                stream.ordered,
                stream.priority,
                stream.index,
                stream.deadline,
            )
            self._streams[stream.name] = stream
        if not isinstance(item, AeroNavigation):
            return _DONE
        if stream.priority is not None:
            item = AeroNavigation(
                item.navigation_type, item, item.scheduling_type, priority=stream.priority
            )
        return self._add(item, stream, message.cause)

    def _add(self, navigation: AeroNavigation, stream: OpenStream, cause: Header | None) -> Answer:
        if navigation.stream is not None:
            text = "navigation that is a stream is opened with OpenStream, not added"
            return Answer(accepted=False, text=text)
        if not len(navigation):
            return Answer(accepted=False, text="the navigation is empty: there is nothing to fly")
        if self.state in {MissionState.RETURNING, MissionState.LANDING}:
            return Answer(accepted=False, text=f"the drone is {self.state.value} by now")
        for velocity in navigation.commands:
            self._navigator.obey(velocity, self._now, cause)
        taken, refused = self._navigator.admit(
            navigation.waypoints, seconds(self._now), stream.deadline, stream.name
        )
        ordered = navigation.scheduling_type is SchedulingType.ORDERED and stream.ordered
        self._groups += not stream.name
        group = (stream.name or f"group {self._groups}") if ordered else None
        try:
            self._navigator.add(
                taken, group=group, index=stream.index, source=stream.name, cause=cause
            )
        except InvalidWaypointError as error:
            return Answer(accepted=False, text=str(error))
        for waypoint_id, reason in refused.items():
            self._give_up(waypoint_id, reason)
        if taken or navigation.commands:
            self._last_word = self._now
        text = "; ".join(refused.values())
        return Answer(bool(taken or navigation.commands), text, refused)

    # Turns.

    def update(self, state: VehicleState, now: int, objections: Sequence[str] = ()) -> Action:
        """Take one turn of the loop and return what to do.

        `objections` are the vehicle's own reasons against a take-off (`Vehicle.preflight`); they
        matter in the PREFLIGHT state only.
        """
        self._observe(state, now)
        if self.state is MissionState.IDLE or self.finished:
            return Wait()
        if self.state is MissionState.PREFLIGHT:
            return self._preflight(state, objections)
        self._protect(state)
        turns = {
            MissionState.TAKING_OFF: self._take_off,
            MissionState.PAUSED: self._hover,
            MissionState.RETURNING: self._return,
            MissionState.LANDING: self._land,
            MissionState.ABORTED: lambda _: Wait(),
        }
        return turns.get(self.state, self._fly)(state)

    def vehicle_refused(self, text: str) -> None:
        """Take note that the vehicle did not carry out an action, in its own words."""
        if self.state is MissionState.TAKING_OFF:
            self._to(MissionState.ABORTED, f"the vehicle refused to take off: {text}")
        self._alert("refused", text)

    def _observe(self, state: VehicleState, now: int) -> None:
        self._elapsed = seconds(now - self._now) if self._last is not None else 0.0
        self._now = now
        last, self._last = self._last, state
        on_ground = state.mode is VehicleMode.GROUNDED or not has_position(state)
        if last is None or on_ground or not has_position(last):
            return
        self._distance += float(np.linalg.norm(state.odometry.position - last.odometry.position))
        self._meter.observe(
            state.battery.fraction, state.odometry.velocity, seconds(state.stamp - last.stamp)
        )

    def _preflight(self, state: VehicleState, objections: Sequence[str]) -> Action:
        self._plan(state)
        reasons = self._supervisor.objections(state)
        if not (len(self._navigator.queue) or self._is_fed or self._options.on_complete == "hold"):
            refused = "; ".join(self._given_up.values())
            reasons.append(f"there is nothing to fly{': ' if refused else ''}{refused}")
        waited = seconds(self._now - self._machine.since)
        if not reasons and objections and waited >= self._limits.preflight_timeout:
            reasons = list(objections)
        if reasons:
            self._to(MissionState.ABORTED, f"take-off refused: {'; '.join(reasons)}")
            self._alert("takeoff_refused", self._machine.reason)
        elif objections:
            self._to(MissionState.PREFLIGHT, f"not ready: {'; '.join(objections)}")
        else:
            self._to(MissionState.TAKING_OFF)
            return TakeOff(self._limits.takeoff_height)
        return Wait()

    def _protect(self, state: VehicleState) -> None:
        before = {finding.kind for finding in self._assessment.findings}
        self._assessment = self._supervisor.assess(state, self._now)
        for finding in self._assessment.findings:
            if finding.kind not in before:
                self._alert(finding.kind, finding.text)
        demand, reason = self._assessment.demand, self._assessment.gravest.text
        leaving = self.state in {MissionState.RETURNING, MissionState.LANDING}
        if demand is Demand.RELEASE:
            self._to(MissionState.ABORTED, reason)
        elif demand is Demand.LAND and self.state is not MissionState.LANDING:
            self._to(MissionState.LANDING, reason)
        elif demand is Demand.RETURN and not leaving:
            self._to(MissionState.RETURNING, reason)

    def _take_off(self, state: VehicleState) -> Action:
        self._plan(state)
        tolerance = max(self._limits.arrival_radius, 0.1 * self._limits.takeoff_height)
        height = state.odometry.height - float(self.home[2])
        settled = state.mode in {VehicleMode.HOLDING, VehicleMode.GUIDED}
        if settled and height >= self._limits.takeoff_height - tolerance:
            self._to(MissionState.HOLDING)
            self._last_word = self._now
            return self._fly(state)
        if seconds(self._now - self._machine.since) > self._limits.takeoff_timeout:
            self._to(MissionState.LANDING, "the take-off took too long")
            return Land()
        return TakeOff(self._limits.takeoff_height)

    def _fly(self, state: VehicleState) -> Action:
        if self._paused:
            self._to(MissionState.PAUSED)
            return self._hover(state)
        if self._assessment.demand is Demand.HOLD:
            self._to(MissionState.HOLDING, self._assessment.gravest.text)
            return self._hover(state)
        self._plan(state)
        served = self._navigator.served(self._now)
        if isinstance(served, Stop):
            return self._serve(served, state)
        self._serving = None
        if served is not None:
            return self._follow(served, state)
        return self._idle(state)

    def _serve(self, stop: Stop, state: VehicleState) -> Action:
        waited = seconds(self._now - self._machine.since)
        if (
            self._navigator.waits_for_plan
            and not stop.under_way
            and (self.state is not MissionState.HOLDING or waited < self._options.plan_timeout)
        ):
            self._to(MissionState.HOLDING, "waiting for a plan")
            return self._hover(state)
        diverted = MissionState.DIVERTED if self._navigator.queue.interrupted else None
        if stop is not self._serving:
            self._navigator.queue.leave_place()
            self._serving, stop.under_way = stop, True
            self._nearest, self._nearer_at = math.inf, self._now
            self._to(diverted or MissionState.ENROUTE, f"flying to {stop.id}")
        distance = float(np.linalg.norm(stop.waypoint.position - state.odometry.position))
        if stop.arrived:
            stop.remaining_hover -= self._elapsed
        stop.arrived = stop.arrived or self._is_there(stop, distance, state)
        if stop.arrived and stop.remaining_hover <= 0.0:
            self._visited.append(stop.id)
            self._navigator.finish(stop)
            return self._fly(state)
        if not stop.arrived and self._is_stalled(distance):
            self._give_up(stop.id, f"{stop.id} cannot be reached: the drone comes no nearer")
            self._navigator.finish(stop)
            return self._fly(state)
        if stop.arrived:
            self._to(diverted or MissionState.LOITERING, f"at {stop.id}")
        else:
            self._to(diverted or MissionState.ENROUTE, f"flying to {stop.id}")
        self._anchor = None
        return Fly(self._setpoint_to(stop, state), stop.cause)

    def _is_there(self, stop: Stop, distance: float, state: VehicleState) -> bool:
        turned = 0.2  # rad
        asked = stop.waypoint.yaw
        facing = asked is None or abs(wrap_angle(asked - state.odometry.yaw)) < turned
        return facing and distance <= self._limits.arrival_radius

    def _is_stalled(self, distance: float) -> bool:
        progress = 0.1  # m, more than the noise of a position
        if distance < self._nearest - progress:
            self._nearest, self._nearer_at = distance, self._now
        return seconds(self._now - self._nearer_at) > self._options.stall_timeout

    def _setpoint_to(self, stop: Stop, state: VehicleState) -> PositionSetpoint:
        waypoint = stop.waypoint
        way = waypoint.position - state.odometry.position
        yaw, turning_distance = waypoint.yaw, 1.0
        if yaw is None and math.hypot(way[0], way[1]) > turning_distance:
            yaw = math.atan2(way[1], way[0])
        return PositionSetpoint(waypoint.position, yaw, waypoint.speed or self._limits.cruise_speed)

    def _follow(self, live: LiveCommand, state: VehicleState) -> Action:
        waiting = len(self._navigator.queue) > 0
        if self._now >= live.expires:
            self._to(MissionState.DIVERTED if waiting else MissionState.HOLDING, "no fresh command")
            return self._hover(state)
        self._to(MissionState.DIVERTED if waiting else MissionState.FOLLOWING, "following commands")
        self._anchor = None
        command = live.command
        velocity = body_to_enu(command.velocity, state.odometry.yaw)
        return Fly(VelocitySetpoint(velocity, command.yaw_rate), live.cause)

    def _idle(self, state: VehicleState) -> Action:
        options, limits = self._options, self._limits
        if self._is_fed:
            quiet = seconds(self._now - self._last_word)
            if quiet <= limits.command_timeout + limits.silence_return:
                self._to(MissionState.HOLDING, "waiting for navigation")
                return self._hover(state)
            self._to(MissionState.RETURNING, f"navigation has been silent for {quiet:.0f} s")
            return self._return(state)
        if options.on_complete == "hold":
            self._to(MissionState.HOLDING, "all waypoints are visited")
            return self._hover(state)
        if options.on_complete == "land":
            self._to(MissionState.LANDING, "all waypoints are visited")
            return Land()
        self._to(MissionState.RETURNING, "all waypoints are visited")
        return self._return(state)

    def _hover(self, state: VehicleState) -> Action:
        self._serving = None
        if not has_position(state):
            return Hold(None)
        if self._anchor is None:
            odometry = state.odometry
            self._anchor = stopping_point(
                odometry.position, odometry.velocity, self._limits.max_acceleration
            )
        return Hold(self._anchor)

    def _return(self, state: VehicleState) -> Action:
        self._serving = None
        if self._assessment.demand in {Demand.HOLD, Demand.RETURN} and (
            state.mode is VehicleMode.LOST or not has_position(state)
        ):
            return Return()
        if state.mode is VehicleMode.GROUNDED:
            self._to(MissionState.LANDED)
            return Wait()
        position = state.odometry.position
        if self._return_height is None:
            lowest = float(self.home[2]) + self._limits.takeoff_height
            self._return_height = max(float(position[2]), lowest)
        above = np.array([self.home[0], self.home[1], self._return_height])
        way = above - position
        late = seconds(self._now - self._machine.since) > self._limits.return_timeout
        if late or math.hypot(way[0], way[1]) <= self._limits.arrival_radius:
            self._to(MissionState.LANDING, "the return took too long" if late else "above home")
            return Land()
        turning_distance = 1.0
        level = math.hypot(way[0], way[1])
        yaw = math.atan2(way[1], way[0]) if level > turning_distance else None
        return Fly(PositionSetpoint(above, yaw, self._limits.cruise_speed))

    def _land(self, state: VehicleState) -> Action:
        self._serving = None
        if state.mode is VehicleMode.GROUNDED and not state.armed:
            self._to(MissionState.LANDED)
            return Wait()
        waited = seconds(self._now - self._machine.since)
        if state.mode is VehicleMode.LOST and waited > self._limits.return_timeout:
            self._to(MissionState.ABORTED, "the vehicle is lost")
            return Wait()
        return Land()

    def _plan(self, state: VehicleState) -> None:
        if not has_position(state):
            return
        limits = self._limits
        situation = Situation(
            seconds(self._now),
            state.odometry.position,
            self.home,
            state.battery.fraction,
            limits.cruise_speed,
            energy=self._meter.model,
            reserve=limits.battery_land,
        )
        fault = self._navigator.fault
        plan = self._navigator.plan(situation)
        if plan is None:
            return
        for waypoint_id in plan:
            self._give_up(waypoint_id, f"the scheduler left {waypoint_id} out of its plan")
        if self._navigator.fault and self._navigator.fault != fault:
            self._alert("scheduler", self._navigator.fault)
        self._check_energy(situation)

    def _check_energy(self, situation: Situation) -> None:
        route = [stop.waypoint for stop in self._navigator.queue]
        needed = self._meter.route(situation.position, route, self.home, situation.speed)
        available = situation.battery - situation.reserve
        before, self._plan_fault = self._plan_fault, ""
        if route and needed > available:
            self._plan_fault = (
                f"the plan and the way home need {needed:.0%} of a battery, and {available:.0%} "
                "is there to spend: the drone will return before the plan is done"
            )
            if not before:
                self._alert("unreachable_plan", self._plan_fault)

    @property
    def _is_fed(self) -> bool:
        return any(stream.feeds for stream in self._streams.values())

    def _give_up(self, waypoint_id: str, reason: str) -> None:
        self._given_up[waypoint_id] = reason
        self._alert("given_up", reason)

    def _to(self, state: MissionState, reason: str = "") -> None:
        if self._machine.to(state, self._now, reason) and state not in FLYING:
            self._serving = None

    def _alert(self, kind: str, text: str) -> None:
        header = Header(self._alert_count, self._now, f"{self._name}/mission")
        self._alert_count += 1
        self._alerts.append(Alert(header, kind, text))
