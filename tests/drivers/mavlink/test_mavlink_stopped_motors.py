"""Motors that stop: at which speed, height and moment it is a landing, a fall, or not known."""

from __future__ import annotations

import pytest

from aerodaas.drivers.mavlink.state.phase import FlightMode
from aerodaas.drivers.mavlink.state.touchdown import Touchdown
from aerodaas.messages.vehicle import FlightEnd

START = 7.0
"""Metres up in the autopilot's frame at which it is armed."""


class Flight:
    """Armed on the ground at 100 s, flown since; times in eighths of a second are exact."""

    def __init__(self, mode: FlightMode = FlightMode.GUIDED) -> None:
        self.now = 100.0
        self.mode = mode
        self.touchdown = Touchdown()
        self.touchdown.report(self.now, on_ground=True)
        self.touchdown.move(START, 0.0, 0.0, self.now)
        self.touchdown.observe(mode, self.now, armed=False)
        self.touchdown.observe(mode, self.now, armed=True)

    def fly(
        self, seconds: float, up: float = 0.0, *, rise: float = 0.0, speed: float | None = None
    ) -> None:
        """Be heard eight times a second, `up` metres above the start."""
        for _ in range(round(seconds * 8)):
            self.now += 0.125
            self.touchdown.move(START + up, rise, abs(rise) if speed is None else speed, self.now)

    def say(self, *, on_ground: bool | None) -> None:
        """Have the autopilot say whether it is on the ground."""
        self.touchdown.report(self.now, on_ground=on_ground)

    def stop(self, after: float = 0.0) -> FlightEnd | None:
        """Have a HEARTBEAT say that no motor turns."""
        self.now += after
        self.touchdown.observe(self.mode, self.now, armed=False)
        return self.touchdown.ended


def airborne(mode: FlightMode = FlightMode.LAND) -> Flight:
    """Flown for four seconds, 5 m above its start, in `mode`."""
    flight = Flight(mode)
    flight.fly(1.0, 5.0, rise=1.0)
    flight.say(on_ground=False)
    flight.fly(3.0, 5.0, speed=2.0)
    assert flight.touchdown.flew
    return flight


@pytest.mark.parametrize(("up", "flew"), [(0.5, False), (0.51, True), (-3.0, False)])
def test_it_flies_from_half_a_metre_on(up: float, *, flew: bool) -> None:
    """Above where it was armed, wherever that is; what never flew has no end."""
    flight = Flight()
    flight.fly(0.125, up)
    assert flight.touchdown.flew is flew
    assert (flight.stop() is not None) is flew


@pytest.mark.parametrize(("on_ground", "flew"), [(None, True), (False, True), (True, False)])
def test_found_armed_it_is_taken_to_fly(*, on_ground: bool | None, flew: bool) -> None:
    """Unless it says that it stands; one that was seen disarmed before begins on the ground."""
    found = Touchdown()
    found.report(100.0, on_ground=on_ground)
    found.observe(FlightMode.GUIDED, 100.0, armed=True)
    assert found.flew is flew
    seen = Touchdown()
    seen.observe(FlightMode.GUIDED, 100.0, armed=False)
    seen.report(100.0, on_ground=on_ground)
    seen.observe(FlightMode.GUIDED, 100.5, armed=True)
    assert not seen.flew


@pytest.mark.parametrize(
    ("rise", "speed", "ended"),
    [
        (0.0, 0.0, FlightEnd.LANDED),
        (0.34, 0.99, FlightEnd.LANDED),
        (-0.34, 0.99, FlightEnd.LANDED),
        (0.35, 0.5, FlightEnd.FELL),
        (-0.35, 0.5, FlightEnd.FELL),
        (0.0, 1.0, FlightEnd.FELL),
    ],
)
def test_how_still_a_vehicle_that_stands_must_be(
    rise: float, speed: float, ended: FlightEnd
) -> None:
    """Below 0.35 m/s up or down, and below 1 m/s in all."""
    flight = airborne()
    flight.fly(3.0, rise=rise, speed=speed)
    assert flight.stop() is ended


