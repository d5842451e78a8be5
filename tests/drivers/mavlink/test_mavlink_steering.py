"""The stream of setpoints: clipped, begun at the vehicle, and guided flight asked for in time."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from aerodaas.config.model import RobotConfig
from aerodaas.drivers.mavlink.control.steering import Steering
from aerodaas.drivers.mavlink.settings import MavlinkSettings
from aerodaas.drivers.mavlink.state.frames import LocalFrame
from aerodaas.drivers.mavlink.state.phase import FlightMode, FlightPhase
from aerodaas.geometry.frames import Vector
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.vehicle import PositionSetpoint, VelocitySetpoint

FRAME = LocalFrame(np.array([100.0, 200.0, 50.0]))
LIMITS = {"max_speed": 4.0, "cruise_speed": 2.0, "max_climb": 1.5, "max_yaw_rate": 90.0}


def vector(*values: float) -> Vector:
    """An array of floats."""
    return np.array(values, np.float64)


def fields(message: Any, *names: str) -> list[float]:  # noqa: ANN401 - pymavlink has no types
    """Some of a message's fields."""
    return [getattr(message, name) for name in names]


def steering(**settings: float) -> Steering:
    """The stream of a vehicle with `LIMITS`."""
    robot = RobotConfig.model_validate({"id": "m", "driver": "mavlink", "limits": LIMITS})
    return Steering(robot, MavlinkSettings(**settings))  # type: ignore[arg-type]


def at(position: Vector, velocity: Vector | None = None, yaw: float = 0.0) -> Odometry:
    """Where the vehicle is."""
    return Odometry(position, np.zeros(3) if velocity is None else velocity, yaw)


def test_a_velocity_is_clipped_along_the_ground_and_upwards_by_itself() -> None:
    """6 and 8 m/s are 10, cut to 4: 2.4 and 3.2; up and turning to their own limits, either way."""
    for sign in (1.0, -1.0):
        asked = VelocitySetpoint(sign * vector(6.0, 8.0, 5.0), sign * 4.0)
        message, sent = steering().message(asked, at(np.zeros(3)), FRAME, (1, 1), 10.0, waits=False)
        assert isinstance(sent, VelocitySetpoint)
        assert sent.velocity == pytest.approx([sign * 2.4, sign * 3.2, sign * 1.5])
        assert sent.yaw_rate == pytest.approx(sign * math.pi / 2)
        wire = [sign * 3.2, sign * 2.4, -sign * 1.5]
        assert fields(message, "vx", "vy", "vz") == pytest.approx(wire)
        assert message.yaw_rate == pytest.approx(-sign * math.pi / 2)


def test_the_vehicles_own_limits_count_beside_the_robots() -> None:
    """Whichever is smaller: 1 m/s along the ground and 0.5 m/s upwards; 4 and 1.5 otherwise."""
    weak = steering(max_speed=1.0, max_climb=0.5)
    assert (weak.climb_rate, steering().climb_rate) == (0.5, 1.5)
    asked = VelocitySetpoint(vector(0.0, 9.0, 9.0))
    _, sent = weak.message(asked, at(np.zeros(3)), FRAME, (1, 1), 0.0, waits=False)
    assert isinstance(sent, VelocitySetpoint)
    assert sent.velocity == pytest.approx([0.0, 1.0, 0.5])
    place = PositionSetpoint(vector(50.0, 0.0, 0.0))
    _, there = weak.message(place, at(np.zeros(3)), FRAME, (1, 1), 0.0, waits=False)
    assert isinstance(there, PositionSetpoint)
    assert there.speed == 1.0


@pytest.mark.parametrize(("asked", "flown"), [(None, 2.0), (3.0, 3.0), (4.0, 4.0), (9.0, 4.0)])
def test_the_speed_of_a_flight_to_a_place(asked: float | None, flown: float) -> None:
    """Cruise speed unless another is asked for, at most what the robot may fly."""
    place = vector(50.0, 0.0, 5.0)
    message, sent = steering().message(
        PositionSetpoint(place, 0.5, asked), at(np.zeros(3)), FRAME, (4, 5), 1.0, waits=False
    )
    assert isinstance(sent, PositionSetpoint)
    assert sent.speed == flown
    assert sent.yaw == 0.5
    assert sent.position == pytest.approx(place)
    assert fields(message, "target_system", "target_component") == [4, 5]
    assert message.time_boot_ms == 1000


def test_without_a_position_it_is_told_to_stand_still() -> None:
    """Whatever was asked for; places would be of another frame."""
    for asked in (PositionSetpoint(vector(9.0, 9.0, 9.0)), VelocitySetpoint(vector(3.0, 0.0, 1.0))):
        message, sent = steering().message(asked, at(np.zeros(3)), None, (6, 1), 2.0, waits=False)
        assert isinstance(sent, VelocitySetpoint)
        assert sent.velocity.tolist() == [0.0, 0.0, 0.0]
        assert sent.yaw_rate == 0.0
        assert fields(message, "vx", "vy", "vz") == [0.0, 0.0, 0.0]
        assert message.target_system == 6
        assert message.time_boot_ms == 2000


