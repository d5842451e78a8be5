"""Other aircraft of a recording: as the vehicle heard them, once a second, and no longer."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from aerodaas.clock import NANOSECONDS
from aerodaas.messages.vehicle import Traffic
from aerodaas.protocol.schemas import TrafficOut
from aerodaas.recording.playback.track import Room, TrackBuilder

NOWHERE = {"x": 0.0, "y": 0.0, "z": 0.0}
ONE: dict[str, Any] = {
    "address": 7,
    "callsign": "DLH4",
    "position": {"x": 100.0, "y": 20.0, "z": None},
    "velocity": {"x": 30.0, "y": 0.0, "z": 0.0},
    "age": 0.5,
}


def state(second: float, **more: object) -> dict[str, Any]:
    """A vehicle's recorded state."""
    return {
        "stamp": round(second * NANOSECONDS),
        "mode": "guided",
        "odometry": {"position": NOWHERE, "velocity": NOWHERE, "yaw": 0.0},
        "battery": {"fraction": 0.5},
        **more,
    }


def track(*states: dict[str, Any]) -> list[tuple[float, int]]:
    """When how many aircraft are heard of."""
    builder = TrackBuilder(Room())
    for one in states:
        builder.state(one)
    return [(round(one.since, 6), len(one.aircraft)) for one in builder.track.traffic]


def test_a_second_passes_between_two_words_but_not_before_the_last_is_gone() -> None:
    """Where none is ever heard, nothing is told."""
    heard = [state(0.2 * step, traffic=[ONE]) for step in range(5, 12)]
    assert track(*[state(0.2 * step) for step in range(5)], *heard, state(2.4), state(2.6)) == [
        (1.0, 1),
        (2.0, 1),
        (2.4, 0),
    ]
    assert track(state(0.0), state(5.0)) == []


@pytest.mark.parametrize(
    "told",
    [
        "many",
        [None, 3, "DLH4", []],
        [{**ONE, "position": None}],
        [{**ONE, "position": {"x": None, "y": 1.0, "z": 2.0}}],
        [{**ONE, "velocity": {"x": "fast", "y": 1.0, "z": 2.0}}],
        [{name: value for name, value in ONE.items() if name != "address"}],
    ],
)
def test_what_is_malformed_is_left_out(told: object) -> None:
    """And the flight is told all the same."""
    assert track(state(0.0, traffic=told), state(1.0, traffic=[ONE])) == [(1.0, 1)]


def test_a_vehicles_aircraft_has_no_height_where_none_is_known() -> None:
    """JSON has no NaN."""
    aircraft = Traffic(7, "DLH4", np.array([1.0, 2.0, np.nan]), np.array([3.0, 4.0, 0.0]), 0.5)
    told = TrafficOut.of(aircraft)
    assert (told.position, told.velocity, told.age) == ((1.0, 2.0, None), (3.0, 4.0, 0.0), 0.5)
