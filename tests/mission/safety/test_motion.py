"""A drone that does not move as commanded: wind carries it off, or it stands, motors on."""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np
import pytest
from flights import KinematicVehicle, add, flight
from hypothesis import given
from hypothesis import strategies as st

from aerodaas.clock import NANOSECONDS
from aerodaas.config.model import (
    EnvironmentConfig,
    GeofenceConfig,
    LimitsConfig,
    MissionConfig,
    RobotConfig,
)
from aerodaas.drivers.simulated import SimulatedVehicle
from aerodaas.geometry.frames import Vector
from aerodaas.messages.mission import MissionState as S
from aerodaas.messages.odometry import Battery, Odometry
from aerodaas.messages.vehicle import VehicleMode, VehicleState, VelocitySetpoint
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.commands import ReturnHome, Start
from aerodaas.mission.loop import SetpointLoop
from aerodaas.mission.mission import Mission
from aerodaas.mission.motion_requests import Fly
from aerodaas.mission.navigation.planner import InlinePlanner
from aerodaas.mission.safety.motion import MotionWatch
from aerodaas.schedulers.trajectory.ordered import OrderedScheduler

_PERIOD = NANOSECONDS // 20
_SQUARE = [(-60.0, -60.0), (60.0, -60.0), (60.0, 60.0), (-60.0, 60.0)]


class WindyFlight:
    """A simulated drone in wind, flown by its mission."""

    def __init__(
        self,
        waypoints: list[Waypoint],
        wind: tuple[float, float, float],
        gust: float = 0.0,
        tilt: float = 20.0,
        **limits: Any,  # noqa: ANN401
    ) -> None:
        """Fly `waypoints` in a `wind` (ENU m/s) with a drone that tilts by `tilt` degrees."""
        base = {"cruise_speed": 3.0, "takeoff_height": 5.0, "takeoff_timeout": 60.0}
        robot = RobotConfig(
            id="drone",
            limits=LimitsConfig.model_validate({**base, **limits}),
            settings={"max_tilt": tilt},
        )
        environment = EnvironmentConfig.model_validate(
            {"robots": [robot], "simulation": {"world": "empty", "wind": wind, "gust": gust}}
        )
        self.vehicle = SimulatedVehicle(robot, environment)
        self.vehicle.connect()
        planner = InlinePlanner(OrderedScheduler())
        self.mission = Mission(robot, planner, takeoff=np.zeros(3))
        self.loop = SetpointLoop(self.vehicle, self.mission)
        self.now = 0
        self.places: list[Vector] = []
        self.states: list[S] = []
        for command in (add(*waypoints), Start()):
            assert self.mission.handle(command, 0).accepted

    def run(self, duration: float) -> None:
        """Fly for `duration` seconds, or until the mission is over."""
        end = self.now + round(duration * NANOSECONDS)
        while self.now < end and not self.mission.finished:
            self.now += _PERIOD
            self.vehicle.advance_to(self.now)
            self.loop.step(self.now)
            truth = self.vehicle.read().truth
            assert truth is not None
            self.places.append(truth.position)
            self.states.append(self.mission.state)

    @property
    def farthest(self) -> float:
        """Metres from home at which it was at most."""
        return max(math.hypot(*place[:2]) for place in self.places)

    @property
    def alerts(self) -> list[str]:
        """Kinds of its alerts."""
        return [alert.kind for alert in self.mission.alerts]


_STORM = (12.0, 0.0, 0.0)
"""Wind against which a drone that tilts by 20 degrees makes no way."""
_FENCED = LimitsConfig(
    cruise_speed=3.0, geofence=GeofenceConfig(polygon=[(-20, -20), (40, -20), (40, 20), (-20, 20)])
)


def test_a_drone_in_wind_that_it_cannot_hold_lands_and_says_so() -> None:
    """Against 12 m/s it makes no way: it is down within half a minute, inside its fence."""
    places = [Waypoint(f"w{number}", -30, 0, 8) for number in range(3)]
    blown = WindyFlight(places, _STORM, geofence=GeofenceConfig(polygon=_SQUARE))
    blown.run(60.0)
    assert blown.mission.state is S.LANDED, blown.mission.status.reason
    assert "wind" in blown.mission.status.reason
    assert "wind" in blown.alerts
    assert blown.farthest < 60.0


