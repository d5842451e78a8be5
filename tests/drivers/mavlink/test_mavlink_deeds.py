"""Each deed of the driver, in each mode of the vehicle: what it sends, and what it refuses."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from autopilot import ARM, DENIED, MODE, RISE, SETPOINT, STILL
from bench import Bench

from aerodaas.drivers.mavlink.microservices.events import event_number
from aerodaas.drivers.mavlink.state.phase import FlightMode
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.errors import InvalidWaypointError, VehicleError
from aerodaas.messages.vehicle import PositionSetpoint, VehicleMode, VelocitySetpoint

HOLD, LAND, RETURN = FlightMode.HOLD, FlightMode.LAND, FlightMode.RETURN
OFFBOARD, POSITION, TAKE_OFF = FlightMode.GUIDED, FlightMode.OTHER, FlightMode.TAKE_OFF


@pytest.fixture
def world(monkeypatch: pytest.MonkeyPatch) -> Iterator[Bench]:
    """A vehicle that was met, on the ground in a pilot's mode."""
    made = Bench(monkeypatch)
    made.connect()
    yield made
    made.close()


def test_on_the_ground_nothing_is_flown(world: Bench) -> None:
    """No setpoint, no hold, no return; to land is to do nothing."""
    assert world.vehicle.read().mode is VehicleMode.GROUNDED
    for deed in (
        lambda: world.vehicle.send(STILL),
        world.vehicle.hold,
        world.vehicle.return_home,
    ):
        with pytest.raises(VehicleError, match="on the ground; take off first"):
            deed()
    world.vehicle.land()
    world.turn(1.0)
    assert world.autopilot.orders() == []
    assert world.autopilot.of(SETPOINT) == []


def test_where_it_is_and_what_it_has_are_read(world: Bench) -> None:
    """At its start, heading north; its charge, and where it is on the globe."""
    state = world.vehicle.read()
    assert state.odometry.position == pytest.approx([0.0, 0.0, 0.0])
    assert state.odometry.yaw == pytest.approx(math.pi / 2)
    assert state.battery.fraction == 0.5
    assert not state.armed
    assert state.faults == ()
    world.autopilot.velocity = np.array([1.0, 2.0, -3.0])
    world.turn()
    world.turn()
    assert world.vehicle.read().odometry.velocity == pytest.approx([2.0, 1.0, 3.0])


@pytest.mark.parametrize("height", [0.0, -1.0, math.nan, math.inf])
def test_a_take_off_needs_a_height(world: Bench, height: float) -> None:
    """Nothing is sent otherwise."""
    with pytest.raises(InvalidWaypointError, match="must be a positive number of metres"):
        world.vehicle.take_off(height)
    assert world.autopilot.orders() == []


def test_a_take_off_by_its_orders(world: Bench) -> None:
    """Hold, motors, and 5 m above the sea level at which it stands; asked for twice it is one."""
    world.vehicle.take_off(5.0)
    world.vehicle.take_off(5.0)
    assert world.turn() is VehicleMode.TAKING_OFF
    assert world.autopilot.modes() == [HOLD]
    world.turn(0.5)
    assert world.autopilot.orders() == [MODE, ARM, RISE]
    (climb,) = world.autopilot.of("COMMAND_INT")
    assert climb.z == 493.0
    with pytest.raises(VehicleError, match="cannot hold while it is taking off"):
        world.vehicle.hold()


def test_what_speaks_against_a_take_off(world: Bench) -> None:
    """In the air already, checks that fail (asked for each four seconds), silence."""
    assert world.vehicle.preflight() == []
    world.autopilot.checks_pass = False
    world.turn(0.2)
    assert world.vehicle.preflight() == ["PX4's arming checks fail"]
    with pytest.raises(VehicleError, match="refuses to take off: PX4's arming checks fail"):
        world.vehicle.take_off(2.0)
    for _ in range(20):
        world.turn(0.25)
        world.vehicle.preflight()
    assert world.autopilot.orders() == [mavlink.MAV_CMD_RUN_PREARM_CHECKS] * 2
    world.autopilot.checks_pass = True
    world.autopilot.armed, world.autopilot.mode = True, HOLD
    world.turn(0.2)
    assert world.vehicle.preflight() == ["already holding"]
    world.autopilot.speaks = False
    world.clock.advance(3.0)
    assert world.vehicle.preflight() == ["no word from the vehicle for 3 s"]
    with pytest.raises(VehicleError, match="no word from the vehicle"):
        world.vehicle.take_off(2.0)


