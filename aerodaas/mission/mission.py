"""The mission of one drone: commands and vehicle states in, one request of motion a turn out.

A mission is pure: it reads no clock, never sleeps and starts no thread, so that the drone's node,
a test and a study all fly it with the same result. Long computations, such as plans, are submitted
to a `Planner`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from aerodaas.clock import seconds
from aerodaas.config.model import RobotConfig
from aerodaas.errors import failure_line
from aerodaas.geometry.braking import stopping_point
from aerodaas.geometry.energy import EnergyMeter, EnergyModel
from aerodaas.geometry.frames import GeodeticOrigin, Vector
from aerodaas.messages.mission import RECENT, MissionState, MissionStatus
from aerodaas.messages.payload import Photo
from aerodaas.messages.readings import Alert
from aerodaas.messages.vehicle import Setpoint, VehicleMode, VehicleState
from aerodaas.messages.waypoints import HeightDatum
from aerodaas.mission.action_executor import ActionRunner, Course, action_objection, added_executors
from aerodaas.mission.command_handler import DONE, CommandHandler, ManualControl
from aerodaas.mission.commands import (
    AddNavigation,
    Answer,
    ClearNavigation,
    CloseStream,
    Command,
    End,
    HandOver,
    OpenStream,
    Pause,
    RearrangeNavigation,
    ReleaseControls,
    Resume,
    ReturnHome,
    Start,
    Steer,
    StreamItem,
    TakeBack,
    TakeControls,
)
from aerodaas.mission.forecast import BatteryForecast
from aerodaas.mission.handover import HANDED_OVER, HandoverContext, make_handover
from aerodaas.mission.log import MissionLog
from aerodaas.mission.motion_requests import (
    Fly,
    Hold,
    Land,
    MotionRequest,
    Return,
    Supervise,
    TakeOff,
    Wait,
)
from aerodaas.mission.navigation.cornering import Cornering
from aerodaas.mission.navigation.leg import (
    Leg,
    LegPhase,
    setpoint_towards,
    unreachable,
    velocity_setpoint,
)
from aerodaas.mission.navigation.navigator import LiveCommand, Navigator
from aerodaas.mission.navigation.planner import Planner
from aerodaas.mission.navigation.planning import Planning
from aerodaas.mission.navigation.queue import QueuedWaypoint
from aerodaas.mission.navigation.route import Route
from aerodaas.mission.safety.failsafe import FailsafeAction
from aerodaas.mission.safety.geofence import Geofence
from aerodaas.mission.safety.ground_clearance import GroundClearance
from aerodaas.mission.safety.motors import MotorWatch
from aerodaas.mission.safety.neighbours import Neighbour
from aerodaas.mission.safety.supervisor import CALM, Supervisor, has_position
from aerodaas.mission.state_machine import FLYING, TERMINAL, MissionStateMachine

__all__ = ["Mission"]

_ON_GROUND = frozenset({MissionState.IDLE, MissionState.PREFLIGHT})
_LEAVING = frozenset({MissionState.RETURNING, MissionState.LANDING})
_NAVIGATION = (AddNavigation, StreamItem, RearrangeNavigation, TakeControls, Steer, HandOver)
"""Commands that a drone does not execute any more once it leaves."""
_DRIFT = 0.5
"""Ground speed in m/s below which a landing may begin; above it, the drone overshoots home."""
_BESIDE = 4.0
"""Seconds within twice the arrival radius of home after which a landing begins all the same: an
estimator tells up to 0.8 m/s of a drone that hovers."""
_SETTLED = frozenset({VehicleMode.HOLDING, VehicleMode.GUIDED})


class Mission:
    """One flight, from take-off to landing.

    The drone's node calls `update` 20 times a second::

        request = mission.update(vehicle.read(), clock.now())

    and carries the request out (`aerodaas.mission.loop.SetpointLoop` does both). Commands may be
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
        obeyed: bool = True,
        clearance: GroundClearance | None = None,
        sea_level: float | None = None,
        vehicle: object = None,
    ) -> None:
        """Plan with `planner` for a drone that stands at `takeoff`, ENU metres.

        `origin` pins global waypoints; `wind` (ENU m/s) is for the energy model. `obeyed` is False
        for a recorded vehicle, which lands when it landed in the recording. `clearance` is kept
        above the ground; the local frame's zero lies `sea_level` metres above the sea; `vehicle` is
        what extensions find their equipment at. Raises ConfigError for an invalid geofence.
        """
        self.limits = limits = robot.limits
        self.preflight = robot.preflight
        self.clearance = clearance
        self.fence = Geofence(limits.geofence, clearance.unknown if clearance else None)
        self.home = takeoff.astype(np.float64)
        self._options = robot.mission
        self._obeyed = obeyed
        self._machine = MissionStateMachine()
        self._log = MissionLog(f"{robot.id}/mission")
        self._actions = ActionRunner(added_executors(vehicle, robot, self._log), self._log)
        self._meter = EnergyMeter(
            EnergyModel(limits.endurance, np.zeros(3) if wind is None else wind)
        )
        self._supervisor = Supervisor(limits, self.home, self.fence, self._meter, clearance)
        self._navigator = Navigator(
            planner,
            self.fence,
            home=self.home,
            max_range=limits.max_range,
            origin=origin,
            datum=HeightDatum(sea_level, clearance.ground.height if clearance else None),
            clearance=clearance,
            command_timeout=limits.command_timeout,
            resume_after=robot.mission.resume_after,
            objection=lambda waypoint: action_objection(waypoint, robot),
        )
        self._planning = Planning(self._navigator, robot, self.home, self._meter, self._log)
        self._route = Route(self.fence, limits, self.home, clearance)
        self._cornering = Cornering(self._navigator, self._actions, self._route, limits)
        self.handover = make_handover(
            HandoverContext(vehicle, robot, self._route, clearance, self._log)
        )
        self._command_handler = CommandHandler(self._navigator, self._log)
        self._assessment = CALM
        self._forecast = BatteryForecast(limits, self.home, self._meter, self._log)
        self._manual = ManualControl()
        self._paused = False
        self._unfinished = ""
        self._last: VehicleState | None = None
        self._now = 0
        self._turned_at = 0
        self._elapsed = 0.0
        self._away_at = 0
        """Mission clock at which a returning drone was last away from home, nanoseconds."""
        self._leg: Leg | None = None
        self._motors = MotorWatch(self.home)
        self._anchor: Vector | None = None
        """Position that the drone holds."""

    @property
    def state(self) -> MissionState:
        """The current state."""
        return self._machine.state

    @property
    def finished(self) -> bool:
        """Whether the mission is over, completed or not."""
        return self.state in TERMINAL

    def neighbours(self, state: VehicleState) -> list[Neighbour]:
        """Other aircraft around the vehicle, by the safety rules of extensions."""
        return self._supervisor.neighbours(state)

    @property
    def alerts(self) -> Sequence[Alert]:
        """All alerts for the operator, oldest first; the sequence only grows."""
        return self._log.alerts

    @property
    def photos(self) -> Sequence[Photo]:
        """All pictures taken, oldest first; the sequence only grows."""
        return self._log.photos

    @property
    def status(self) -> MissionStatus:
        """The mission's complete status."""
        stops = list(self._navigator.queue)
        leg = None if self._leg is None else self._leg.stop
        served = bool(stops) and (leg is stops[0] or self.handover.flies)
        waypoints = tuple(stop.waypoint for stop in stops)
        texts = [finding.text for finding in self._assessment.findings]
        return MissionStatus(
            self._now,
            self.state,
            self._machine.reason,
            waypoints[0] if served else None,
            waypoints[1:] if served else waypoints,
            tuple(self._log.visited),
            tuple(self._log.given_up)[-RECENT:],
            self._log.distance,
            tuple(filter(None, (*texts, self._navigator.fault, self._forecast.fault(self._now)))),
            self._log.visits,
            self._log.waypoint_counts(stop.id for stop in stops),
            self._manual.operator(self._now),
            self._forecast.outlook(self._now),
            (len(self._log.photos), self._log.photos_lost),
            self._unfinished,
        )

    def handle(self, command: Command, now: int) -> Answer:
        """Execute `command` or answer why not.

        An exception from a command or a stream's item fails that command alone, and raises an
        alert.

        Args:
            command: The command.
            now: Mission clock, nanoseconds.
        """
        self._now = max(self._now, now)
        try:
            if objection := self._objection(command):
                return Answer(accepted=False, text=objection)
            match command:
                case AddNavigation() | StreamItem() | RearrangeNavigation():
                    return self._command_handler.navigate(command, self._now)
                case TakeControls() | Steer() | ReleaseControls():
                    return self._control_by_hand(command)
                case HandOver() | TakeBack():
                    return self._hand_over(command)
                case _:
                    return self._control(command)
        except Exception as error:  # noqa: BLE001 - a sender's objects may raise anything
            what = f"the command {type(command).__name__}"
            if type(command) is StreamItem:  # isinstance would ask the object itself
                what = f"an item of {command.name}"
            text = f"{what} failed: {failure_line(error)}"
            self._log.alert(self._now, "command_failed", text)
            return Answer(accepted=False, text=text)

    def _objection(self, command: object) -> str:
        """Why no command of this kind is executed in the present state; empty if it is."""
        if self.finished:
            return f"the mission is over: {self.state.value}"
        if self._supervisor.taken_over(self._now) is not None:
            return self._machine.reason
        late = isinstance(command, _NAVIGATION) and self.state in _LEAVING
        return f"the drone is {self.state.value} by now" if late else ""

    def _control(self, command: Command) -> Answer:
        match command:
            case OpenStream():
                self._command_handler.open(command, self._now)
            case CloseStream():
                self._command_handler.close(command)
            case ClearNavigation():
                self._command_handler.clear(self._now)
            case Start() if self.state is MissionState.IDLE:
                self._to(MissionState.PREFLIGHT)
            case Start():
                return Answer(accepted=False, text="the mission has already been started")
            case Pause():
                return self._pause()
            case Resume():
                return self._resume()
            case ReturnHome() | End():
                leaves = isinstance(command, ReturnHome)
                state = MissionState.RETURNING if leaves else MissionState.LANDING
                return self._abandon(state, command.reason)
            case _:
                return self._act(command)
        return DONE

    def _pause(self) -> Answer:
        if self.state in _LEAVING:
            return Answer(accepted=False, text=f"a drone that is {self.state.value} goes on")
        self._paused = True
        return DONE

    def _control_by_hand(self, command: TakeControls | Steer | ReleaseControls) -> Answer:
        takes = isinstance(command, TakeControls)
        if takes and self.state not in FLYING | {MissionState.PAUSED}:
            text = f"a drone is flown by hand in the air only, and it is {self.state.value}"
            return Answer(accepted=False, text=text)
        objection = self._manual.handle(command, self._now)
        self._paused = self._paused or (takes and not objection)
        return Answer(not objection, objection)

    def _hand_over(self, command: HandOver | TakeBack) -> Answer:
        queue, ongoing = list(self._navigator.queue), self._actions.ongoing()
        return self.handover.handle(command, self.state, queue, self._last, self._now, ongoing)

    def take_back(self, reason: str) -> None:
        """Fly by setpoints again, if the autopilot flies the waypoints."""
        self.handover.take_back(reason, self._now)

    def _act(self, command: Command) -> Answer:
        answer = self._actions.handle(command, self.state, self._now)
        self._heed_actions()
        if answer is None:
            raise TypeError(f"{type(command).__name__} is no command of this installation")
        return answer

    def _heed_actions(self) -> None:
        """Land, or end the mission, where an action leaves no other way."""
        if (ending := self._actions.ending()) and not self.finished and ending[0] != self.state:
            self._to(*ending)

    def _resume(self) -> Answer:
        if not self._paused:
            return Answer(accepted=False, text="the mission is not paused")
        if holder := self._manual.operator(self._now):
            return Answer(accepted=False, text=f"{holder} has the controls: let go of them first")
        self._manual = ManualControl()
        self._paused = False
        self._command_handler.last_received = self._now
        if self.state is MissionState.PAUSED:
            self._to(MissionState.HOLDING, "resumed")
        return DONE

    def _abandon(self, state: MissionState, reason: str) -> Answer:
        if self.state in _ON_GROUND:
            self._to(MissionState.ABORTED, f"{reason} before take-off")
        elif self.state is MissionState.LANDING:
            # The reason for the landing stays as it was.
            asked = state is MissionState.LANDING
            return Answer(accepted=asked, text="the drone is already landing")
        else:
            self._to(state, reason, commanded=True)
        return DONE

    def update(
        self, state: VehicleState, now: int, objections: Sequence[str] = ()
    ) -> MotionRequest:
        """Take one turn of the loop and return the request to carry out.

        Args:
            state: The vehicle's state.
            now: Mission clock, nanoseconds.
            objections: The vehicle's own reasons against a take-off (`Vehicle.preflight`); they
                matter in the PREFLIGHT state only.
        """
        self._observe(state, now)
        if self.state is MissionState.IDLE or self.finished:
            return Wait()
        if self.state is MissionState.PREFLIGHT:
            return self._preflight(state, objections)
        # It may be landed before the reason of the takeover is settled.
        if state.mode is VehicleMode.GROUNDED and self._taken_over():
            return Wait()
        if self._motors_stopped(state):
            return Wait()
        self._protect(state)
        if self._taken_over() or (self.state in _LEAVING and self._lost_for_good()):
            return Wait()
        turns = {
            MissionState.TAKING_OFF: self._take_off,
            MissionState.PAUSED: self._stay,
            MissionState.RETURNING: self._return,
            MissionState.LANDING: self._land,
        }
        return turns.get(self.state, self._fly)(state)

    def command_sent(self, request: MotionRequest, setpoint: Setpoint | None) -> None:
        """Compare the motion with `request` from now on.

        Args:
            request: The request that was carried out.
            setpoint: The setpoint as which it was sent; None if as none.
        """
        if self._obeyed:
            self._supervisor.motion.command(request, setpoint)

    def vehicle_refused(self, text: str) -> None:
        """Record that the vehicle refused a request; `text` is the vehicle's message."""
        if self.state is MissionState.TAKING_OFF:
            self._to(MissionState.ABORTED, f"the vehicle refused to take off: {text}")
        self._log.alert(self._now, "refused", text)

    def concern(self, text: str) -> None:
        """Tell people of what does not keep the drone from taking off."""
        self._log.alert(self._now, "preflight", text)

    def _observe(self, state: VehicleState, now: int) -> None:
        self._elapsed = seconds(now - self._turned_at) if self._last is not None else 0.0
        self._now = self._turned_at = now
        self._actions.poll(now)
        self._heed_actions()
        last, self._last = self._last, state
        on_ground = state.mode is VehicleMode.GROUNDED or not has_position(state)
        if last is None or on_ground or not has_position(last):
            return
        self._log.fly(state.odometry.position)
        self._meter.observe(
            state.battery.fraction, state.odometry.velocity, seconds(state.stamp - last.stamp)
        )

    def _motors_stopped(self, state: VehicleState) -> bool:
        """Whether the motors have stopped; if so, end the mission."""
        stop = self._motors.judge(
            state,
            self._now,
            leaving=self._machine.reason if self.state in _LEAVING else None,
            obeyed=self._obeyed,
        )
        if stop is None:
            return False
        if stop.ends is not None:
            self._to(stop.ends, stop.reason)
        if stop.alert:
            self._log.alert(self._now, stop.alert, stop.reason)
        return stop.known

    def _lost_for_good(self) -> bool:
        """Whether the link has been lost for `return_timeout` or longer; if so, end the mission."""
        if reason := self._supervisor.lost_for_good(self._now):
            self._to(MissionState.ABORTED, reason)
            self._log.alert(self._now, "vehicle_lost", reason)
        return bool(reason)

    def _preflight(self, state: VehicleState, objections: Sequence[str]) -> MotionRequest:
        self._planning.plan(state, self._now)
        self._forecast_battery(state)
        reasons = self._supervisor.objections(state)
        waits = self._command_handler.is_fed or self._options.on_complete == "hold"
        if not (waits or len(self._navigator.queue)):
            refused = "; ".join(self._log.given_up.values())
            reasons.append(f"there is nothing to fly{': ' if refused else ''}{refused}")
        waited = seconds(self._now - self._machine.since)
        if not reasons and objections and waited >= self.limits.preflight_timeout:
            reasons = list(objections)
        if reasons:
            self._to(MissionState.ABORTED, f"take-off refused: {'; '.join(reasons)}")
            self._log.alert(self._now, "takeoff_refused", self._machine.reason)
        elif objections:
            self._to(MissionState.PREFLIGHT, f"not ready: {'; '.join(objections)}")
        else:
            self._to(MissionState.TAKING_OFF)
            return TakeOff(self.limits.takeoff_height)
        return Wait()

    def _protect(self, state: VehicleState) -> None:
        before, self._assessment = self._assessment, self._supervisor.assess(state, self._now)
        demand, reason = self._assessment.action, self._assessment.gravest.text
        for fault in self._assessment.new_findings(before):
            self._log.alert(self._now, fault.kind, fault.text, fault.about)
        if self._supervisor.taken_over(self._now) is not None:
            return
        if demand is FailsafeAction.LAND and self.state is not MissionState.LANDING:
            self._to(MissionState.LANDING, reason)
        elif demand is FailsafeAction.RETURN and self.state not in _LEAVING:
            self._to(MissionState.RETURNING, reason)

    def _taken_over(self) -> bool:
        """Whether somebody else flies; if so, end the mission as soon as it is known why."""
        taken = self._supervisor.taken_over(self._now)
        if taken is None:
            return False
        fault, settled = taken
        if settled:
            self._to(MissionState.ABORTED, fault.text)
            self._log.alert(self._now, fault.kind, fault.text)
        else:
            self._to(self.state, "somebody else flies the drone")
            self.take_back(self._machine.reason)
        return True

    def _take_off(self, state: VehicleState) -> MotionRequest:
        self._planning.plan(state, self._now)
        tolerance = max(self.limits.arrival_radius, 0.1 * self.limits.takeoff_height)
        height = state.odometry.height - float(self.home[2])
        if state.mode in _SETTLED and height >= self.limits.takeoff_height - tolerance:
            self._to(MissionState.HOLDING)
            self._command_handler.last_received = self._now
            return self._fly(state)
        if seconds(self._now - self._machine.since) > self.limits.takeoff_timeout:
            self._to(MissionState.LANDING, "the take-off took too long")
            return Land()
        return TakeOff(self.limits.takeoff_height)

    def _fly(self, state: VehicleState) -> MotionRequest:
        if self._paused:
            self._to(MissionState.PAUSED)
            return self._stay(state)
        # An autopilot that flies the plan by itself flies on through a short loss of the link.
        unheard = self.handover.flies and self._assessment.gravest.kind == "link_lost"
        if self._assessment.action is FailsafeAction.HOLD and not unheard:
            self._to(MissionState.HOLDING, self._assessment.gravest.text)
            return self._hover(state)
        if not self.handover.active:
            self._planning.plan(state, self._now)
        self._forecast_battery(state)
        served = self._navigator.served(self._now)
        if isinstance(served, QueuedWaypoint):
            if self.handover.step(list(self._navigator.queue), state, self._now):
                return self._supervise(state)
            return self._serve(served, state)
        self.take_back("what is to be flown has changed")
        self._leg = None
        if served is not None:
            return self._follow(served, state)
        return self._idle(state)

    def _stay(self, state: VehicleState) -> MotionRequest:
        """Hover, unless somebody flies by hand."""
        self._to(MissionState.PAUSED, self._manual.reason(self._now))
        self._forecast_battery(state)
        velocity = self._manual.velocity(self._now)
        if velocity is None or self._assessment.action is FailsafeAction.HOLD:
            return self._hover(state)
        self._leg = self._anchor = None
        return Fly(velocity_setpoint(velocity, state))

    def _supervise(self, state: VehicleState) -> MotionRequest:
        self._leg = self._anchor = None
        for stop in self.handover.follow(state, self._now, self._elapsed):
            self._finish(stop, LegPhase.DONE)
        head = self._navigator.queue.head
        if not self.handover.flies or head is None:
            return self._fly(state)
        self._to(*self.handover.situation(head))
        return Supervise()

    def _serve(self, stop: QueuedWaypoint, state: VehicleState) -> MotionRequest:
        holds = self.state is MissionState.HOLDING
        if self._planning.awaited(stop, self._machine.since if holds else None, self._now):
            self._to(MissionState.HOLDING, "waiting for a plan")
            return self._hover(state)
        limits = self.limits
        diverted = MissionState.DIVERTED if self._navigator.queue.interrupted else None
        if self._leg is None or self._leg.stop is not stop:
            self._navigator.queue.leave_place()
            stall = self._options.stall_timeout
            self._leg = Leg(stop, self._now, limits.arrival_radius, stall, self._leg)
            self._to(diverted or MissionState.ENROUTE, f"flying to {stop.id}")
        position = state.odometry.position
        phase = self._leg.advance(state.odometry, self._now, self._elapsed)
        busy = self._actions.attend(stop, state.odometry, self._now)
        if interruption := self._actions.interruption():
            return self._interrupt(*interruption, state)
        if busy and phase is LegPhase.DONE:
            phase = LegPhase.HOVERING
        routed = self._route.towards(stop.waypoint.position, position, stop.above_ground)
        if routed is None or phase in {LegPhase.DONE, LegPhase.STALLED}:
            self._finish(stop, phase)
            return self._fly(state)
        stays = phase is LegPhase.HOVERING
        doing = MissionState.LOITERING if stays else MissionState.ENROUTE
        self._to(diverted or doing, f"{'at' if stays else 'flying to'} {stop.id}")
        self._anchor = None
        course = self._actions.steer(Course(routed), state.odometry, self._now)
        passing = self._cornering.passing_speed(self._leg, course, state.odometry)
        flown = self._leg.setpoint(
            course.place, position, limits.cruise_speed, course.heading, passing
        )
        return Fly(flown, stop.cause)

    def _interrupt(
        self, following: MissionState, reason: str, state: VehicleState
    ) -> MotionRequest:
        """Pause or return after the failure of an action."""
        if following is MissionState.PAUSED:
            self._paused = True
            return self._stay(state)
        self._to(following, reason)
        return self._return(state)

    def _finish(self, stop: QueuedWaypoint, phase: LegPhase) -> None:
        if phase is LegPhase.DONE:
            self._log.visit(stop.id)
        else:
            why = unreachable(stop, phase, self._last, self.limits)
            self._log.give_up(self._now, stop.id, why)
            self._unfinished = self._unfinished or why
        self._navigator.finish(stop)

    def _follow(self, live: LiveCommand, state: VehicleState) -> MotionRequest:
        waiting = len(self._navigator.queue) > 0
        if self._now >= live.expires:
            self._to(MissionState.DIVERTED if waiting else MissionState.HOLDING, "no fresh command")
            return self._hover(state)
        self._to(MissionState.DIVERTED if waiting else MissionState.FOLLOWING, "following commands")
        self._anchor = None
        return Fly(velocity_setpoint(live.command, state), live.cause)

    def _idle(self, state: VehicleState) -> MotionRequest:
        options, limits = self._options, self.limits
        if self._command_handler.is_fed:
            quiet = seconds(self._now - self._command_handler.last_received)
            if quiet <= limits.command_timeout + limits.silence_return:
                self._to(MissionState.HOLDING, "waiting for navigation")
                return self._hover(state)
            self._to(MissionState.RETURNING, f"navigation has been silent for {quiet:.0f} s")
            return self._return(state)
        ending = self._log.completion()
        if options.on_complete == "return":
            self._to(MissionState.RETURNING, ending)
            return self._return(state)
        if options.on_complete == "land":
            self._to(MissionState.LANDING, ending)
            return Land()
        self._to(MissionState.HOLDING, ending)
        return self._hover(state)

    def _hover(self, state: VehicleState) -> MotionRequest:
        self._leg = None
        if not has_position(state):
            return Hold(None)
        if self._anchor is None:
            odometry = state.odometry
            self._anchor = stopping_point(
                odometry.position, odometry.velocity, self.limits.max_acceleration
            )
        return Hold(self._anchor)

    def _return(self, state: VehicleState) -> MotionRequest:
        self._leg = None
        lost = state.mode is VehicleMode.LOST or not has_position(state)
        if lost and self._assessment.action in {FailsafeAction.HOLD, FailsafeAction.RETURN}:
            return Return()
        position = state.odometry.position
        way = (above := self._route.above_home(position)) - position
        late = seconds(self._now - self._machine.since) > self.limits.return_timeout
        stuck = self._supervisor.motion.stands_for > self._options.stall_timeout
        drift = math.hypot(*state.odometry.velocity[:2])
        away, radius = math.hypot(way[0], way[1]), self.limits.arrival_radius
        if away > 2 * radius:
            self._away_at = self._now
        beside = seconds(self._now - max(self._away_at, self._machine.since)) >= _BESIDE
        if late or stuck or beside or (away <= radius and drift <= _DRIFT):
            why = "the return took too long; " if late else ""
            why = "the drone comes no nearer to home; " if stuck else why
            self._to(MissionState.LANDING, f"{why}{self._machine.reason}")
            return Land()
        place = self._route.towards(above, position)
        if place is None:
            self._to(MissionState.LANDING, "no way inside the geofence leads home")
            return Land()
        return Fly(setpoint_towards(place, position, None, self.limits.cruise_speed))

    def _land(self, _: VehicleState) -> MotionRequest:
        self._leg = None
        return Land()

    def _forecast_battery(self, state: VehicleState) -> None:
        grounded = self.state is MissionState.PREFLIGHT
        self._forecast.update(self._now, state, self._navigator.queue, grounded=grounded)

    def _to(self, state: MissionState, reason: str = "", *, commanded: bool = False) -> None:
        if state not in HANDED_OVER:
            self.take_back(reason or state.value)
        if state in _LEAVING and self.state not in _LEAVING and not commanded:
            self._note_unfinished(reason)
        self._machine.to(state, self._now, reason)
        self._actions.on_state(self.state, self._now)

    def _note_unfinished(self, reason: str) -> None:
        """Record why the drone leaves, if it does so with waypoints ahead or in its take-off."""
        ahead = len(self._navigator.queue)
        if ahead:
            waypoints = "1 waypoint" if ahead == 1 else f"{ahead} waypoints"
            self._unfinished = f"{reason}, with {waypoints} left"
        elif self.state is MissionState.TAKING_OFF:
            self._unfinished = reason