@pytest.mark.parametrize(
    ("wind", "gust"), [((8.0, 0.0, 0.0), 1.0), ((-4.0, 5.0, 0.0), 2.0), ((0.0, -10.0, 0.0), 0.5)]
)
def test_wind_that_it_can_hold_ends_no_flight(
    wind: tuple[float, float, float], gust: float
) -> None:
    """With 30 degrees of tilt it visits all corners, in gusts too, and nothing is told of wind."""
    corners = [Waypoint("a", 20, 0, 6, 2.0), Waypoint("b", 20, 20, 6), Waypoint("c", 0, 20, 8)]
    held = WindyFlight(corners, wind, gust, tilt=30.0, preflight_timeout=1.0)
    held.run(300.0)
    assert held.mission.state is S.LANDED
    assert held.mission.status.reason == "all waypoints are visited"
    assert not {"wind", "geofence", "motors_running"} & set(held.alerts)


def test_wind_that_rises_in_flight_sends_the_drone_home() -> None:
    """Carried off on its way east, towards home, it comes home and lands there."""
    away = flight(add(Waypoint("far", 35, 0, 3)), limits=_FENCED)
    away.run(until=lambda: away.vehicle.position[0] > 15.0)
    away.vehicle.wind = np.array([-5.0, 0.0, 0.0])
    away.run(until=lambda: away.mission.state is S.RETURNING)
    away.vehicle.wind = np.zeros(3)
    away.run()
    away.expect(S.LANDED)
    assert "wind" in away.status.reason
    assert float(np.linalg.norm(away.vehicle.position)) < 1.0


def test_a_drone_that_is_carried_off_on_its_way_home_lands_within_its_fence() -> None:
    """Wind from home: it is told to return, makes no way, and lands before it leaves the fence."""
    away = flight(add(Waypoint("near", 5, 0, 3, 60.0)), limits=_FENCED)
    away.run_to(S.LOITERING)
    away.vehicle.wind = np.array([4.5, 0.0, 0.0])
    away.run(until=lambda: away.mission.state is S.LANDING)
    away.expect(S.LANDING)
    assert S.RETURNING in away.states
    assert "wind" in away.status.reason
    assert away.vehicle.position[0] < 40.0


def test_a_drone_that_makes_no_way_home_lands() -> None:
    """Wind that it just holds, or whatever blocks its way: it does not hover till it is empty."""
    options = MissionConfig(stall_timeout=20.0)
    away = flight(add(Waypoint("far", 35, 0, 3)), limits=_FENCED, options=options)
    away.run(until=lambda: away.vehicle.position[0] > 20.0)
    away.tell(ReturnHome("asked to"))
    began = away.seconds
    while not away.mission.finished and away.seconds < began + 60.0:
        away.vehicle.position[0], away.vehicle.velocity[:2] = 20.0, 0.0
        away.turn()
    away.expect(S.LANDED)
    assert "comes no nearer to home" in away.status.reason


def test_a_drone_outside_its_fence_comes_back_or_ends_its_flight() -> None:
    """A gust across the edge is made good within 3 s; longer outside, the flight ends."""
    for outside, state in ((1.0, S.ENROUTE), (4.0, S.RETURNING)):
        away = flight(add(Waypoint("a", 35, 0, 3), Waypoint("b", 0, 0, 3)), limits=_FENCED)
        away.run(until=lambda away=away: away.vehicle.position[0] > 30.0)
        until = away.seconds + outside
        while away.seconds < until:
            away.vehicle.position[0] = 41.0
            away.turn()
        assert "geofence" in [alert.kind for alert in away.mission.alerts]
        away.run(8.0)
        away.expect(state)
        assert away.vehicle.position[0] < 40.0
        assert away.mission.fence.contains(away.vehicle.position)