@pytest.mark.parametrize(
    ("still", "ended"), [(0.5, FlightEnd.FELL), (0.625, FlightEnd.LANDED), (2.0, FlightEnd.LANDED)]
)
def test_how_long_it_must_stand(still: float, ended: FlightEnd) -> None:
    """Half a second from the first position at which it is still, and in a row."""
    flight = airborne()
    flight.fly(still)
    assert flight.stop() is ended
    flight = airborne()
    flight.fly(still)
    flight.fly(0.125, rise=-0.5)
    assert flight.stop() is FlightEnd.FELL


@pytest.mark.parametrize(
    ("mode", "up", "ended"),
    [
        (FlightMode.LAND, 20.0, FlightEnd.LANDED),
        (FlightMode.RETURN, 0.99, FlightEnd.LANDED),
        (FlightMode.RETURN, 1.0, FlightEnd.FELL),
        (FlightMode.RETURN, -20.0, FlightEnd.LANDED),
        (FlightMode.GUIDED, 0.0, FlightEnd.FELL),
        (FlightMode.HOLD, 0.0, FlightEnd.FELL),
    ],
)
def test_which_modes_end_on_the_ground(mode: FlightMode, up: float, ended: FlightEnd) -> None:
    """A landing anywhere, on a roof too; a return within a metre above its start; no other."""
    flight = airborne(mode)
    flight.fly(3.0, up)
    assert flight.stop() is ended


@pytest.mark.parametrize(("said", "ended"), [(0.375, FlightEnd.FELL), (0.5, FlightEnd.LANDED)])
def test_in_other_modes_its_own_word_counts_after_half_a_second(
    said: float, ended: FlightEnd
) -> None:
    """A pilot's landing, where it stood still meanwhile; a word that it took back is none."""
    flight = airborne(FlightMode.OTHER)
    flight.fly(3.0)
    flight.say(on_ground=True)
    flight.fly(said)
    flight.say(on_ground=True)
    assert flight.stop() is ended
    flight = airborne(FlightMode.OTHER)
    flight.say(on_ground=True)
    flight.fly(3.0)
    flight.say(on_ground=None)
    flight.fly(0.25)
    flight.say(on_ground=True)
    flight.fly(0.25)
    assert flight.stop() is FlightEnd.FELL


@pytest.mark.parametrize(
    ("said", "rise", "ended"),
    [
        (1.75, -0.5, FlightEnd.FELL),
        (1.875, -0.5, FlightEnd.LANDED),
        (1.875, -1.99, FlightEnd.LANDED),
        (1.875, -2.0, FlightEnd.FELL),
    ],
)
def test_a_long_word_of_its_own_counts_though_its_estimate_moves(
    said: float, rise: float, ended: FlightEnd
) -> None:
    """1.8 s of it, unless it sinks at 2 m/s; in whatever mode."""
    flight = airborne(FlightMode.GUIDED)
    flight.say(on_ground=True)
    flight.fly(said, rise=rise)
    assert flight.stop() is ended


@pytest.mark.parametrize(("lying", "ended"), [(2.375, FlightEnd.FELL), (2.5, FlightEnd.LANDED)])
def test_who_fell_lately_has_not_landed(lying: float, ended: FlightEnd) -> None:
    """Two and a half seconds are as late as its HEARTBEAT may come."""
    flight = airborne()
    flight.fly(0.25, 3.0, rise=-2.1)
    flight.fly(lying)
    assert flight.stop() is ended


@pytest.mark.parametrize(
    ("silence", "ended"), [(1.0, FlightEnd.LANDED), (1.125, FlightEnd.UNHEARD)]
)
def test_who_has_said_nothing_for_a_second_is_not_judged(silence: float, ended: FlightEnd) -> None:
    """It stood when it was heard last; a HEARTBEAT after a silence says nothing of the end."""
    flight = airborne()
    flight.fly(3.0)
    assert flight.stop(after=silence) is ended


@pytest.mark.parametrize(("heard", "ended"), [(2.5, FlightEnd.UNHEARD), (2.625, FlightEnd.LANDED)])
def test_after_a_silence_it_is_judged_once_it_was_heard_for_a_while(
    heard: float, ended: FlightEnd
) -> None:
    """Two and a half seconds since its first position: its HEARTBEAT may have come before."""
    flight = airborne()
    flight.now += 30.0
    flight.fly(heard)
    assert flight.stop() is ended


