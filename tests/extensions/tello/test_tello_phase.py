"""What a Tello is doing, by the second and the decimetre: flying, standing, fallen, refused."""

from __future__ import annotations

import pytest

from aerodaas.extensions.tello.phase import LIFTED, FlightPhase
from aerodaas.extensions.tello.state import TelloState
from aerodaas.messages.vehicle import FlightEnd, VehicleMode


def packet(
    motor_time: float, height: float = 0.0, distance: float | None = None, down: float = 0.0
) -> TelloState:
    """A packet: its motors' clock, metres above the start and the ground, m/s downwards."""
    below = height if distance is None else distance
    return TelloState(0, 0, 0, (9.0, 9.0, down), height, below, 100.0, 80, motor_time, 50.0)


class Flight:
    """A phase with a clock of its own, whose ticks are those of the motors while they turn."""

    def __init__(self) -> None:
        self.now = 100.0
        self.motors = 0.0
        self.phase = FlightPhase()
        self.see()

    def see(self, height: float = 0.0, distance: float | None = None, down: float = 0.0) -> None:
        """One packet, now."""
        self.phase.observe(packet(self.motors, height, distance, down), self.now)

    def turn(
        self, seconds: float, height: float, distance: float | None = None, down: float = 0.0
    ) -> None:
        """Eight packets a second with turning motors."""
        for _ in range(round(8 * seconds)):
            self.now += 0.125
            self.motors += 0.125
            self.see(height, distance, down)

    def stand(self, seconds: float, height: float = 0.0, distance: float | None = None) -> None:
        """The same with still ones."""
        for _ in range(round(8 * seconds)):
            self.now += 0.125
            self.see(height, distance)

    def to(self, mode: VehicleMode) -> None:
        """Change to a mode by request."""
        self.phase.to(mode, self.now)


def test_in_which_modes_rotors_may_turn_and_setpoints_steer() -> None:
    """Not on the ground, nor once it came down by itself; steered while it hovers or flies."""
    phase = FlightPhase()
    assert (phase.airborne, phase.steered, phase.risen, phase.refusal) == (False, False, False, "")
    for mode, airborne, steered in (
        (VehicleMode.TAKING_OFF, True, False),
        (VehicleMode.HOLDING, True, True),
        (VehicleMode.GUIDED, True, True),
        (VehicleMode.LANDING, True, False),
        (VehicleMode.FAILSAFE, False, False),
        (VehicleMode.GROUNDED, False, False),
    ):
        phase.to(mode, 1.0)
        assert (phase.mode, phase.airborne, phase.steered) == (mode, airborne, steered)


@pytest.mark.parametrize(("height", "flies"), [(0.2, False), (LIFTED, True), (1.0, True)])
def test_found_in_the_air_it_holds(height: float, *, flies: bool) -> None:
    """With turning motors, from 0.3 m on."""
    flight = Flight()
    flight.turn(1.0, height)
    assert flight.phase.mode is (VehicleMode.HOLDING if flies else VehicleMode.GROUNDED)


def test_still_motors_are_no_flight_however_high_it_is() -> None:
    """On a table, or carried; the first packet alone says nothing of its motors."""
    flight = Flight()
    flight.stand(3.0, 1.5)
    assert flight.phase.mode is VehicleMode.GROUNDED


@pytest.mark.parametrize(
    ("down", "packets", "risen"),
    [
        (0.0, 9, False),
        (0.0, 10, True),
        (0.1, 10, True),
        (-0.1, 10, True),
        (0.2, 20, False),
        (-0.2, 20, False),
    ],
)
def test_a_take_off_is_done_after_ten_calm_packets(
    down: float, packets: int, *, risen: bool
) -> None:
    """At most 0.1 m/s up or down, in a row; its reply is not needed."""
    flight = Flight()
    flight.to(VehicleMode.TAKING_OFF)
    flight.turn(packets / 8, 1.0, down=down)
    assert flight.phase.risen is risen
    assert flight.phase.mode is VehicleMode.TAKING_OFF


def test_calm_packets_count_in_a_row() -> None:
    """Nine, one that rises, nine more: not yet. Ten of them low above the start do not count."""
    flight = Flight()
    flight.to(VehicleMode.TAKING_OFF)
    flight.turn(9 / 8, 1.0)
    flight.turn(1 / 8, 1.0, down=-0.5)
    flight.turn(9 / 8, 1.0)
    flight.turn(20 / 8, 0.2)
    assert not flight.phase.risen
    flight.turn(1 / 8, 1.0)
    assert flight.phase.risen


def test_a_refused_take_off_leaves_it_on_the_ground() -> None:
    """With the reason, until the next; a reply that comes later, or to nothing, says nothing."""
    phase = FlightPhase()
    phase.rose(refusal="error")
    assert (phase.refusal, phase.mode) == ("", VehicleMode.GROUNDED)
    phase.to(VehicleMode.TAKING_OFF, 1.0)
    phase.rose(refusal="error Motor stop")
    assert (phase.refusal, phase.mode) == ("error Motor stop", VehicleMode.GROUNDED)
    phase.rose()
    assert not phase.risen
    phase.to(VehicleMode.TAKING_OFF, 2.0)
    assert phase.refusal == ""


