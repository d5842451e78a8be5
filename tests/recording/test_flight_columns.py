"""The states of a long flight are an array once, however often a plot asks for them."""

from __future__ import annotations

import numpy as np

from aerodaas.recording.report.flight import RobotFlight


def test_an_array_is_made_anew_only_for_new_states() -> None:
    """What is asked for twice is the same memory, and what came later is in it."""
    flight = RobotFlight(states=[(0.0, 1.0, 2.0, 3.0, 0.9)])
    assert np.shares_memory(flight.position, flight.position)
    assert flight.position.tolist() == [[1.0, 2.0, 3.0]]
    flight.states.append((1.0, 4.0, 5.0, 6.0, 0.8))
    assert flight.time.tolist() == [0.0, 1.0]
    assert flight.battery.tolist() == [0.9, 0.8]


def test_a_flight_without_states_has_empty_columns() -> None:
    """As a recording that was cut off at once has."""
    flight = RobotFlight()
    assert flight.position.shape == (0, 3)
    assert flight == RobotFlight()
