"""The terrain of an environment file, and what is told of heights before anything flies."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flying import FLAT, robot

from aerodaas import AeroNavigation, Waypoint
from aerodaas.config.model import EnvironmentConfig, validated
from aerodaas.config.overrides import located
from aerodaas.environment.fleet import shared_waypoints
from aerodaas.errors import ConfigError, InvalidWaypointError
from aerodaas.mission.commands import AddNavigation
from aerodaas.mission.rehearsal import rehearse
from aerodaas.schedulers.trajectory.ordered import OrderedScheduler

HOME = {"latitude": 47.5, "longitude": 8.5, "altitude": 590.0}
HIGH: dict[str, Any] = {"limits": {"takeoff_height": 10.0}}


@pytest.fixture(scope="module")
def plain_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A tile that is flat, 540 m above the sea."""
    path = tmp_path_factory.mktemp("terrain") / "N47E008.hgt"
    path.write_bytes(np.full((1201, 1201), 540, dtype=">i2").tobytes())
    return path


def _environment(terrain: Path | str | None, **words: Any) -> EnvironmentConfig:  # noqa: ANN401
    named = {} if terrain is None else {"terrain": {"files": [str(terrain)]}}
    content = {**FLAT, "home": HOME, "robots": [robot(**HIGH)], **named, **words}
    return validated(content, "file")


def _rehearsed(environment: EnvironmentConfig, *waypoints: Waypoint) -> None:
    command = AddNavigation(AeroNavigation(data=waypoints))
    rehearse(environment.robots[0], [command], environment, OrderedScheduler())


def test_a_terrain_needs_a_home() -> None:
    """It would lie nowhere."""
    with pytest.raises(ConfigError, match="give a home with latitude and longitude"):
        _environment("N47E008.hgt", home=None)


def test_a_take_off_ends_above_the_clearance() -> None:
    """Else the drone would begin its flight too near to the ground."""
    with pytest.raises(ConfigError, match=r"must be at least terrain.clearance"):
        _environment("N47E008.hgt", robots=[robot(limits={"takeoff_height": 4.9})])
    _environment("N47E008.hgt", robots=[robot(limits={"takeoff_height": 5.0})])


def test_terrain_files_lie_beside_the_environment_file(plain_file: Path) -> None:
    """Actors have other working directories."""
    found = located(_environment("N47E008.hgt"), plain_file.parent)
    assert found.terrain is not None
    assert found.terrain.files == [str(plain_file)]


@pytest.mark.parametrize(
    ("waypoint", "why"),
    [
        (Waypoint("a", 9, 0, 560, above="sea"), "give home.above_sea"),
        (Waypoint("a", 9, 0, 3, above="ground"), "3.0 m above the ground is less than"),
        (Waypoint("a", 9, 0, 2), "2.0 m above the ground is less than terrain.clearance 5 m"),
    ],
)
def test_heights_that_cannot_be_flown_are_told_before_anything_starts(
    plain_file: Path, waypoint: Waypoint, why: str
) -> None:
    """With waypoint, reason and remedy."""
    with pytest.raises(InvalidWaypointError, match=why):
        _rehearsed(_environment(plain_file), waypoint)


def test_a_height_above_ground_needs_a_terrain() -> None:
    """None is guessed to be flat."""
    with pytest.raises(InvalidWaypointError, match="the environment file names no terrain"):
        _rehearsed(_environment(None), Waypoint("a", 9, 0, 30, above="ground"))


def test_heights_that_can_be_flown_are_not_refused(plain_file: Path) -> None:
    """Each by its own reference."""
    environment = _environment(plain_file, home={**HOME, "above_sea": 541.0})
    _rehearsed(
        environment,
        Waypoint("a", 9, 0, 12),
        Waypoint("b", 9, 0, 560, above="sea"),
        Waypoint("c", 9, 0, 12, above="ground"),
    )


def test_what_only_the_vehicle_or_its_node_knows_is_left_to_them() -> None:
    """A real vehicle tells how high it stands; a file may lie on the edge node alone."""
    real = robot(driver="mavlink", settings={"url": "udpin:127.0.0.1:14999"}, **HIGH)
    environment = _environment("/nowhere/N47E008.hgt", robots=[real])
    _rehearsed(
        environment,
        Waypoint("a", 9, 0, 560, above="sea", waypoint_type="local"),
        Waypoint("b", 9, 0, 12, above="ground", waypoint_type="local"),
    )
    with pytest.raises(InvalidWaypointError, match="beyond the range"):
        _rehearsed(
            environment,
            Waypoint("a", 9, 0, 560, above="sea", waypoint_type="local"),
            Waypoint("c", 9, 5000, 12, waypoint_type="local"),
        )


def test_a_contradiction_between_terrain_and_home_is_told(plain_file: Path) -> None:
    """The geoid lies 48 m above the ellipsoid there."""
    environment = _environment(plain_file, home={**HOME, "above_sea": 590.0})
    with pytest.raises(ConfigError, match="one is wrong, or above the ellipsoid"):
        _rehearsed(environment, Waypoint("a", 9, 0, 12))


def test_shared_out_waypoints_keep_what_they_are_counted_from() -> None:
    """Their missions resolve them."""
    pytest.importorskip("pyvrp")
    places = [
        Waypoint("a", 9, 0, 12, waypoint_type="local", above="ground"),
        Waypoint("b", 0, 9, 12, waypoint_type="local"),
    ]
    (tour,) = shared_waypoints(_environment(None), places, "energy", 0.2).values()
    assert sorted(tour, key=lambda one: one.id) == places
    above_sea = Waypoint("c", 0, 9, 560, waypoint_type="local", above="sea")
    with pytest.raises(InvalidWaypointError, match=r"give home.above_sea"):
        shared_waypoints(_environment(None), [above_sea], "energy", 0.2)
