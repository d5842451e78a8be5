"""Other aircraft of a recording: as the vehicle heard them, once a second, and no longer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aerodaas.clock import NANOSECONDS, seconds
from aerodaas.messages.odometry import Battery, Odometry
from aerodaas.messages.serialization.schema import json_of
from aerodaas.messages.vehicle import Traffic, VehicleMode, VehicleState
from aerodaas.recording.playback.track import Room, TrackBuilder

STILL = Odometry(np.zeros(3), np.zeros(3), 0.0)
ONE = Traffic(7, "DLH4", np.array([100.0, 20.0, np.nan]), np.array([30.0, 0.0, 0.0]), 0.5)


def state(second: float, *traffic: Traffic) -> VehicleState:
    """A vehicle's recorded state."""
    stamp = round(second * NANOSECONDS)
    return VehicleState(stamp, STILL, Battery(0.5), VehicleMode.GUIDED, armed=True, traffic=traffic)


def track(*states: VehicleState) -> list[tuple[float, int]]:
    """When how many aircraft are heard of."""
    builder = TrackBuilder(Room())
    for one in states:
        builder.add_state(one)
    return [(seconds(one.stamp), len(one.traffic)) for one in builder.track.states if one.traffic]


def test_a_second_passes_between_two_words() -> None:
    """Where none is ever heard, nothing is told; a page forgets the last one, as a vehicle does."""
    heard = [state(0.2 * step, ONE) for step in range(5, 12)]
    assert track(*[state(0.2 * step) for step in range(5)], *heard, state(2.4), state(2.6)) == [
        (1.0, 1),
        (2.0, 1),
    ]
    assert track(state(0.0), state(5.0)) == []


@pytest.mark.parametrize(
    "unknown",
    [
        replace(ONE, position=np.array([np.nan, 1.0, 2.0])),
        replace(ONE, velocity=np.array([1.0, np.nan, 2.0])),
    ],
)
def test_an_aircraft_whose_place_is_not_known_is_left_out(unknown: Traffic) -> None:
    """And the flight is told all the same."""
    assert track(state(0.0, unknown), state(1.0, ONE)) == [(1.0, 1)]


def test_an_aircraft_has_no_height_where_none_is_known() -> None:
    """JSON has no NaN."""
    assert json_of(ONE)["position"] == {"x": 100.0, "y": 20.0, "z": None}