@pytest.mark.parametrize(
    ("place", "word"), [((10.0, 0.0, 14.0), "ceiling"), ((30.0, 10.0, 3.0), "range")]
)
def test_too_high_and_too_far_are_outside_too(place: tuple[float, ...], word: str) -> None:
    """Wherever the drone was carried, it does not fly on as if it were nothing."""
    limits = LimitsConfig(max_range=28.0, geofence=GeofenceConfig(ceiling=10.0))
    away = flight(add(Waypoint("a", 20, 0, 3)), limits=limits)
    away.run_to(S.ENROUTE)
    for _ in range(80):
        away.vehicle.position[:] = place
        away.turn()
    away.expect(S.RETURNING)
    assert word in away.status.reason


class GroundedVehicle(KinematicVehicle):
    """A vehicle whose motor fails in the air: it comes down, and stands shaking."""

    failed = False
    disarms = False
    landing_for = 0.0
    _shaken = 0

    def _step(self, duration: float) -> None:
        if not self.failed:
            super()._step(duration)
            return
        self._shaken = (self._shaken + 1) % 40
        self.velocity[:] = 0.5 if self._shaken < 20 else -0.5, 0.0, 0.0
        self.position += self.velocity * duration
        self.position[2] = max(self._ground, self.position[2] - 3.0 * duration)
        self.landing_for += duration * (self.mode is VehicleMode.LANDING)
        if self.disarms and self.landing_for > 2.0:
            self.mode = VehicleMode.GROUNDED


@pytest.mark.parametrize("disarms", [True, False])
def test_a_drone_on_the_ground_with_motors_running_is_told_and_landed(disarms: bool) -> None:  # noqa: FBT001
    """No waypoint is flown to any more, and none is said to be visited."""
    vehicle = GroundedVehicle()
    broken = flight(add(Waypoint("a", 15, 0, 3), Waypoint("b", 30, 0, 3)), vehicle=vehicle)
    broken.run(until=lambda: vehicle.position[0] > 5.0)
    vehicle.failed, vehicle.disarms = True, disarms
    broken.run(40.0)
    broken.expect(S.LANDED if disarms else S.LANDING)
    assert "neither climbed nor moved" in broken.status.reason
    told = [alert.text for alert in broken.mission.alerts if alert.kind == "motors_running"]
    assert len(told) >= (1 if disarms else 2)
    assert not broken.status.visited


@pytest.mark.parametrize("on_complete", ["return", "land", "hold"])
def test_waypoints_that_were_given_up_are_not_said_to_be_visited(
    on_complete: Literal["return", "land", "hold"],
) -> None:
    """The reason for coming home tells how many were, and how many were not."""
    options = MissionConfig(on_complete=on_complete, stall_timeout=3.0)
    vehicle = KinematicVehicle()
    stuck = flight(
        add(Waypoint("a", 3, 0, 1.5), Waypoint("b", 60, 0, 3)), vehicle=vehicle, options=options
    )
    stuck.run(until=lambda: vehicle.position[0] > 8.0)
    while "b" not in stuck.status.given_up:
        vehicle.position[0] = 8.0
        stuck.turn()
    stuck.turn()
    reason = stuck.status.reason
    assert "1 waypoint visited" in reason
    assert "1 given up" in reason
    assert "all waypoints" not in reason


@given(st.floats(-math.pi, math.pi), st.floats(0.0, 5.0), st.floats(0.0, 5.0))
def test_a_drone_that_follows_its_command_is_never_carried_off(
    course: float, commanded: float, flown: float
) -> None:
    """At any part of the commanded speed along the commanded course; against it, it is."""
    along = np.array([math.cos(course), math.sin(course), 0.0])

    def watched(velocity: Vector) -> int:
        watch = MotionWatch(LimitsConfig())
        setpoint = VelocitySetpoint(along * commanded)
        watch.command(Fly(setpoint), setpoint)
        for turn in range(200):
            now = turn * _PERIOD
            odometry = Odometry(np.zeros(3), velocity, 0.0)
            watch.observe(
                VehicleState(now, odometry, Battery(1.0), VehicleMode.GUIDED, armed=True), now
            )
        return watch.carried_off

    assert watched(along * min(flown, commanded)) == 0
    assert (watched(-along * flown) > 0) is (flown >= 0.5)