def test_what_keeps_it_from_arming_is_told_before_all_else(world: Bench) -> None:
    """Its checks' own complaint comes before a text of late that is about something else."""
    world.autopilot.checks_pass = False
    world.autopilot.say(mavlink.MAVLink_statustext_message(4, b"Logging: low on space", 0, 0))
    names = (
        "commander_arming_check_summary",
        "check_estimator_gps_num_sats_too_low",
        "commander_health_summary",
    )
    for number, name in enumerate(names):
        event = mavlink.mavlink_map[410](0, 0, event_number(name), 0, number, 3, [0] * 40)
        world.autopilot.say(event)
    world.turn(0.2)
    assert world.vehicle.preflight() == ["GPS: too few satellites"]
    world.autopilot.checks_pass = True
    world.turn(0.2)
    world.vehicle.take_off(2.0)
    world.autopilot.checks_pass, world.autopilot.result = False, DENIED
    world.turn(0.6)
    with pytest.raises(VehicleError, match="denied; GPS: too few satellites; Logging: low on"):
        world.vehicle.take_off(2.0)


def test_a_refusal_is_told_at_the_next_take_off_alone(world: Bench) -> None:
    """With its own words; the one after it is begun."""
    world.autopilot.result = DENIED
    world.autopilot.say(mavlink.MAVLink_statustext_message(3, b"Preflight Fail: compass", 0, 0))
    world.turn(0.2)
    world.vehicle.take_off(2.0)
    world.turn(0.5)
    assert world.autopilot.orders() == [MODE]
    with pytest.raises(VehicleError, match="mode hold: denied; Preflight Fail: compass"):
        world.vehicle.take_off(2.0)
    world.autopilot.result = mavlink.MAV_RESULT_ACCEPTED
    world.vehicle.take_off(2.0)
    world.turn(0.2)
    assert world.autopilot.orders() == [MODE, MODE, ARM, RISE]


def test_a_velocity_goes_out_as_it_is_and_the_mode_follows(world: Bench) -> None:
    """PX4 hears 1.2 s of setpoints before it is asked to follow them."""
    world.fly()
    asked = VelocitySetpoint(np.array([1.0, 0.5, 0.25]), 0.1)
    sent = world.vehicle.send(asked)
    for _ in range(29):
        world.turn()
        sent = world.vehicle.send(asked)
    world.turn()
    assert isinstance(sent, VelocitySetpoint)
    said = world.autopilot.of(SETPOINT)
    assert len(said) == 30
    assert (said[-1].vx, said[-1].vy, said[-1].vz) == (0.5, 1.0, -0.25)
    assert said[-1].yaw_rate == pytest.approx(-0.1)
    assert (said[-1].target_system, said[-1].target_component) == (1, 1)
    (at,) = [at for at, one in world.autopilot.received if getattr(one, "command", 0) == MODE]
    assert world.autopilot.modes() == [OFFBOARD]
    assert 1.2 <= at - world.autopilot.received[0][0] <= 1.3


def test_a_place_goes_out_in_its_own_frame(world: Bench) -> None:
    """The target leaves for a place 8 m east, from 10 m north and 20 m east of its zero."""
    world.guide()
    for _ in range(20):
        world.vehicle.send(PositionSetpoint(np.array([8.0, 0.0, 5.0])))
        world.turn()
    last = world.autopilot.of(SETPOINT)[-1]
    assert last.x == pytest.approx(10.0)
    assert 20.1 < last.y < 28.0
    assert last.z == pytest.approx(-8.0)
    assert last.vy > 0.0


def test_numbers_that_are_none_are_not_sent(world: Bench) -> None:
    """Refused before anything else."""
    world.guide()
    with pytest.raises(InvalidWaypointError):
        world.vehicle.send(VelocitySetpoint(np.array([math.nan, 0.0, 0.0])))
    assert world.autopilot.of(SETPOINT) == []


def test_without_a_position_it_is_told_to_stand(world: Bench) -> None:
    """A second after its last one; it is said, too."""
    world.guide()
    world.autopilot.position = np.full(3, math.nan)
    world.turn(1.2)
    sent = world.vehicle.send(PositionSetpoint(np.array([8.0, 0.0, 5.0])))
    assert isinstance(sent, VelocitySetpoint)
    assert sent.velocity.tolist() == [0.0, 0.0, 0.0]
    assert "the autopilot does not know its position" in world.vehicle.preflight()
    assert not np.isfinite(world.vehicle.read().odometry.position).any()


DEEDS: list[tuple[str, FlightMode]] = [("hold", HOLD), ("return_home", RETURN), ("land", LAND)]


