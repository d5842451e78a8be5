"""A rangefinder that looks down: which readings count, and what the drone does by them."""

from __future__ import annotations

import math
from typing import Any

import pytest
from emulated import FAMILIES, Stepped

from aerodaas.drivers.mavlink.state.frames import Attitude
from aerodaas.drivers.mavlink.state.rangefinder import Rangefinder
from aerodaas.drivers.mavlink.state.telemetry import Telemetry
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.messages.mission import MissionState
from aerodaas.messages.waypoints import Waypoint
from tools.mavlink_vehicle import AutopilotOptions

LEVEL = Attitude()


def reading(centimetres: int, **fields: Any) -> Any:  # noqa: ANN401 - pymavlink has no types
    """A DISTANCE_SENSOR of a lidar that measures from 20 cm to 12 m, straight down."""
    usual = {
        "time_boot_ms": 1,
        "min_distance": 20,
        "max_distance": 1200,
        "current_distance": centimetres,
        "type": mavlink.MAV_DISTANCE_SENSOR_LASER,
        "id": 0,
        "orientation": mavlink.MAV_SENSOR_ROTATION_PITCH_270,
        "covariance": 255,
    }
    return mavlink.MAVLink_distance_sensor_message(**{**usual, **fields})


def below(*messages: Any, now: float = 10.0, attitude: Attitude = LEVEL) -> float | None:  # noqa: ANN401
    """What is below, by messages at 10 s."""
    sensor = Rangefinder()
    for message in messages:
        sensor.on_message(message, 10.0)
    return sensor.below(attitude, now)


def test_which_readings_count() -> None:
    """In range, fresh, downwards; too near is near, too far and nothing are no reading."""
    assert below(reading(350)) == pytest.approx(3.5)
    assert below(reading(1200)) == pytest.approx(12.0)
    assert below(reading(12)) == pytest.approx(0.12)
    assert below(reading(350), now=10.5) == pytest.approx(3.5)
    assert below(reading(350), now=10.51) is None
    for none in (
        reading(1201),
        reading(0),
        reading(350, signal_quality=1),
        reading(350, orientation=mavlink.MAV_SENSOR_ROTATION_NONE),
    ):
        assert below(none) is None
    assert below() is None


def test_what_was_seen_a_moment_ago_counts_until_it_is_farther() -> None:
    """A reading that fails says nothing; one beyond the range says that the ground is far."""
    assert below(reading(350), reading(0)) == pytest.approx(3.5)
    assert below(reading(350), reading(90, signal_quality=1)) == pytest.approx(3.5)
    assert below(reading(350), reading(1300)) is None


def test_a_tilted_drone_measures_along_its_own_axis() -> None:
    """It is less to the ground than it reads; from 45 degrees on it looks elsewhere."""
    tilted = Attitude(roll=math.radians(30), pitch=math.radians(-20))
    wanted = 4.0 * math.cos(math.radians(30)) * math.cos(math.radians(20))
    assert below(reading(400), attitude=tilted) == pytest.approx(wanted)
    assert below(reading(400), attitude=Attitude(pitch=math.radians(44.9))) is not None
    assert below(reading(400), attitude=Attitude(roll=math.radians(45.1))) is None


def test_its_silence_is_told() -> None:
    """Two seconds are none; out of range is no silence; a robot that needs none misses none."""
    sensor = Rangefinder()
    assert "no word from it, which" in sensor.fault(0.0)
    sensor.on_message(reading(5000), 10.0)
    assert sensor.fault(12.0) == ""
    assert "no word from it for 3 s" in sensor.fault(13.0)
    sensor.on_message(reading(100, orientation=mavlink.MAV_SENSOR_ROTATION_NONE), 13.0)
    assert sensor.fault(13.0), "one that looks ahead is another one"
    assert Telemetry().rangefinder is None


def test_several_rangefinders_stamp_each_their_own() -> None:
    """One that looks ahead is told of first, in the same millisecond; one's repetition is none."""
    telemetry = Telemetry(measures_ground=True)
    ahead = reading(90, id=0, orientation=mavlink.MAV_SENSOR_ROTATION_NONE)
    for message in (ahead, reading(350, id=1), reading(500, id=1)):
        telemetry.on_message(message, 10.0)
    assert telemetry.rangefinder is not None
    assert telemetry.rangefinder.below(LEVEL, 10.0) == pytest.approx(3.5)


@pytest.mark.parametrize("family", FAMILIES)
def test_a_drone_climbs_with_the_ground(
    monkeypatch: pytest.MonkeyPatch,
    family: Any,  # noqa: ANN401 - one of FAMILIES
) -> None:
    """Sent east at 3 m over ground that rises by a third of the way: it keeps its 2 m."""
    options = AutopilotOptions(family=family, rangefinder=0.3)
    limits = {"rangefinder_clearance": 2.0, "takeoff_height": 3.0, "cruise_speed": 1.5}
    least, highest = math.inf, 0.0
    with Stepped(monkeypatch, options, limits=limits) as ends:
        flight = ends.mission([Waypoint("far", 25, 0, 3)])
        for _ in range(900):
            flight.turn()
            if flight.mission.state is MissionState.ENROUTE:
                east, _, up = ends.vehicle.read().odometry.position
                least = min(least, up - 0.3 * max(0.0, east))
                highest = max(highest, up)
    assert 1.5 < least < 2.1
    assert highest > 5.0


def test_without_a_word_of_it_there_is_no_take_off(monkeypatch: pytest.MonkeyPatch) -> None:
    """Who sets a clearance by rangefinder relies on it; who does not needs none."""
    with Stepped(monkeypatch, AutopilotOptions(), limits={"rangefinder_clearance": 1.0}) as ends:
        ends.watch(3.0)
        (objection,) = ends.vehicle.preflight()
        assert objection.startswith("rangefinder: no word from it")
        assert objection in ends.vehicle.read().faults
        assert ends.vehicle.read().below is None
    for seen in (None, 0.0):
        with Stepped(monkeypatch, AutopilotOptions(rangefinder=seen)) as ends:
            ends.watch(3.0)
            assert ends.vehicle.preflight() == []
            assert ends.vehicle.read().below is None
