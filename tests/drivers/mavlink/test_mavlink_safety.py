"""When something fails or somebody else flies: nothing is forced, and everybody is told."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest
from mavlink_flights import LOOPBACK, Pair, flight, free_port, robot_of, wait_for

from aerodaas.config.model import EnvironmentConfig
from aerodaas.drivers.mavlink.vehicle import MavlinkVehicle
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.types.clock import ScaledClock
from aerodaas.types.errors import VehicleError
from aerodaas.types.vehicle import PositionSetpoint, VehicleMode, VelocitySetpoint
from tools.mavlink_vehicle import AutopilotOptions, EmulatedAutopilot

pytestmark = [pytest.mark.slow, pytest.mark.wall_clock]

FAMILIES = ("px4", "ardupilot")
AHEAD = VelocitySetpoint(np.array([0.5, 0.0, 0.0]))


@pytest.fixture(params=FAMILIES)
def pair(request: pytest.FixtureRequest):  # type: ignore[no-untyped-def]  # noqa: ANN201
    """One of each family, guided."""
    with flight(AutopilotOptions(family=request.param)) as flown:
        flown.guide()
        yield flown


def _setpoints(pair: Pair) -> int:
    return len(pair.heard("SET_POSITION_TARGET_LOCAL_NED"))


def test_a_pilot_takes_over(pair: Pair) -> None:
    """MANUAL; no setpoint and no mode is sent from then on."""
    pair.autopilot.take_over()
    pair.until(VehicleMode.MANUAL)
    before, modes = _setpoints(pair), pair.commands(mavlink.MAV_CMD_DO_SET_MODE)
    for deed in (lambda: pair.vehicle.send(AHEAD), pair.vehicle.land, pair.vehicle.return_home):
        with pytest.raises(VehicleError, match="a pilot flies it"):
            deed()
    pair.vehicle.close()
    assert _setpoints(pair) == before
    assert pair.commands(mavlink.MAV_CMD_DO_SET_MODE) == modes


def test_its_own_protection_takes_over(pair: Pair) -> None:
    """FAILSAFE, and hands off."""
    pair.autopilot.protect_itself()
    pair.until(VehicleMode.FAILSAFE)
    with pytest.raises(VehicleError, match="own protection"):
        pair.vehicle.send(AHEAD)
    pair.until(VehicleMode.GROUNDED)
    assert "land" not in pair.autopilot.firmware.motions


def test_a_hanging_loop_is_not_covered_up(pair: Pair) -> None:
    """Heartbeats end, and the vehicle is told to hold instead of following its last target."""
    pair.vehicle.use_clock(ScaledClock())
    pair.stream(AHEAD, 0.5)
    beats = len(pair.heard("HEARTBEAT"))
    time.sleep(2.5)
    assert len(pair.heard("HEARTBEAT")) <= beats + 1
    wait_for(lambda: float(np.linalg.norm(pair.autopilot.truth.velocity)) < 0.1)
    assert pair.autopilot.armed
    assert pair.autopilot.firmware.motions[-1] == "hold" or pair.autopilot.firmware.failsafe


def test_readers_elsewhere_do_not_feed_the_watchdog(pair: Pair) -> None:
    """Only the loop's own thread counts as the loop."""
    pair.vehicle.use_clock(ScaledClock())
    beats = len(pair.heard("HEARTBEAT"))
    stop = threading.Event()

    def watch() -> None:
        while not stop.wait(0.05):
            pair.vehicle.read()

    watcher = threading.Thread(target=watch)
    watcher.start()
    time.sleep(2.5)
    stop.set()
    watcher.join()
    assert len(pair.heard("HEARTBEAT")) <= beats + 1


def test_a_lost_link_is_said_and_found_again() -> None:
    """LOST within two seconds; ArduPilot holds, and is flown on when the link is back."""
    with flight(AutopilotOptions(family="ardupilot")) as pair:
        pair.guide()
        pair.autopilot.cut()
        pair.until(VehicleMode.LOST, timeout=3.0)
        time.sleep(1.5)
        pair.autopilot.cut(off=False)
        pair.until(VehicleMode.GUIDED, timeout=3.0)
        assert pair.fly_to(np.array([2.0, 0.0, 2.0])) < 0.3
        assert pair.autopilot.firmware.motions.count("take off") == 1