@pytest.mark.parametrize(("seconds", "refused"), [(12.0, False), (12.125, True)])
def test_a_take_off_that_does_not_lift(seconds: float, *, refused: bool) -> None:
    """Given up after twelve seconds on the ground."""
    flight = Flight()
    flight.to(VehicleMode.TAKING_OFF)
    flight.stand(seconds)
    words = "it did not lift; is there room and light below it?"
    assert flight.phase.refusal == (words if refused else "")
    assert flight.phase.mode is (VehicleMode.GROUNDED if refused else VehicleMode.TAKING_OFF)


def flown() -> Flight:
    """Two seconds of flight a metre up, and the request to land."""
    flight = Flight()
    flight.to(VehicleMode.TAKING_OFF)
    flight.turn(2.0, 1.0)
    flight.to(VehicleMode.HOLDING)
    flight.to(VehicleMode.LANDING)
    return flight


@pytest.mark.parametrize(
    ("height", "distance", "down"),
    [(0.0, 0.0, True), (0.2, 5.0, True), (5.0, 0.2, True), (0.3, 0.3, False), (0.3, 5.0, False)],
)
def test_where_a_landing_may_have_ended(height: float, distance: float, *, down: bool) -> None:
    """Less than 0.3 m above its start, or above whatever is below: a table is ground, too."""
    flight = flown()
    flight.stand(5.0, height, distance)
    assert flight.phase.mode is (VehicleMode.GROUNDED if down else VehicleMode.LANDING)
    assert flight.phase.ended is (FlightEnd.LANDED if down else None)


@pytest.mark.parametrize(("seconds", "down"), [(1.375, False), (1.5, True)])
def test_motors_stand_a_second_and_a_half_after_their_last_tick(
    seconds: float, *, down: bool
) -> None:
    """Their clock has whole seconds."""
    flight = flown()
    flight.stand(seconds)
    assert flight.phase.mode is (VehicleMode.GROUNDED if down else VehicleMode.LANDING)


@pytest.mark.parametrize(("later", "down"), [(1.375, False), (1.5, True)])
def test_a_landing_of_a_vehicle_that_stands_takes_a_second_and_a_half(
    later: float, *, down: bool
) -> None:
    """Its packets may be of before the request."""
    flight = Flight()
    flight.to(VehicleMode.HOLDING)
    flight.turn(1.0, 0.0)
    flight.stand(1.25)
    flight.to(VehicleMode.LANDING)
    flight.stand(later)
    assert flight.phase.mode is (VehicleMode.GROUNDED if down else VehicleMode.LANDING)


@pytest.mark.parametrize(("risen", "seconds"), [(False, 4.0), (True, 1.5)])
def test_a_take_off_called_off_is_watched_for_four_seconds(seconds: float, *, risen: bool) -> None:
    """The order to start may come later than the one to land; not once it had risen."""
    flight = Flight()
    flight.to(VehicleMode.TAKING_OFF)
    if risen:
        flight.phase.rose()
    flight.to(VehicleMode.LANDING)
    flight.stand(seconds - 0.125)
    assert flight.phase.mode is VehicleMode.LANDING
    flight.stand(0.125)
    assert [flight.phase.mode] == [VehicleMode.GROUNDED]
    assert flight.phase.ended is None, "it never flew"


@pytest.mark.parametrize("mode", [VehicleMode.HOLDING, VehicleMode.GUIDED])
def test_motors_that_stop_unasked_are_its_own_protection(mode: VehicleMode) -> None:
    """Low battery, heat: it has landed by itself, and is left alone."""
    flight = Flight()
    flight.turn(2.0, 1.0)
    flight.to(mode)
    flight.stand(3.0)
    assert (flight.phase.mode, flight.phase.ended) == (VehicleMode.FAILSAFE, FlightEnd.LANDED)
    assert flight.phase.outcome == "it has landed by itself"
    flight.stand(10.0)
    assert flight.phase.mode is VehicleMode.FAILSAFE


@pytest.mark.parametrize(
    ("down", "before", "ended"),
    [
        (2.0, 0.125, FlightEnd.LANDED),
        (2.1, 0.125, FlightEnd.FELL),
        (2.1, 2.375, FlightEnd.FELL),
        (2.1, 2.5, FlightEnd.LANDED),
        (-5.0, 0.125, FlightEnd.LANDED),
    ],
)
def test_a_fall_shows_by_more_than_two_metres_a_second(
    down: float, before: float, ended: FlightEnd
) -> None:
    """Downwards, within four seconds before it stands: 1.5 s of them go by until that is known."""
    flight = Flight()
    flight.turn(2.0, 1.0)
    flight.turn(0.125, 1.0, down=down)
    flight.turn(before, 0.1)
    flight.stand(1.5)
    assert (flight.phase.mode, flight.phase.ended) == (VehicleMode.FAILSAFE, ended)


def test_a_flight_that_begins_by_itself_has_not_ended() -> None:
    """Started from the hand, after one that fell: its end, and its fall, are forgotten."""
    flight = Flight()
    flight.turn(2.0, 1.0, down=3.0)
    flight.to(VehicleMode.LANDING)
    flight.stand(1.5)
    assert (flight.phase.mode, flight.phase.ended) == (VehicleMode.GROUNDED, FlightEnd.FELL)
    assert flight.phase.outcome == "its motors have stopped in flight"
    flight.turn(1.0, 1.0)
    assert [flight.phase.mode] == [VehicleMode.HOLDING]
    assert flight.phase.ended is None
    flight.turn(0.125, 0.0)
    flight.stand(1.5)
    assert [flight.phase.ended] == [FlightEnd.LANDED]