@pytest.mark.parametrize(("deed", "mode"), DEEDS)
def test_its_own_modes_are_asked_for_once_until_they_show(
    world: Bench, deed: str, mode: FlightMode
) -> None:
    """While an order is under way, or the mode shows, it is not asked for again."""
    world.guide()
    world.autopilot.result = None
    act: Callable[[], None] = getattr(world.vehicle, deed)
    act()
    world.turn(0.2)
    act()
    assert world.autopilot.modes() == [mode]
    world.turn(1.0)
    assert world.autopilot.modes() == [mode] * 2, "the first was not answered"
    world.autopilot.mode = mode
    world.turn(0.3)
    expected = {HOLD: "holding", RETURN: "returning", LAND: "landing"}[mode]
    assert world.turn(3.0).value == expected
    act()
    assert world.autopilot.modes() == [mode] * 2


def test_who_lands_is_not_steered(world: Bench) -> None:
    """Nor held, nor brought home; landing again is nothing new."""
    world.guide()
    world.vehicle.land()
    world.autopilot.mode = LAND
    assert world.turn(0.3) is VehicleMode.LANDING
    for act in (lambda: world.vehicle.send(STILL), world.vehicle.hold, world.vehicle.return_home):
        with pytest.raises(VehicleError, match="while it is landing"):
            act()
    world.vehicle.land()
    assert world.autopilot.modes() == [LAND]


@pytest.mark.parametrize(
    ("state", "mode", "words"),
    [
        (mavlink.MAV_STATE_ACTIVE, VehicleMode.MANUAL, "a pilot flies it"),
        (mavlink.MAV_STATE_CRITICAL, VehicleMode.FAILSAFE, "its own protection flies it"),
    ],
)
def test_who_flies_it_is_left_alone(
    world: Bench, caplog: pytest.LogCaptureFixture, state: int, mode: VehicleMode, words: str
) -> None:
    """Nothing that steers is sent any more, and it is told once who it is by the mode's name."""
    world.guide()
    world.autopilot.mode, world.autopilot.status = POSITION, state
    assert world.turn(0.2) is mode
    for act in (
        lambda: world.vehicle.send(STILL),
        world.vehicle.hold,
        world.vehicle.return_home,
        world.vehicle.land,
    ):
        with pytest.raises(VehicleError, match=words):
            act()
    world.turn(30.0 / 20)
    world.clock.advance(25.0)
    world.vehicle.close()
    assert world.autopilot.orders() == []
    assert world.autopilot.of(SETPOINT) == []
    assert [text for text in caplog.messages if "not by us" in text] == [
        "drone: the mode is 'position' now, not by us; "
    ]


def test_a_take_off_is_called_off_on_the_ground_by_land_and_by_return(world: Bench) -> None:
    """Hold, and motors off: there is no way home from where it stands."""
    for act in (world.vehicle.land, world.vehicle.return_home):
        world.vehicle.take_off(5.0)
        world.turn(0.3)
        world.autopilot.received.clear()
        act()
        assert world.vehicle.read().mode is VehicleMode.LANDING
        assert world.autopilot.modes() == [HOLD]
        assert [one.param1 for one in world.autopilot.of("COMMAND_LONG") if one.command == ARM] == [
            0.0
        ]
        assert world.turn(1.5) is VehicleMode.LANDING
        assert "a take-off that was called off is not over yet" in world.vehicle.preflight()
        assert world.turn(0.5) is VehicleMode.GROUNDED


def test_a_climb_is_brought_home_from_the_air(world: Bench) -> None:
    """By its own mode; the take-off is forgotten."""
    world.vehicle.take_off(20.0)
    world.turn(0.3)
    world.autopilot.armed, world.autopilot.mode = True, TAKE_OFF
    world.autopilot.landed = mavlink.MAV_LANDED_STATE_IN_AIR
    world.turn(0.3)
    world.autopilot.received.clear()
    world.vehicle.return_home()
    assert world.autopilot.modes() == [RETURN]
    world.autopilot.mode = RETURN
    assert world.turn(0.3) is VehicleMode.RETURNING


def test_motors_that_turn_on_the_ground_are_stopped_by_land(world: Bench) -> None:
    """A landing mode would stop none that have never lifted it."""
    world.autopilot.armed, world.autopilot.mode = True, HOLD
    world.turn(0.3)
    world.vehicle.land()
    assert world.autopilot.orders() == [MODE, ARM]
    assert world.autopilot.modes() == [HOLD]
    world.vehicle.land()
    assert world.autopilot.orders() == [MODE, ARM]
    world.autopilot.armed = False
    assert world.turn(3.0) is VehicleMode.GROUNDED


