"""What people are told of a flight in which something breaks: each thing by its name, and once."""

from __future__ import annotations

from collections.abc import Iterator
from typing import cast

import numpy as np
import pytest
from stepped import Stepped

from aerodaas.clock import NANOSECONDS, Clock
from aerodaas.navigation.commands import AddNavigation, Start
from aerodaas.navigation.loop import SetpointLoop
from aerodaas.navigation.mission import Mission
from aerodaas.navigation.planner import InlinePlanner
from aerodaas.schedulers.waypoint.nearest_neighbor import NearestNeighborScheduler
from aerodaas.status import MissionState
from aerodaas.testing.mavlink import AutopilotOptions
from aerodaas.vehicle import VehicleMode
from aerodaas.waypoints import AeroNavigation, NavigationType, Waypoint


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
