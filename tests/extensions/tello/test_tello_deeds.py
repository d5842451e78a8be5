"""Each deed of the Tello's driver in each mode, on a link that is written down."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from aerodaas.clock import NANOSECONDS, SimulatedClock
from aerodaas.config.model import EnvironmentConfig, RobotConfig
from aerodaas.errors import InvalidWaypointError, VehicleError
from aerodaas.extensions.tello import vehicle as module
from aerodaas.extensions.tello.commands import STILL, Command, Sticks
from aerodaas.extensions.tello.link import LinkCounts
from aerodaas.extensions.tello.state import TelloState
from aerodaas.extensions.tello.vehicle import TelloVehicle
from aerodaas.messages.vehicle import (
    FlightEnd,
    PositionSetpoint,
    Setpoint,
    VehicleMode,
    VelocitySetpoint,
)

STANDING = TelloState(0.0, 0.0, 0.0, (0.0, 0.0, 0.0), 0.0, 0.1, 100.0, 80, 0.0, 50.0)
SPEEDS = {"full_speed": 2.0, "full_climb": 1.0, "full_turn": 100.0}
LIMITS = {"max_speed": 1.5, "cruise_speed": 0.5, "max_climb": 0.5, "max_yaw_rate": 50.0}


class World:
    """A Tello that looks east from 1 m east, 2 m north, whose packets and clock the test moves."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = 100.0
        self.state = STANDING
        self.speaks = True
        self.counts = LinkCounts(malformed=1, strangers=2, stray_replies=3, timeouts=4)
        self.flown = STILL
        self.steered: list[Sticks] = []
        self.asked: list[tuple[str, bool]] = []
        self.answer: Any = None
        """Called with the reply to the newest request."""
        self.released = 0
        self.closed: list[Command | None] = []
        self.greeted: list[tuple[object, ...]] = []
        clock = SimpleNamespace(monotonic=lambda: self.now, sleep=lambda _: self.advance(0.1))
        monkeypatch.setattr(module, "time", clock)
        monkeypatch.setattr(module, "greet", lambda *of: self.greeted.append(of))
        monkeypatch.setattr(module, "TelloLink", self._made)
        robot = RobotConfig.model_validate(
            {
                "id": "t",
                "driver": "tello",
                "start": (1, 2, 0),
                "start_yaw": 0,
                "limits": LIMITS,
                "settings": SPEEDS,
            }
        )
        self.vehicle = TelloVehicle(robot, EnvironmentConfig(robots=[robot]))

    def _made(self, name: str, settings: object, take: Any, turned: Any) -> World:  # noqa: ANN401
        assert (name, settings.full_speed) == ("t", 2.0)  # type: ignore[attr-defined]
        self._take, self._turned = take, turned
        return self

    def open(self) -> None:
        """As the link."""

    def close(self, last: Command | None) -> None:
        """As the link."""
        self.closed.append(last)

    def steer(self, sticks: Sticks) -> None:
        """As the link."""
        self.flown = sticks
        self.steered.append(sticks)

    def release(self) -> None:
        """As the link."""
        self.flown = STILL
        self.released += 1

    def request(self, command: Command, done: Any, *, urgent: bool = False) -> None:  # noqa: ANN401
        """As the link."""
        self.asked.append((command.text, urgent))
        self.answer = done

    def advance(self, seconds: float) -> None:
        """Let time pass, a packet and two turns each tenth of a second."""
        for _ in range(round(seconds * 10)):
            self.now = round(self.now + 0.1, 6)
            if self.speaks:
                self._take(self.state, self.now)
            self._turned(self.now)

    def say(self, **changed: Any) -> None:  # noqa: ANN401
        """Have its packets say something else from now on."""
        self.state = replace(self.state, **changed)

    def fly(self, height: float = 1.0) -> None:
        """Take off to a metre, which is its own part of it, and hover."""
        self.vehicle.take_off(1.0)
        for tenth in range(1, 31):
            self.say(height=height * min(1.0, tenth / 20), motor_time=float(tenth // 10))
            self.say(ground_distance=self.state.height + 0.1)
            self.advance(0.1)
        self.answer("ok")
        self.spin(0.2)
        self.steered.clear()
        self.asked.clear()

    def spin(self, seconds: float) -> None:
        """Let time pass with turning motors."""
        for _ in range(round(seconds * 10)):
            self.say(motor_time=float(int(self.now)))
            self.advance(0.1)

    def mode(self) -> VehicleMode:
        """What it is read to be doing."""
        return self.vehicle.read().mode


@pytest.fixture
def world(monkeypatch: pytest.MonkeyPatch) -> World:
    """One that was met."""
    made = World(monkeypatch)
    made.vehicle.connect(3.0)
    return made


def test_before_it_is_met_nothing_is_done(monkeypatch: pytest.MonkeyPatch) -> None:
    """Only its greeting comes before its first packet, for which it is waited."""
    world = World(monkeypatch)
    assert world.vehicle.preflight() == ["not connected"]
    for act in (world.vehicle.read, world.vehicle.land, world.vehicle.hold):
        with pytest.raises(VehicleError, match="t is not connected; call connect first"):
            act()
    world.speaks = False
    with pytest.raises(VehicleError, match="none of which is a state packet"):
        world.vehicle.connect(3.0)
    assert world.now == pytest.approx(103.0)
    assert world.closed == [None]
    assert world.greeted[0][0] is world
    assert world.greeted[0][-1] == 103.0


def _standing(seconds: float) -> SimulatedClock:
    """A mission clock that shows `seconds`."""
    clock = SimulatedClock()
    clock.advance_to(round(seconds * NANOSECONDS))
    return clock


def test_what_is_read(world: World) -> None:
    """Its start, its charge, its clock less the age of its packet, and what its link counted."""
    world.vehicle.use_clock(_standing(50.0))
    world.advance(1.0)
    state = world.vehicle.read()
    assert state.odometry.position == pytest.approx([1.0, 2.0, 0.0])
    assert state.odometry.yaw == 0.0
    assert state.battery.fraction == 0.8
    assert (state.mode, state.armed, state.faults, state.ended) == (
        VehicleMode.GROUNDED,
        False,
        (),
        None,
    )
    assert state.stamp == 50 * NANOSECONDS
    assert state.extra == {
        "temperature": 50.0,
        "ground_distance": 0.1,
        "barometer": 100.0,
        "motor_time": 0.0,
        "malformed_packets": 1,
        "foreign_packets": 2,
        "stray_replies": 3,
        "unanswered_commands": 4,
    }


def test_silence_is_a_loss_after_a_second(world: World) -> None:
    """It is told with its age; in flight its place is carried on no further."""
    world.fly()
    world.vehicle.use_clock(_standing(50.0))
    world.speaks = False
    world.now += 1.0
    assert world.mode() is VehicleMode.HOLDING
    world.now += 0.5
    state = world.vehicle.read()
    assert (state.mode, state.armed) == (VehicleMode.LOST, True)
    assert state.faults == ("no state packet for 2 s",)
    assert state.stamp == pytest.approx(49.5 * NANOSECONDS, abs=1e6)
    assert "no word from the Tello" in world.vehicle.preflight()


def test_without_a_packet_for_half_a_second_it_hovers(world: World) -> None:
    """Whatever is asked for: where a target lies is not known any more."""
    world.fly()
    world.speaks = False
    place = PositionSetpoint(np.array([9.0, 9.0, 1.0]))
    world.now += 0.5
    assert world.vehicle.send(place) == PositionSetpoint(place.position, None, 0.5)
    assert world.steered[-1] != STILL
    world.now += 0.1
    sent = world.vehicle.send(place)
    assert isinstance(sent, VelocitySetpoint)
    assert sent.velocity.tolist() == [0.0, 0.0, 0.0]
    assert world.steered[-1] == STILL


@pytest.mark.parametrize(
    ("velocity", "rate", "flown", "sticks"),
    [
        ((1.0, 0.0, 0.0), 0.0, (1.0, 0.0, 0.0), Sticks(ahead=50)),
        ((0.0, 1.0, 0.0), 0.0, (0.0, 1.0, 0.0), Sticks(right=-50)),
        ((0.0, 0.0, 0.25), 0.0, (0.0, 0.0, 0.25), Sticks(up=25)),
        ((0.0, 0.0, -9.0), 0.0, (0.0, 0.0, -0.5), Sticks(up=-50)),
        ((0.0, 0.0, 9.0), 0.0, (0.0, 0.0, 0.5), Sticks(up=50)),
        ((-3.0, 4.0, 0.0), 0.0, (-0.9, 1.2, 0.0), Sticks(right=-60, ahead=-45)),
        ((0.0, 0.0, 0.0), 9.0, (0.0, 0.0, 0.0), Sticks(clockwise=-50)),
        ((0.0, 0.0, 0.0), -9.0, (0.0, 0.0, 0.0), Sticks(clockwise=50)),
    ],
)
def test_a_velocity_by_its_sticks(
    world: World,
    velocity: tuple[float, ...],
    rate: float,
    flown: tuple[float, ...],
    sticks: Sticks,
) -> None:
    """It looks east: east is ahead, north is left; cut to 1.5 m/s, 0.5 m/s up, 50 degrees/s."""
    world.fly()
    sent = world.vehicle.send(VelocitySetpoint(np.array(velocity), rate))
    assert isinstance(sent, VelocitySetpoint)
    assert sent.velocity == pytest.approx(flown)
    assert sent.yaw_rate == pytest.approx(math.copysign(math.radians(50), rate) if rate else 0.0)
    assert world.steered[-1] == sticks
    assert world.mode() is VehicleMode.GUIDED


@pytest.mark.parametrize(
    "nonsense",
    [
        VelocitySetpoint(np.array([math.nan, 0.0, 0.0])),
        PositionSetpoint(np.array([0.0, math.inf, 1.0])),
        PositionSetpoint(np.zeros(3), yaw=math.nan),
        PositionSetpoint(np.zeros(3), speed=-1.0),
    ],
)
def test_nonsense_is_not_steered(world: World, nonsense: Setpoint) -> None:
    """Figures that are none never reach the wire."""
    world.fly()
    with pytest.raises(InvalidWaypointError):
        world.vehicle.send(nonsense)
    assert world.steered == []


def test_where_it_looks_turns_its_sticks(world: World) -> None:
    """90 degrees to the left it looks north: there north is ahead, and east is right."""
    world.say(yaw=-math.pi / 2)
    world.fly()
    assert world.vehicle.read().odometry.yaw == pytest.approx(math.pi / 2, abs=0.02)
    world.vehicle.send(VelocitySetpoint(np.array([0.0, 1.0, 0.0])))
    assert world.steered[-1].ahead == 50
    world.vehicle.send(VelocitySetpoint(np.array([1.0, 0.0, 0.0])))
    assert world.steered[-1].right == 50


def test_a_place_by_its_sticks(world: World) -> None:
    """Far away at the speed asked for, at most what it may; at rest where it is, facing there."""
    world.fly()
    here = world.vehicle.read().odometry.position
    for speed, ahead in ((None, 25), (1.0, 50), (9.0, 75)):
        sent = world.vehicle.send(PositionSetpoint(here + np.array([50.0, 0.0, 0.0]), None, speed))
        assert isinstance(sent, PositionSetpoint)
        assert sent.speed == pytest.approx(2.0 * ahead / 100)
        assert world.steered[-1] == Sticks(ahead=ahead)
    world.vehicle.send(PositionSetpoint(here + np.array([0.07, 0.0, 0.0])))
    assert world.steered[-1] == STILL
    world.vehicle.send(PositionSetpoint(here + np.array([0.07, 0.0, 0.0]), passing_speed=0.5))
    assert world.steered[-1].ahead >= 25
    world.vehicle.send(PositionSetpoint(here + np.array([0.0, 50.0, 0.0]), 0.0))
    assert world.steered[-1].right == -25
    world.vehicle.send(PositionSetpoint(here, math.radians(1.9)))
    assert world.steered[-1].clockwise == 0
    world.vehicle.send(PositionSetpoint(here, math.radians(90.0)))
    assert world.steered[-1].clockwise == -50
    world.vehicle.send(PositionSetpoint(here, math.radians(-90.0)))
    assert world.steered[-1].clockwise == 50


def test_on_the_ground_it_is_not_flown(world: World) -> None:
    """Neither steered, held nor brought home; landing is nothing."""
    for act in (
        lambda: world.vehicle.send(VelocitySetpoint(np.zeros(3))),
        world.vehicle.hold,
        world.vehicle.return_home,
    ):
        with pytest.raises(VehicleError, match="on the ground; take off first"):
            act()
    world.vehicle.land()
    assert (world.asked, world.steered, world.released) == ([], [], 0)
    world.vehicle.close()
    assert world.closed == [None]


@pytest.mark.parametrize("height", [0.0, -1.0, math.nan, math.inf])
def test_a_take_off_needs_a_height(world: World, height: float) -> None:
    """Nothing is asked for otherwise."""
    with pytest.raises(InvalidWaypointError, match="positive number of metres"):
        world.vehicle.take_off(height)
    assert world.asked == []


def test_a_take_off_is_its_own_and_then_ours(world: World) -> None:
    """A metre by itself, without sticks; the rest at no more than its climb, and then it holds."""
    world.vehicle.take_off(2.0)
    assert world.asked == [("takeoff", False)]
    assert world.released == 1
    assert world.mode() is VehicleMode.TAKING_OFF
    with pytest.raises(VehicleError, match="while it is taking off"):
        world.vehicle.hold()
    assert "already taking off" in world.vehicle.preflight()
    world.say(height=1.0, ground_distance=1.1)
    world.spin(0.5)
    assert world.steered == []
    world.answer("ok")
    world.spin(0.1)
    assert world.steered[-1] == Sticks(up=50)
    world.say(height=1.7, ground_distance=1.8)
    world.spin(0.5)
    assert 20 <= world.steered[-1].up <= 40
    assert world.mode() is VehicleMode.TAKING_OFF
    world.say(height=2.0, ground_distance=2.1)
    world.spin(0.5)
    assert world.steered[-1] == STILL
    assert world.mode() is VehicleMode.HOLDING
    count = len(world.steered)
    world.spin(0.5)
    assert len(world.steered) == count


def test_a_low_take_off_sinks_to_its_height(world: World) -> None:
    """Its own part of it may be higher."""
    world.vehicle.take_off(0.5)
    world.say(height=1.2, ground_distance=1.3)
    world.spin(0.3)
    world.answer("ok")
    world.spin(0.1)
    assert world.steered[-1] == Sticks(up=-50)


def test_a_climb_that_does_not_rise_is_given_up(world: World) -> None:
    """After 3 s more than twice the way at its climb: 1.1 m at 0.5 m/s are 7.4 s."""
    world.vehicle.take_off(2.0)
    world.say(height=1.0, ground_distance=1.1)
    world.spin(0.3)
    world.answer("ok")
    world.spin(7.2)
    assert world.mode() is VehicleMode.TAKING_OFF
    world.spin(0.5)
    assert world.mode() is VehicleMode.HOLDING


@pytest.mark.parametrize(
    ("reply", "height", "refusal"),
    [
        ("error Motor stop", 0.0, "it answered 'error Motor stop' (the battery is low"),
        (None, 0.0, "it did not answer to `takeoff` and does not fly"),
        ("ok", 0.0, ""),
        (None, 0.3, ""),
        ("error", 0.3, ""),
    ],
)
def test_what_becomes_of_a_take_off(
    world: World, reply: str | None, height: float, refusal: str
) -> None:
    """Who flies has taken off, whatever it answers; a refusal is told the next time, once."""
    world.vehicle.take_off(1.0)
    world.say(height=height, ground_distance=height + 0.1)
    world.advance(0.1)
    world.answer(reply)
    if not refusal:
        assert world.mode() is VehicleMode.TAKING_OFF
        return
    assert world.mode() is VehicleMode.GROUNDED
    with pytest.raises(VehicleError, match="t refuses to take off: ") as refused:
        world.vehicle.take_off(1.0)
    assert refusal in str(refused.value)
    world.vehicle.take_off(1.0)
    assert [text for text, _ in world.asked] == ["takeoff", "takeoff"]


def test_what_speaks_against_a_take_off(world: World) -> None:
    """Charge and heat, each told as a fault, too; exactly at the limit charge is enough."""
    assert world.vehicle.preflight() == []
    needed = world.vehicle._settings.battery_minimum
    world.say(battery=round(needed * 100), temperature=84.9)
    world.advance(1.0)
    assert world.vehicle.preflight() == []
    world.say(battery=round(needed * 100) - 1, temperature=85.0)
    world.advance(1.0)
    below = f"{needed - 0.01:.0%}"
    assert world.vehicle.preflight() == [
        f"the battery holds {below}, take-off needs {needed:.0%}",
        "it is hot inside: 85 °C; cool it",
    ]
    assert world.vehicle.read().faults == (
        "it is hot inside: 85 °C",
        f"the battery is low: {below}",
    )
    with pytest.raises(VehicleError, match="refuses to take off: the battery holds"):
        world.vehicle.take_off(1.0)


@pytest.mark.parametrize("deed", ["land", "return_home"])
def test_a_landing_is_asked_for_until_it_shows(world: World, deed: str) -> None:
    """At once and before all else, again after three seconds; one that descends is left alone."""
    world.fly()
    released = world.released
    getattr(world.vehicle, deed)()
    assert world.asked == [("land", True)]
    assert world.released == released + 1
    assert world.mode() is VehicleMode.LANDING
    with pytest.raises(VehicleError, match="while it is landing"):
        world.vehicle.hold()
    world.spin(2.9)
    assert len(world.asked) == 1
    world.spin(0.3)
    assert world.asked == [("land", True)] * 2
    world.say(velocity=(0.0, 0.0, 0.1))
    world.spin(5.0)
    world.say(velocity=(0.0, 0.0, -0.1), ground_distance=0.1)
    world.spin(5.0)
    assert len(world.asked) == 2
    world.say(ground_distance=0.2)
    world.spin(3.5)
    assert len(world.asked) == 3
    world.say(velocity=(0.0, 0.0, 0.0), height=0.0, ground_distance=0.1)
    world.advance(3.0)
    state = world.vehicle.read()
    assert (state.mode, state.armed, state.ended) == (
        VehicleMode.GROUNDED,
        False,
        FlightEnd.LANDED,
    )
    assert state.odometry.position[2] == 0.0


def test_a_landing_that_nobody_sees_is_asked_for_again(world: World) -> None:
    """While no packet comes, whatever the last one said."""
    world.fly()
    world.vehicle.land()
    world.say(velocity=(0.0, 0.0, 0.5))
    world.spin(1.0)
    world.speaks = False
    world.advance(3.8)
    assert world.asked == [("land", True)] * 2


def test_hold_centres_the_sticks(world: World) -> None:
    """And the next setpoint flies on."""
    world.fly()
    world.vehicle.send(VelocitySetpoint(np.array([1.0, 0.0, 0.0])))
    world.vehicle.hold()
    assert world.steered[-1] == STILL
    assert world.mode() is VehicleMode.HOLDING


def test_who_came_down_by_itself_is_left_alone(world: World) -> None:
    """Told why; until it is met again."""
    world.fly()
    world.say(height=0.0, ground_distance=0.1)
    world.advance(3.0)
    assert world.mode() is VehicleMode.FAILSAFE
    with pytest.raises(VehicleError, match="t cannot hold: it has landed by itself"):
        world.vehicle.hold()
    assert world.vehicle.preflight() == ["it has landed by itself; connect again"]
    world.say(motor_time=0.0)
    world.vehicle.connect(3.0)
    assert world.mode() is VehicleMode.GROUNDED
    assert world.vehicle.preflight() == []


def test_a_tello_that_fell_silent_on_the_ground_is_greeted(world: World) -> None:
    """After two seconds, each two seconds; one in the air is not, for it hears already.

    Whether it answers or not is no matter.
    """
    world.speaks = False
    world.advance(2.0)
    assert world.asked == []
    world.advance(0.2)
    assert world.asked == [("command", False)]
    world.answer("ok")
    world.answer(None)
    world.advance(1.8)
    assert len(world.asked) == 1
    world.advance(0.3)
    assert len(world.asked) == 2
    world.speaks = True
    world.advance(0.5)
    world.fly()
    world.speaks = False
    world.advance(6.0)
    assert ("command", False) not in world.asked


def test_letting_go_in_the_air_lands(world: World) -> None:
    """Once; whoever has let go is not connected."""
    world.fly()
    world.vehicle.close()
    world.vehicle.close()
    (last,) = world.closed
    assert last is not None
    assert last.text == "land"
    assert world.vehicle.preflight() == ["not connected"]
    world.advance(1.0)
