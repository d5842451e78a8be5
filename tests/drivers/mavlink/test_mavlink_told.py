"""What people are told of a flight in which something breaks: each thing by its name, and once."""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from stepped import Stepped

from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.drivers.mavlink.state.frames import LocalFrame
from aerodaas.drivers.mavlink.state.phase import FlightMode, FlightPhase
from aerodaas.drivers.mavlink.state.reporting import VehicleReport
from aerodaas.drivers.mavlink.state.telemetry import Telemetry
from aerodaas.drivers.mavlink.state.touchdown import Touchdown
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.drivers.mavlink.wire.link import LinkCounts
from aerodaas.mission.commands import AddNavigation, Start
from aerodaas.mission.loop import SetpointLoop
from aerodaas.mission.mission import Mission
from aerodaas.mission.planner import InlinePlanner
from aerodaas.schedulers.trajectory.nearest_neighbor import NearestNeighborScheduler
from aerodaas.types.clock import NANOSECONDS, Clock
from aerodaas.types.status import MissionState
from aerodaas.types.vehicle import VehicleMode, VehicleState
from aerodaas.types.waypoints import NavigationType, Waypoint
from tools.mavlink_vehicle import AutopilotOptions


class _SteppedClock:
    """The mission's clock on the world's time."""

    def __init__(self, world: Stepped) -> None:
        self._world = world

    def now(self) -> int:
        """Nanoseconds."""
        return int(self._world.now * NANOSECONDS)


class Flown:
    """A mission to a far place, flown by an emulated autopilot."""

    def __init__(self, world: Stepped) -> None:
        self.world = world
        self._clock = _SteppedClock(world)
        world.vehicle.use_clock(cast("Clock", self._clock))
        takeoff = world.vehicle.read().odometry.position
        planner = InlinePlanner(NearestNeighborScheduler())
        self.mission = Mission(world.robot, planner, takeoff=takeoff)
        self._loop = SetpointLoop(world.vehicle, self.mission)
        far = AeroNavigation(NavigationType.DISTANCE_DRIVEN, [Waypoint("far", 0, 60, 3.0)])
        for command in (AddNavigation(far), Start()):
            assert self.mission.handle(command, self._clock.now()).accepted

    def run(self, seconds: float) -> None:
        """Turn the loop."""
        end = self.world.now + seconds
        while self.world.now < end:
            self.world.advance(0.05)
            self._loop.turn(self._clock.now())

    @property
    def told(self) -> list[str]:
        """Everything that people were told."""
        return [alert.text for alert in self.mission.alerts]


@pytest.fixture(params=["px4", "ardupilot"])
def flown(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[Flown]:
    """One of each family, on its way."""
    with Stepped(monkeypatch, AutopilotOptions(family=request.param)) as world:
        flight = Flown(world)
        flight.run(14.0)
        assert flight.mission.state is MissionState.ENROUTE
        yield flight


@pytest.mark.parametrize("duration", [2.0, 8.0])
def test_of_a_link_that_is_cut_only_the_link_is_named(flown: Flown, duration: float) -> None:
    """Neither the position nor the GPS, of which nothing can be heard, and each thing once."""
    before = len(flown.told)
    flown.world.autopilot.cut()
    flown.run(duration)
    flown.world.autopilot.cut(off=False)
    flown.run(0.3)
    assert flown.told[before] == "no word from the vehicle"
    assert not any("position" in text or "GPS" in text for text in flown.told[before:])
    assert flown.told[before:].count("no word from the vehicle") == 1


def test_silence_after_a_restart_is_silence(flown: Flown) -> None:
    """An autopilot that started anew and falls silent before it has said where it is: lost."""
    flown.world.autopilot.restart()
    while flown.world.vehicle.telemetry.reboots == 0:
        flown.run(0.05)
    flown.world.autopilot.cut()
    flown.run(3.0)
    state = flown.world.vehicle.read()
    assert state.mode is VehicleMode.LOST
    assert not np.isfinite(state.odometry.position).any()


@pytest.mark.parametrize("duration", [0.1, 0.3, 0.6, 2.0])
def test_a_landing_that_nobody_heard_did_not_fall(flown: Flown, duration: float) -> None:
    """Landed by its own protection while the link was cut: it is neither thought nor told."""
    world = flown.world
    flown.run(1.0)
    world.autopilot.cut()
    flown.run(4.0)
    world.autopilot.protect_itself()
    while world.autopilot.armed:
        flown.run(0.1)
    flown.run(duration)
    world.autopilot.cut(off=False)
    flown.run(6.0)
    assert flown.mission.state is MissionState.LANDED, (flown.mission.status.reason, flown.told)
    assert flown.mission.status.reason.startswith("no word from the vehicle for")
    assert not any("motors" in text for text in flown.told)


def test_a_vehicle_that_is_heard_again_is_given_time_to_say_where_it_is() -> None:
    """Its first words need not be a position; a second of words without one is a loss of it."""
    telemetry, phase = Telemetry(), FlightPhase()
    report = VehicleReport(telemetry, phase, Touchdown())
    report.alignment = SimpleNamespace(frame=LocalFrame(np.zeros(3)), fault="")  # type: ignore[assignment]

    def hear(now: float, *, place: bool) -> VehicleState:
        said: list[object] = [mavlink.MAVLink_heartbeat_message(2, 12, 0x80, 0, 4, 3)]
        boot = int(now * 1e3)
        said += [mavlink.MAVLink_attitude_message(boot, 0, 0, 0, 0, 0, 0)]
        if place:
            said += [mavlink.MAVLink_local_position_ned_message(boot, 1, 2, 3, 0, 0, 0)]
        for message in said:
            telemetry.take(message, now)
        phase.observe(FlightMode.GUIDED, now, armed=True, critical=False)
        return report.state(int(now * NANOSECONDS), now, LinkCounts())

    assert hear(10.0, place=True).mode is VehicleMode.GUIDED
    telemetry.take(mavlink.MAVLink_heartbeat_message(2, 12, 0x80, 0, 4, 3), 12.9)
    first = report.state(13 * NANOSECONDS, 12.9, LinkCounts())
    assert (first.mode, first.faults) == (VehicleMode.LOST, ())
    again = hear(13.0, place=False)
    assert again.mode is VehicleMode.LOST
    assert again.stamp == 10 * NANOSECONDS
    assert hear(13.2, place=True).mode is VehicleMode.GUIDED
    for tenth in range(1, 11):
        hear(16.0 + tenth / 10, place=False)
    blind = hear(17.1, place=False)
    assert blind.mode is VehicleMode.GUIDED
    assert not np.isfinite(blind.odometry.position).any()
