"""A simulated drone's rangefinder: what it measures, how far, and with which errors."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aerodaas.config.model import EnvironmentConfig, validated
from aerodaas.drivers.simulated import SimulatedVehicle
from aerodaas.errors import ConfigError
from aerodaas.messages.vehicle import PositionSetpoint, VehicleMode
from aerodaas.simulation.airframe import RangefinderSettings
from aerodaas.simulation.dynamics import KinematicState
from aerodaas.simulation.scenario import Scenario
from aerodaas.simulation.sensors import Floats, SimulatedRangefinder, Surface
from aerodaas.simulation.world import World

SECOND = 1_000_000_000
THINGS: list[dict[str, Any]] = [
    {
        "kind": "building",
        "id": "hall",
        "at": [20, 0],
        "yaw": 90,
        "size": [10, 6, 4],
        "roof": "flat",
    },
    {"kind": "building", "id": "barn", "at": [-20, 0], "yaw": 0, "size": [10, 8, 4]},
    {"kind": "tower", "id": "mast", "at": [0, 30], "yaw": 0, "width": 2, "height": 9},
    {
        "kind": "car",
        "id": "car",
        "yaw": 0,
        "at": [0, -20],
        "motion": {"points": [[0, -20], [40, -20]], "speed": 2},
    },
]
SCENARIO = {"name": "yard", "description": "A yard.", "entities": THINGS}
LIDAR = RangefinderSettings()


def measured(
    east: float,
    north: float,
    up: float,
    *,
    roll: float = 0.0,
    pitch: float = 0.0,
    time: float = 0.0,
    noise: float = 0.0,
    seed: str = "7",
    surface: Surface | None = None,
    settings: RangefinderSettings = LIDAR,
) -> float | None:
    """Metres down from a place."""
    world = World(Scenario.model_validate(SCENARIO), 3)
    finder = SimulatedRangefinder(settings, surface or Surface(world, 0.0), noise, seed)
    motion = KinematicState((east, north, up), (0.0, 0.0, 0.0), roll, pitch, 0.0, 0.0)
    return finder.below(motion, round(time * SECOND))


@pytest.mark.parametrize(
    ("place", "down"),
    [
        ((0, 0, 5.0), 5.0),
        ((20, 0, 10.0), 6.0),  # the hall's roof
        ((20, 4.9, 10.0), 6.0),  # along it, for it is turned
        ((24, 0, 10.0), 10.0),  # beside it
        ((-20, 0, 10.0), 10.0 - 4.0 - 0.35 * 4.0),  # the barn's ridge
        ((-20, 2, 10.0), 10.0 - 4.0 - 0.35 * 2.0),  # its slope
        ((0, 30, 15.0), 6.0),  # the mast
    ],
)
def test_it_measures_down_to_whatever_is_there(
    place: tuple[float, float, float], down: float
) -> None:
    """Ground, level and sloping roofs, towers."""
    assert measured(*place) == pytest.approx(down, abs=0.01)


def test_what_moves_is_below_while_it_is() -> None:
    """A car that drives past."""
    assert measured(10, -20, 5.0, time=0.0) == pytest.approx(5.0, abs=0.01)
    assert measured(10, -20, 5.0, time=5.0) == pytest.approx(5.0 - 1.45, abs=0.01)


@pytest.mark.parametrize(("roll", "pitch"), [(0.4, 0.0), (0.0, -0.4), (0.3, 0.3)])
def test_a_tilt_is_taken_off(roll: float, pitch: float) -> None:
    """The beam is longer, what is told is the height; from 45 degrees on nothing is."""
    assert measured(0, 0, 5.0, roll=roll, pitch=pitch) == pytest.approx(5.0, abs=0.01)
    assert measured(0, 0, 5.0, roll=2 * roll, pitch=2 * pitch) is None


def test_it_looks_along_the_body() -> None:
    """With its nose up it sees what is ahead: the hall's wall, not the ground below."""
    tilt = math.radians(30)
    assert measured(10, 0, 7.0, pitch=-tilt) == pytest.approx(7.0, abs=0.01)
    upright = math.cos(tilt)
    beam = (17.0 - 15.0) / math.sin(tilt)
    assert measured(15, 0, 7.0, pitch=-tilt) == pytest.approx(beam * upright, abs=0.06)


def test_out_of_range_is_not_told() -> None:
    """Too far is nothing; nearer than it can measure is as near as it can."""
    assert measured(0, 0, 11.9) == pytest.approx(11.9, abs=0.01)
    assert measured(0, 0, 12.1) is None
    assert measured(0, 0, 11.9, roll=0.4) is None
    assert measured(0, 0, 0.05) == measured(20, 0, 3.0) == 0.2
    far = RangefinderSettings(min_range=1.0, max_range=50.0)
    assert measured(0, 0, 49.0, settings=far) == pytest.approx(49.0, abs=0.01)