def test_a_target_begins_at_the_vehicle_and_moves_towards_the_place() -> None:
    """At 2 m/s it is 0.1 m further each 0.05 s once it has its speed; while it waits it stays."""
    flight = steering()
    place, here = PositionSetpoint(vector(110.0, 200.0, 50.0), None, 2.0), vector(100, 200, 50)
    moving = at(here, vector(2.0, 0.0, 0.0), 0.7)
    waiting, _ = flight.message(place, moving, FRAME, (1, 1), 10.0, waits=True)
    assert fields(waiting, "x", "y", "z", "vx", "vy", "vz") == pytest.approx([0.0] * 6)
    assert waiting.yaw == pytest.approx(math.pi / 2 - 0.7)
    flight = steering()
    seen = [
        flight.message(place, moving, FRAME, (1, 1), 10.0 + turn / 20, waits=False)[0]
        for turn in range(4)
    ]
    assert [one.x for one in seen] == pytest.approx([0.0] * 4)
    steps = np.diff([one.y for one in seen])
    assert steps == pytest.approx([0.1, 0.1, 0.1])
    assert all(one.yaw == pytest.approx(math.pi / 2 - 0.7) for one in seen)


@pytest.mark.parametrize(("gap", "anew"), [(0.4, False), (0.5, False), (0.6, True)])
def test_a_stream_that_paused_begins_anew_where_the_vehicle_is(gap: float, *, anew: bool) -> None:
    """After more than half a second the target of before is forgotten."""
    flight = steering()
    place = PositionSetpoint(vector(150.0, 200.0, 50.0), None, 2.0)
    start = at(vector(100.0, 200.0, 50.0), vector(2.0, 0.0, 0.0))
    flight.message(place, start, FRAME, (1, 1), 10.0, waits=False)
    aside = at(vector(100.0, 205.0, 50.0), vector(0.0, 0.0, 0.0))
    message, _ = flight.message(place, aside, FRAME, (1, 1), 10.0 + gap, waits=False)
    assert bool(message.x > 4.9) is anew


def test_a_velocity_in_between_forgets_the_target() -> None:
    """The next place is flown to from where the vehicle is by then."""
    flight = steering()
    place = PositionSetpoint(vector(150.0, 200.0, 50.0), None, 2.0)
    flight.message(place, at(vector(100.0, 200.0, 50.0)), FRAME, (1, 1), 10.0, waits=False)
    aside = at(vector(100.0, 205.0, 50.0))
    flight.message(VelocitySetpoint(np.zeros(3)), aside, FRAME, (1, 1), 10.1, waits=False)
    message, _ = flight.message(place, aside, FRAME, (1, 1), 10.2, waits=False)
    assert message.x == pytest.approx(5.0, abs=0.1)


class Guided:
    """A stream of 20 setpoints a second, and what it asks of a vehicle that needs 1 s of them."""

    def __init__(self, shown: FlightMode) -> None:
        self.asked: list[tuple[float, FlightMode]] = []
        self.phase = FlightPhase()
        self.phase.observe(shown, 0.0, armed=True, critical=False)
        self.stream = steering()
        self.now = 0.0

    def run(self, since: float, until: float) -> None:
        """Stream from one second to another."""
        for twentieth in range(round(20 * since), round(20 * until) + 1):
            self.now = now = twentieth / 20
            still = VelocitySetpoint(np.zeros(3))
            self.stream.message(still, at(np.zeros(3)), FRAME, (1, 1), now, waits=True)
            self.stream.see_to_guidance(self.phase, 1.0, self._change, now)

    def _change(self, mode: FlightMode) -> None:
        self.asked.append((self.now, mode))


def test_guided_flight_is_asked_for_once_setpoints_were_heard() -> None:
    """After a second of them, not before; again each two seconds until it is seen."""
    flight = Guided(FlightMode.HOLD)
    flight.run(10.0, 15.5)
    assert flight.asked == [
        (11.0, FlightMode.GUIDED),
        (13.05, FlightMode.GUIDED),
        (15.1, FlightMode.GUIDED),
    ]
    flight.phase.ask(FlightMode.GUIDED, 15.5)
    flight.phase.observe(FlightMode.GUIDED, 15.5, armed=True, critical=False)
    flight.run(15.55, 20.0)
    assert len(flight.asked) == 3


def test_a_stream_that_paused_is_heard_anew_before_the_mode() -> None:
    """0.6 s without a setpoint, and the second begins again."""
    flight = Guided(FlightMode.HOLD)
    flight.run(10.0, 10.9)
    flight.run(11.5, 12.45)
    assert flight.asked == []
    flight.run(12.5, 12.5)
    assert flight.asked == [(12.5, FlightMode.GUIDED)]


def test_a_place_is_passed_no_faster_than_the_way_there_is_flown() -> None:
    """A setpoint is told as it was clipped."""
    asked = PositionSetpoint(vector(50.0, 0.0, 5.0), None, 9.0, 8.0, np.zeros(3))
    _, sent = steering().message(asked, at(np.zeros(3)), FRAME, (1, 1), 10.0, waits=False)
    assert sent == replace(asked, speed=4.0, passing_speed=4.0)