def test_px4_lands_by_itself_when_the_link_is_cut() -> None:
    """Its setpoints stop, so it leaves offboard; afterwards we see that, and keep our hands off."""
    with flight(AutopilotOptions(family="px4")) as pair:
        pair.guide()
        pair.autopilot.cut()
        wait_for(lambda: pair.autopilot.mode is VehicleMode.LANDING)
        pair.autopilot.cut(off=False)
        pair.until(VehicleMode.FAILSAFE, VehicleMode.GROUNDED, timeout=5.0)
        wait_for(lambda: not pair.autopilot.armed)


@pytest.mark.parametrize("family", FAMILIES)
def test_reconnecting_in_flight_takes_off_no_second_time(family: str) -> None:
    """A new driver finds the vehicle in the air, knows where it took off, and flies on."""
    options = AutopilotOptions(
        family=family,  # type: ignore[arg-type]
        parameters={"COM_OBL_RC_ACT": 5.0} if family == "px4" else {},
        estimator_origin=(7.0, 8.0, 9.0),
    )
    with flight(options) as pair:
        pair.guide()
        there = np.array([3.0, 0.0, 2.0])
        pair.fly_to(there)
        pair.stream(PositionSetpoint(there), 1.5)
        port = int(pair.robot.settings["url"].rpartition(":")[2])
        # As when our process is killed: the wire is cut, nobody says goodbye.
        assert pair.vehicle._link is not None
        pair.vehicle._link.close()
        pair.vehicle._link = None
        robot = robot_of(port)
        again = MavlinkVehicle(robot, EnvironmentConfig(robots=[robot]))
        again.connect()
        state = again.read()
        assert state.armed
        assert state.odometry.position == pytest.approx([3.0, 0.0, 2.0], abs=0.6)
        with pytest.raises(VehicleError, match="already"):
            again.take_off(2.0)
        assert pair.autopilot.firmware.motions.count("take off") == 1
        again.land()
        wait_for(lambda: not pair.autopilot.armed)
        again.close()


@pytest.mark.parametrize("family", FAMILIES)
def test_an_uploaded_fence_is_enforced(family: str) -> None:
    """Uploaded with its action: crossing it, the vehicle protects itself, and we are told."""
    limits = {"geofence": {"polygon": [[-4, -4], [4, -4], [4, 4], [-4, 4]], "ceiling": 20}}
    options = AutopilotOptions(family=family)  # type: ignore[arg-type]
    with flight(options, fence="return", limits=limits) as pair:
        pair.guide()
        with pytest.raises(VehicleError, match="own protection"):
            pair.stream(VelocitySetpoint(np.array([2.0, 0.0, 0.0])), 8.0)
        assert pair.autopilot.mode in {VehicleMode.RETURNING, VehicleMode.LANDING}
        furthest = float(pair.autopilot.truth.position[0])
        assert 3.0 < furthest < 9.0


def test_closing_in_the_air_lands(pair: Pair) -> None:
    """Whoever lets go of a vehicle that he flies leaves it landing."""
    pair.vehicle.close()
    wait_for(lambda: pair.autopilot.mode is VehicleMode.LANDING)


def test_a_target_left_alone_is_near() -> None:
    """Killed on the way to a far place, the vehicle stops within metres, not at the place."""
    with flight(AutopilotOptions(family="ardupilot")) as pair:
        pair.guide()
        for _ in range(60):
            pair.vehicle.send(PositionSetpoint(np.array([100.0, 0.0, 2.0]), None, 2.0))
            time.sleep(0.05)
        assert pair.vehicle._link is not None
        pair.vehicle._link.close()
        pair.vehicle._link = None
        there = float(pair.autopilot.truth.position[0])
        time.sleep(6.0)
        assert float(pair.autopilot.truth.position[0]) < there + 10.0
        assert float(np.linalg.norm(pair.autopilot.truth.velocity)) < 0.2


def test_it_refuses_while_the_link_is_dead() -> None:
    """No take-off into silence."""
    port = free_port()
    robot = robot_of(port)
    with EmulatedAutopilot(AutopilotOptions(peer=(LOOPBACK, port))) as autopilot:
        vehicle = MavlinkVehicle(robot, EnvironmentConfig(robots=[robot]))
        vehicle.connect()
        autopilot.cut()
        wait_for(lambda: vehicle.read().mode is VehicleMode.LOST)
        with pytest.raises(VehicleError, match="no word from the vehicle"):
            vehicle.take_off(2.0)
        vehicle.close()
