"""How a flight ended: by landing, by motors that stopped in the air, or while nobody heard it."""

from __future__ import annotations

import pytest

from aerodaas.drivers.mavlink.state.phase import FlightMode
from aerodaas.drivers.mavlink.state.touchdown import Touchdown
from aerodaas.types.vehicle import FlightEnd

UP = 3.0


class Falling:
    """A vehicle that is heard 20 times a second, its HEARTBEAT once."""

    def __init__(self, mode: FlightMode) -> None:
        self.now = 100.0
        self.touchdown = Touchdown()
        self._mode = mode
        self._up = 0.0
        self.touchdown.report(self.now, on_ground=True)
        self.touchdown.observe(mode, self.now, armed=False)
        self.move(0.2, 0.0)
        self.touchdown.observe(mode, self.now, armed=True)
        self.touchdown.report(self.now, on_ground=False)
        self.move(UP, 1.0)
        self.touchdown.observe(mode, self.now, armed=True)

    def move(self, seconds: float, speed: float) -> None:
        """Move up or down at a speed, never below the ground."""
        for _ in range(round(seconds / 0.05)):
            self.now += 0.05
            before, self._up = self._up, max(0.0, self._up + speed * 0.05)
            rise = (self._up - before) / 0.05
            self.touchdown.move(self._up, rise, abs(rise), self.now)

    def stop(self) -> FlightEnd | None:
        """Have its HEARTBEAT say that no motor turns."""
        self.touchdown.observe(self._mode, self.now, armed=False)
        return self.touchdown.ended


def test_a_landing() -> None:
    """Nothing is said in the air; it stood for a while, and then its motors stop."""
    one = Falling(FlightMode.LAND)
    one.move(6.0, -0.5)
    one.touchdown.report(one.now, on_ground=True)
    assert one.touchdown.ended is None
    one.move(1.0, 0.0)
    assert one.stop() is FlightEnd.LANDED
    assert not one.touchdown.fault


@pytest.mark.parametrize("late", [0.0, 0.4, 0.9, 1.5])
def test_a_fall_in_a_landing_that_is_heard_of_late(late: float) -> None:
    """It lies still by then, and calls itself landed: the fall itself was seen."""
    one = Falling(FlightMode.LAND)
    one.move(1.0, -0.5)
    one.touchdown.report(one.now, on_ground=True)
    one.move(0.5, -5.0)
    one.move(late, 0.0)
    assert one.stop() is FlightEnd.FELL
    assert one.touchdown.falling
    assert one.touchdown.fault.startswith("motors: stopped in flight")


@pytest.mark.parametrize("heard", [0.0, 0.1, 1.0])
@pytest.mark.parametrize("mode", [FlightMode.GUIDED, FlightMode.LAND])
def test_what_came_down_unheard_is_not_thought_to_have_fallen(
    heard: float, mode: FlightMode
) -> None:
    """Its HEARTBEAT may come before its first position, or after."""
    one = Falling(mode)
    one.now += 20.0
    one._up = 0.0
    one.move(heard, 0.0)
    assert one.stop() is FlightEnd.UNHEARD
    one.move(3.0, 0.0)
    assert one.touchdown.ended is FlightEnd.UNHEARD
    assert not one.touchdown.fault


def test_what_is_heard_falling_falls() -> None:
    """Heard of again in the very moment: its first positions tell."""
    one = Falling(FlightMode.GUIDED)
    one.now += 5.0
    assert one.stop() is FlightEnd.UNHEARD
    one.move(0.4, -5.0)
    assert one.touchdown.ended is FlightEnd.FELL
    assert one.touchdown.fault


def test_a_flight_that_begins_has_not_ended() -> None:
    """How the one before ended is forgotten when motors start; one that never lifted has none."""
    one = Falling(FlightMode.GUIDED)
    assert one.stop() is FlightEnd.FELL
    one.move(3.0, -2.0)
    one.touchdown.report(one.now, on_ground=True)
    one.touchdown.observe(FlightMode.GUIDED, one.now, armed=True)
    assert one.touchdown.ended is None
    assert not one.touchdown.fault
    assert one.stop() is None