def test_who_fell_before_the_silence_fell() -> None:
    """Seen falling, and then not heard for a second."""
    flight = airborne()
    flight.fly(0.125, 3.0, rise=-5.0)
    assert flight.stop(after=1.5) is FlightEnd.FELL
    flight = airborne()
    flight.fly(0.125, 3.0, rise=-5.0)
    assert flight.stop(after=2.5) is FlightEnd.FELL
    flight = airborne()
    flight.fly(0.125, 3.0, rise=-5.0)
    assert flight.stop(after=2.625) is FlightEnd.UNHEARD


@pytest.mark.parametrize(("later", "ended"), [(2.25, FlightEnd.FELL), (2.5, FlightEnd.UNHEARD)])
def test_who_is_heard_falling_soon_after_fell(later: float, ended: FlightEnd) -> None:
    """Its first positions after the HEARTBEAT tell, for two and a half seconds."""
    flight = airborne()
    assert flight.stop(after=10.0) is FlightEnd.UNHEARD
    flight.now += later - 0.125
    flight.fly(0.125, 2.0, rise=-3.0)
    assert flight.touchdown.ended is ended
    assert flight.touchdown.falling is (ended is FlightEnd.FELL)


def test_a_fall_is_told_by_its_height() -> None:
    """Above where the motors started; without a place there, none is said."""
    flight = airborne()
    assert flight.stop() is FlightEnd.FELL
    assert flight.touchdown.fault == "motors: stopped in flight, 5 m above where they started"
    assert flight.touchdown.falling
    found = Touchdown()
    found.observe(FlightMode.GUIDED, 100.0, armed=True)
    found.move(50.0, -3.0, 3.0, 100.5)
    found.observe(FlightMode.GUIDED, 101.0, armed=False)
    assert found.fault == "motors: stopped in flight"


@pytest.mark.parametrize(("lying", "falling"), [(1.125, True), (1.25, False)])
def test_it_falls_until_it_lies(lying: float, *, falling: bool) -> None:
    """More than a second of standing still, heard within the last second."""
    flight = airborne()
    flight.stop()
    flight.fly(1.0, rise=-5.0)
    flight.fly(lying)
    flight.touchdown.update(flight.now)
    assert flight.touchdown.falling is falling
    flight.touchdown.update(flight.now + 1.0)
    assert flight.touchdown.falling is falling, "what is a second old says nothing of the present"
    assert flight.touchdown.ended is FlightEnd.FELL


def test_whatever_fell_lies_after_ten_seconds() -> None:
    """Even if nothing is heard of it any more; counted from the last HEARTBEAT that flew."""
    flight = airborne()
    flight.now += 0.5
    flight.touchdown.observe(flight.mode, flight.now, armed=True)
    flight.stop()
    for seconds, falling in ((5.0, True), (10.0, True), (10.1, False)):
        flight.touchdown.update(flight.now + seconds)
        assert flight.touchdown.falling is falling


def test_an_autopilot_that_starts_anew_in_flight_falls() -> None:
    """And whatever its new frame says of standing still is not believed for ten seconds."""
    flight = airborne()
    flight.touchdown.restart(flight.now)
    assert [flight.touchdown.ended] == [FlightEnd.FELL]
    assert flight.touchdown.fault == "motors: stopped in flight, 5 m above where they started"
    restarted = flight.now
    flight.fly(9.0)
    for seconds, falling in ((10.0, True), (10.1, False)):
        flight.touchdown.update(restarted + seconds)
        assert flight.touchdown.falling is falling
    flight.touchdown.observe(flight.mode, flight.now, armed=True)
    assert (flight.touchdown.ended, flight.touchdown.fault) == (None, "")
    assert not flight.touchdown.flew, "it was seen on the ground"


def test_an_autopilot_that_starts_anew_on_the_ground_has_ended_nothing() -> None:
    """With still motors, or turning ones that have not lifted it."""
    for armed in (True, False):
        flight = Flight()
        flight.touchdown.observe(flight.mode, flight.now, armed=armed)
        flight.touchdown.restart(flight.now)
        assert flight.touchdown.ended is None
        assert not flight.touchdown.falling
        assert not flight.touchdown.fault