def test_a_loop_that_hangs_is_answered_by_hold_and_then_by_return(
    world: Bench, caplog: pytest.LogCaptureFixture
) -> None:
    """After a second, and after twenty; each said once. A loop that comes back begins anew."""
    world.guide()
    world.clock.advance(0.9)
    assert world.autopilot.modes() == []
    world.clock.advance(0.2)
    assert world.autopilot.modes() == [HOLD]
    world.autopilot.mode = HOLD
    world.clock.advance(18.7)
    assert world.autopilot.modes() == [HOLD]
    world.clock.advance(0.5)
    assert world.autopilot.modes() == [HOLD, RETURN]
    world.autopilot.mode = RETURN
    world.clock.advance(20.0)
    assert world.autopilot.modes() == [HOLD, RETURN]
    assert [text for text in caplog.messages if "silent" in text] == [
        "drone: the control loop is silent: hold",
        "drone: the control loop is silent: return",
    ]


def test_a_vehicle_that_holds_needs_no_loop_for_a_while(world: Bench) -> None:
    """It is brought home all the same if nobody comes back."""
    world.guide()
    world.vehicle.hold()
    world.autopilot.mode = HOLD
    world.turn(0.3)
    world.autopilot.received.clear()
    world.clock.advance(19.5)
    assert world.autopilot.modes() == []
    world.clock.advance(1.0)
    assert world.autopilot.modes() == [RETURN]


@pytest.mark.parametrize("mode", [RETURN, LAND])
def test_whoever_comes_down_already_is_let_be(world: Bench, mode: FlightMode) -> None:
    """No loop is needed, and closing changes nothing."""
    world.guide()
    (world.vehicle.return_home if mode == RETURN else world.vehicle.land)()
    world.autopilot.mode = mode
    world.turn(0.3)
    world.autopilot.received.clear()
    world.clock.advance(25.0)
    world.vehicle.close()
    assert world.autopilot.orders() == []


def test_letting_go_in_the_air_lands(world: Bench) -> None:
    """It waits until the landing shows, four seconds at most."""
    world.guide()
    began = world.now
    world.vehicle.close()
    assert set(world.autopilot.modes()) == {LAND}
    assert world.now - began == pytest.approx(4.0, abs=0.06)
    assert not world.vehicle.connected
    with pytest.raises(VehicleError, match="not connected"):
        world.vehicle.read()


def test_letting_go_on_the_ground_is_done_at_once(world: Bench) -> None:
    """Nothing is ordered, and nothing waited for; twice is once."""
    began = world.now
    world.vehicle.close()
    world.vehicle.close()
    assert world.now == began
    assert world.autopilot.orders() == []


def test_what_px4_leaves_of_a_climb_is_flown(world: Bench) -> None:
    """It holds 0.8 m below 5 m: setpoints lead up from there."""
    world.vehicle.take_off(5.0)
    world.turn(0.3)
    world.autopilot.armed, world.autopilot.mode = True, TAKE_OFF
    world.autopilot.landed = mavlink.MAV_LANDED_STATE_IN_AIR
    world.turn(0.5)
    world.rise(4.2)
    assert world.autopilot.of(SETPOINT) == []
    world.autopilot.mode = HOLD
    assert world.turn(1.0) is VehicleMode.TAKING_OFF
    said = world.autopilot.of(SETPOINT)
    assert len(said) >= 19
    assert said[-1].x == pytest.approx(10.0)
    assert said[-1].y == pytest.approx(20.0)
    assert said[-1].z == pytest.approx(-7.2), "until it follows"
    world.turn(0.4)
    assert world.autopilot.modes()[-1] == OFFBOARD
    world.autopilot.mode = OFFBOARD
    world.turn(1.0)
    assert world.autopilot.of(SETPOINT)[-1].z < -7.4
    world.rise(0.8)
    assert world.turn(0.3) is VehicleMode.GUIDED


def test_a_mode_that_is_refused_is_told(world: Bench, caplog: pytest.LogCaptureFixture) -> None:
    """With its own words of the last moments."""
    world.guide()
    world.autopilot.result = mavlink.MAV_RESULT_FAILED
    world.autopilot.say(mavlink.MAVLink_statustext_message(3, b"No home position", 0, 0))
    world.vehicle.return_home()
    world.turn(0.3)
    assert caplog.messages[-1] == "drone: mode return: failed No home position"


def test_who_starts_anew_on_the_ground_stands_where_it_stood(world: Bench) -> None:
    """Told until motors start; its zero lies elsewhere now."""
    world.autopilot.say(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, mavlink.MAV_STATE_BOOT, 3))
    world.autopilot.position = np.array([0.5, 0.0, 0.0])
    world.turn(0.5)
    state = world.vehicle.read()
    assert "autopilot: it started anew" in state.faults
    assert state.odometry.position == pytest.approx([0.0, 0.0, 0.0])
    world.autopilot.armed = True
    world.turn(0.3)
    assert "autopilot: it started anew" not in world.vehicle.read().faults