def test_its_errors_are_the_seeds() -> None:
    """Ten a second, of the size that is set; the same however often it is read."""
    read = [measured(0, 0, 5.0, time=step / 10 + 0.01, noise=2.0) for step in range(400)]
    errors = np.array([one for one in read if one is not None]) - 5.0
    assert len(errors) == 400
    assert errors.std() == pytest.approx(0.04, rel=0.15)
    assert abs(errors.mean()) < 0.01
    assert measured(0, 0, 5.0, time=0.09, noise=2.0) == read[0]
    assert measured(0, 0, 5.0, time=0.11, noise=2.0) == read[1] != read[0]
    assert measured(0, 0, 5.0, time=0.01, noise=2.0, seed="8") != read[0]


def test_ground_that_rises_lifts_what_stands_on_it() -> None:
    """The drone stands at 3 m; unknown ground is nothing."""

    def slope(east: Floats, north: Floats) -> Floats:
        return np.where(north > 50.0, np.nan, 3.0 + 0.1 * east)

    world = World(Scenario.model_validate(SCENARIO), 3)
    hill = Surface(world, 3.0, slope)
    assert measured(0, 0, 10.0, surface=hill) == pytest.approx(7.0, abs=0.01)
    assert measured(10, 0, 10.0, surface=hill) == pytest.approx(6.0, abs=0.01)
    assert measured(20, 0, 10.0, surface=hill) == pytest.approx(10.0 - 4.0 - 2.0, abs=0.01)
    assert measured(0, 60, 10.0, surface=hill) is None


def environment(tmp_path: Path, **robot: Any) -> EnvironmentConfig:  # noqa: ANN401
    """One drone in the yard."""
    (tmp_path / "yard.json").write_text(json.dumps(SCENARIO))
    world = {"world": str(tmp_path / "yard.json"), "sensor_noise": 0.0}
    one = {"id": "drone", **robot}
    return validated({"robots": [one], "simulation": world}, "file")


def vehicle_of(config: EnvironmentConfig) -> SimulatedVehicle:
    """Its vehicle, connected."""
    vehicle = SimulatedVehicle(config.robots[0], config)
    vehicle.connect()
    return vehicle


LIMITS = {"rangefinder_clearance": 1.0, "takeoff_height": 3.0}


def test_the_drone_tells_it_where_its_limits_need_one(tmp_path: Path) -> None:
    """As on MAVLink, a drone without such a limit tells nothing."""
    assert vehicle_of(environment(tmp_path)).read().below is None
    vehicle = vehicle_of(environment(tmp_path, limits=LIMITS))
    assert vehicle.read().below == 0.2
    vehicle.take_off(3.0)
    for step in range(1, 200):
        vehicle.advance_to(step * SECOND // 10)
        if vehicle.read().mode is VehicleMode.HOLDING:
            break
    state = vehicle.read()
    assert state.truth is not None
    assert state.below == pytest.approx(state.truth.height, abs=0.02)


def test_the_drone_measures_its_terrain(tmp_path: Path) -> None:
    """Which rises to the east by 10 m in 100 m, from where it stands."""
    longitudes = np.tile(np.arange(1201) / 1200, (1201, 1))
    east = (longitudes - 0.1) * 111_320.0 * math.cos(math.radians(47.1))
    (tmp_path / "N47E008.hgt").write_bytes((540 + 0.1 * east).round().astype(">i2").tobytes())
    config = environment(tmp_path, limits={**LIMITS, "takeoff_height": 8.0})
    places = {
        "home": {"latitude": 47.1, "longitude": 8.1, "altitude": 590.0},
        "terrain": {"files": [str(tmp_path / "N47E008.hgt")]},
    }
    vehicle = vehicle_of(validated(config.model_dump(by_alias=True) | places, "file"))
    vehicle.take_off(8.0)
    vehicle.advance_to(15 * SECOND)
    vehicle.send(PositionSetpoint(np.array([40.0, 0.0, 8.0]), speed=5.0))
    vehicle.advance_to(45 * SECOND)
    state = vehicle.read()
    assert state.truth is not None
    assert state.truth.position[0] == pytest.approx(40.0, abs=0.5)
    assert state.below == pytest.approx(8.0 - 4.0, abs=0.7)


def test_without_one_there_is_no_take_off(tmp_path: Path) -> None:
    """Who sets a clearance by rangefinder relies on it; who does not needs none."""
    none = {"settings": {"rangefinder": None}}
    (objection,) = vehicle_of(environment(tmp_path, limits=LIMITS, **none)).preflight()
    assert objection.startswith("no rangefinder (settings.rangefinder is null)")
    assert vehicle_of(environment(tmp_path, **none)).preflight() == []
    assert vehicle_of(environment(tmp_path, limits=LIMITS)).preflight() == []


def test_a_range_that_is_none_is_refused(tmp_path: Path) -> None:
    """With the two numbers."""
    bad = {"settings": {"rangefinder": {"min_range": 5, "max_range": 2}}}
    with pytest.raises(ConfigError, match=r"min_range \(5 m\) must be below max_range \(2 m\)"):
        vehicle_of(environment(tmp_path, **bad))
