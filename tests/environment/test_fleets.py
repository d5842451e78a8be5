"""A fleet: waypoints shared out over all robots, and one start, end and wait for all."""

from __future__ import annotations

import time
from functools import partial

import pytest
from flying import FLAT, Flyer, hop, recorded, robot
from required import needs_python

from aerodaas import AeroNavigation, Environment, Waypoint
from aerodaas.errors import InvalidWaypointError
from aerodaas.messages.mission import MissionState

_TWO = {**FLAT, "robots": [robot("west", start=[-20, 0, 0]), robot("east", start=[20, 0, 0])]}


def _environment(flyer: Flyer) -> Environment:
    return Environment(flyer.write(_TWO))


@needs_python(3, 11, because="PyVRP has no older")
def test_each_robot_gets_what_lies_near_it(flyer: Flyer) -> None:
    """Every waypoint goes to one robot, here to the nearer one, in local coordinates."""
    places = [(x, y) for x in (-25, -15, 15, 25) for y in (5, 10)]
    waypoints = [Waypoint(f"{x},{y}", x, y, 3, waypoint_type="local") for x, y in places]
    shares = _environment(flyer).share_out(waypoints, objective="time", budget=0.4)
    assert list(shares) == ["west", "east"]
    assert sorted(one.id for share in shares.values() for one in share) == sorted(
        one.id for one in waypoints
    )
    assert all(one.x < 0 for one in shares["west"])
    assert all(one.x > 0 for one in shares["east"])
    assert _environment(flyer).share_out([]) == {"west": [], "east": []}


def test_relative_waypoints_cannot_be_shared_out(flyer: Flyer) -> None:
    """It is not known yet which robot they would be relative to."""
    with pytest.raises(InvalidWaypointError, match="'a' is relative to a robot"):
        _environment(flyer).share_out([Waypoint("a", 1, 2, 3)])


def test_the_environment_starts_and_ends_all_missions(flyer: Flyer) -> None:
    """Hooks of all robots run once each; the end lands all of them."""
    called: list[str] = []
    with flyer.options():
        env = _environment(flyer)
        for name in ("west", "east"):
            drone = env.get_robot_by_id(name)
            drone.navigate(AeroNavigation(data=list(hop((3, 0), hover=900))))
            drone.on_start(partial(called.append, f"{name} starts"))
            drone.on_end(partial(called.append, f"{name} ends"))
        env.start_mission(lambda: called.append("all start"), wait=False)
        run, end = env.launch(), time.monotonic() + 60
        while {one.mission.state for one in run.poll().robots.values()} != {MissionState.LOITERING}:
            assert time.monotonic() < end
        env.end_mission()
        env.wait()
        flight = recorded(env.launch())
    assert called[:3] == ["west starts", "east starts", "all start"]
    assert sorted(called[3:]) == ["east ends", "west ends"]
    assert {name: one.bands[-1].state for name, one in flight.robots.items()} == {
        "west": "landed",
        "east": "landed",
    }
