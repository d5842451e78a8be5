"""Whole missions on real PX4 and ArduCopter in simulation.

`AERODAAS_SITL_PX4` and `AERODAAS_SITL_ARDUPILOT` name them (docs/mavlink.md says how); what is
not named is skipped. These tests fly by the wall clock and take minutes.
"""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from aerodaas.config.model import EnvironmentConfig, GeofenceConfig
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.drivers.mavlink.microservices.fence import upload_fence
from aerodaas.drivers.mavlink.vehicle import MavlinkVehicle
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.errors import VehicleError
from aerodaas.messages.mission import MissionState as S
from aerodaas.messages.vehicle import VehicleMode, VehicleState
from aerodaas.messages.waypoints import HeightReference, NavigationType, VelocityCommand, Waypoint
from aerodaas.mission.commands import AddNavigation, End, OpenStream, Pause, Resume, StreamItem
from sitl.autopilot import Autopilot
from sitl.flights import FAR, FARM, SitlFlight, robot_at, survey

pytestmark = [pytest.mark.sitl, pytest.mark.slow, pytest.mark.timeout(420), pytest.mark.wall_clock]

HERE = Path(__file__).parent


def finish(flight: SitlFlight) -> None:
    """Fly to the mission's end: back home, on the ground."""
    flight.run(180.0)
    assert flight.mission.state is S.LANDED, flight.story


def test_farm_survey(autopilot: Autopilot) -> None:
    """Four corners, a hover at each, and back to where it took off."""
    with SitlFlight(autopilot.url, FARM) as flight:
        finish(flight)
        assert set(flight.status.visited) == {"wp1", "wp2", "wp3", "wp4"}
        assert {S.TAKING_OFF, S.ENROUTE, S.LOITERING} <= set(flight.states)
        home = flight.vehicle.read().odometry.position
        assert float(np.linalg.norm(home[:2])) < 1.5


def test_sensor_driven_flight(autopilot: Autopilot) -> None:
    """Velocities from what odometry says, two seconds each way: it follows, then comes home."""
    flight = SitlFlight(autopilot.url, OpenStream("eye/commands"))
    fastest = [0.0]

    def steer(state: VehicleState) -> None:
        if flight.mission.state in {S.HOLDING, S.FOLLOWING}:
            ahead = 1.5 if state.odometry.position[1] < 5.0 else 0.0
            command = VelocityCommand(forward=ahead, yaw_rate=0.0, valid_for=0.5)
            navigation = AeroNavigation(NavigationType.ANALYTICS_DRIVEN, [command])
            flight.tell(StreamItem("eye/commands", navigation))
            speed = float(np.linalg.norm(state.odometry.velocity[:2]))
            fastest[0] = max(fastest[0], speed)

    try:
        flight.run_to(S.HOLDING)
        flight.run(10.0, each=steer)
        assert S.FOLLOWING in flight.states, flight.story
        assert 1.0 < fastest[0] < 2.5
        flight.tell(End("enough"))
        finish(flight)
    finally:
        flight.close()


def test_a_height_above_the_sea(autopilot: Autopilot) -> None:
    """By the autopilot's own altitude, and the simulator's truth of how high it went."""
    with SitlFlight(autopilot.url) as flight:
        sea = flight.vehicle.sea_level
        assert sea is not None
        place = Waypoint("high", 5.0, 0.0, 8.0 + sea, hover_duration=2.0, above=HeightReference.SEA)
        answer = flight.tell(AddNavigation(AeroNavigation(data=[place])))
        assert answer.accepted, answer.text
        finish(flight)
        assert list(flight.status.visited) == ["high"]
        # The estimate of PX4 that has just started lags the truth by a metre in a climb.
        assert 7.0 < flight.relay.witness.highest < 9.5
        flight.tell_outcome(f"8 m up, said as {place.z:.1f} m above the sea")


def test_pause_and_resume(autopilot: Autopilot) -> None:
    """Paused it stays within a metre; resumed it flies on."""
    with SitlFlight(autopilot.url, survey((0, 15))) as flight:
        flight.run_to(S.ENROUTE)
        flight.run(4.0)
        flight.tell(Pause())
        flight.run(4.0)
        assert flight.mission.state is S.PAUSED
        here = flight.vehicle.read().odometry.position
        flight.run(5.0)
        moved = float(np.linalg.norm(flight.vehicle.read().odometry.position - here))
        assert moved < 1.0
        flight.tell(Resume())
        finish(flight)
        assert flight.status.visited == ("wp1",)


def test_abort(autopilot: Autopilot) -> None:
    """Landed on the spot, as told."""
    with SitlFlight(autopilot.url, FAR) as flight:
        flight.run_to(S.ENROUTE)
        flight.run(6.0)
        flight.tell(End("the user said so"))
        finish(flight)
        assert flight.status.reason == "the user said so"
        assert flight.vehicle.read().odometry.position[1] > 1.0


def test_fence_breach(autopilot: Autopilot) -> None:
    """Its own fence, smaller than ours: it goes home by itself, and we keep our hands off."""
    with SitlFlight(autopilot.url, FAR) as flight:
        connection = flight.vehicle.connection
        small = GeofenceConfig(polygon=[(-8, -8), (8, -8), (8, 8), (-8, 8)], ceiling=50)
        origin = connection.alignment.origin
        upload_fence(connection.link, connection.autopilot, small, origin, "return")
        flight.run_to(S.ABORTED)
        assert VehicleMode.FAILSAFE in flight.modes or VehicleMode.MANUAL in flight.modes
        flight.wait_for_ground(240.0)
        assert float(np.linalg.norm(flight.vehicle.read().odometry.position[:2])) < 12.0


@pytest.mark.parametrize("duration", [3.0, 8.0, 30.0])
def test_link_cut(autopilot: Autopilot, duration: float) -> None:
    """It holds, lands or returns; the mission says that nothing was heard, and how it ended."""
    with SitlFlight(autopilot.url, FAR) as flight:
        flight.run_to(S.ENROUTE)
        flight.run(6.0)
        flight.relay.cut()
        flight.run(duration)
        assert VehicleMode.LOST in flight.modes, flight.story
        flight.relay.cut(off=False)
        flight.run(180.0, lambda: flight.mission.finished)
        ended = {S.LANDED, S.ABORTED}
        assert flight.mission.state in ended, flight.story
        flight.wait_for_ground(240.0)
        flight.tell_outcome(f"link cut for {duration:g} s")


def kill_in_flight(url: str, *settings: str) -> None:
    """Kill a program that flies, four seconds on its way, and wait eight seconds more."""
    command = [sys.executable, "-m", "sitl.victim", url, *settings]
    victim = subprocess.Popen(command, cwd=HERE.parent, stdout=subprocess.PIPE, text=True)
    assert victim.stdout is not None
    assert victim.stdout.readline().strip() == "enroute"
    time.sleep(4.0)
    victim.send_signal(signal.SIGKILL)
    victim.wait()
    time.sleep(8.0)


def test_killed_as_its_ground_station(autopilot: Autopilot) -> None:
    """With a fallback, nobody needs to come: it goes home, or lands, by itself."""
    kill_in_flight(autopilot.url, "role=ground_station", "fallback=set")
    robot = robot_at(autopilot.url)
    vehicle = MavlinkVehicle(robot, EnvironmentConfig(robots=[robot]))
    vehicle.connect(30.0)
    try:
        seen: list[VehicleMode] = []
        end = time.monotonic() + 180.0
        while (state := vehicle.read()).armed:
            if not seen or seen[-1] is not state.mode:
                seen.append(state.mode)
            assert time.monotonic() < end, seen
            time.sleep(0.1)
        place = state.odometry.position.round(1)
        print(f"\nkilled as ground station: {[mode.value for mode in seen]}, down at {place}")  # noqa: T201
        home = {VehicleMode.RETURNING, VehicleMode.LANDING, VehicleMode.FAILSAFE}
        assert set(seen) <= {VehicleMode.HOLDING, *home}
        assert seen[-1] in home
        assert float(np.linalg.norm(place[:2])) < 2.0
    finally:
        vehicle.close()


def test_a_fallback_is_put_back(autopilot: Autopilot, tmp_path: Path) -> None:
    """A whole flight with a fallback: then its parameters are its own."""
    if autopilot.family == "px4":
        pytest.skip("the names are ArduPilot's")
    names = ("FS_GCS_ENABLE", "MAV_GCS_SYSID", "FS_OPTIONS")
    robot = robot_at(autopilot.url, {"fallback": "ignore"})
    before: dict[str, float | None] = {}
    for flown in (False, True):
        if flown:
            settings = {"fallback": "set"}
            with SitlFlight(autopilot.url, survey((0, 5)), settings=settings) as flight:
                assert flight.vehicle.parameters.get("FS_GCS_ENABLE") == 1.0
                finish(flight)
        vehicle = MavlinkVehicle(robot, EnvironmentConfig(robots=[robot]))
        vehicle.connect(60.0)
        try:
            held = {name: vehicle.parameters.get(name) for name in names}
        finally:
            vehicle.close()
        before = before or held
        assert held == before
    assert not list(tmp_path.rglob("*.json"))


def test_process_killed(autopilot: Autopilot) -> None:
    """Killed in flight, nobody takes off again; the vehicle lands, returns, or holds for us."""
    kill_in_flight(autopilot.url)
    robot = robot_at(autopilot.url)
    vehicle = MavlinkVehicle(robot, EnvironmentConfig(robots=[robot]))
    vehicle.connect(30.0)
    try:
        state = vehicle.read()
        print(f"\n8 s after the kill: {state.mode.value}, {state.odometry.velocity.round(2)} m/s")  # noqa: T201
        if state.mode not in {VehicleMode.RETURNING, VehicleMode.FAILSAFE}:
            assert float(np.linalg.norm(state.odometry.velocity[:2])) < 1.0
        if state.armed:
            with pytest.raises(VehicleError, match="already"):
                vehicle.take_off(3.0)
            if state.mode in {VehicleMode.GUIDED, VehicleMode.HOLDING}:
                vehicle.land()
        end = time.monotonic() + 120.0
        while vehicle.read().armed:
            assert time.monotonic() < end
            time.sleep(0.1)
    finally:
        vehicle.close()


def test_a_ground_station_takes_over(autopilot: Autopilot) -> None:
    """Hold asked for by somebody else: the mission ends, no setpoint is sent any more."""
    with SitlFlight(autopilot.url, FAR) as flight:
        flight.run_to(S.ENROUTE)
        flight.run(5.0)
        px4 = flight.vehicle.connection.autopilot.name == "PX4"
        # PX4: hold. ArduCopter: brake, for loiter needs a remote control.
        mode = (1.0, 4.0, 3.0) if px4 else (1.0, 17.0)
        flight.command_as_station(mavlink.MAV_CMD_DO_SET_MODE, *mode)
        flight.run_to(S.ABORTED, seconds=10.0)
        assert flight.status.reason == "a pilot has taken over"
        sent = flight.vehicle.connection.link.counts.sent
        flight.run(3.0)
        assert flight.vehicle.connection.link.counts.sent - sent < 10
        land = (1.0, 4.0, 6.0) if px4 else (1.0, 9.0)
        flight.command_as_station(mavlink.MAV_CMD_DO_SET_MODE, *land)
        flight.wait_for_ground()
