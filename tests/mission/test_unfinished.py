"""A mission tells whether its plan was flown, and if not, why."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from flights import Flight, KinematicVehicle, add, flight, live, square

from aerodaas.config.model import LimitsConfig, MissionConfig
from aerodaas.messages.mission import MissionState as S
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.commands import Command, End, ReturnHome

FAR = Waypoint("far", 40, 0, 1.5)


def _climbs_too_slowly() -> Flight:
    limits = LimitsConfig(takeoff_height=9.0, takeoff_timeout=3.0)
    return flight(live(), limits=limits)


def _loses_its_link() -> Flight:
    lost = flight(add(*square()))
    lost.run(10.0)
    lost.vehicle.lost = True
    lost.run_to(S.RETURNING)
    lost.vehicle.lost = False
    return lost


def _meets_the_wind() -> Flight:
    options = MissionConfig(stall_timeout=5.0, on_complete="land")
    return flight(add(FAR), vehicle=KinematicVehicle(wind=(-1.0, 0.0, 0.0)), options=options)


@pytest.mark.parametrize(
    ("begin", "word"),
    [
        (_climbs_too_slowly, "take-off"),
        (_loses_its_link, "3 waypoints left"),
        (lambda: flight(add(FAR), vehicle=KinematicVehicle(drain=0.02)), "battery"),
        (_meets_the_wind, "cannot be reached"),
    ],
    ids=["take-off", "link", "battery", "wind"],
)
def test_what_kept_a_plan_from_being_flown_is_told(begin: Callable[[], Flight], word: str) -> None:
    """Also after the landing, however safely it came down."""
    flown = begin()
    flown.run()
    flown.expect(S.LANDED)
    assert word in flown.status.unfinished


def test_a_flown_plan_is_finished() -> None:
    """With nothing left, nothing is to be told."""
    flown = flight(add(*square()))
    flown.run()
    flown.expect(S.LANDED)
    assert flown.status.unfinished == ""


@pytest.mark.parametrize("command", [End(), ReturnHome()])
def test_a_mission_that_somebody_ends_is_finished(command: Command) -> None:
    """Who ends it knows that waypoints are left."""
    ended = flight(add(*square()))
    ended.run(10.0)
    ended.tell(command)
    ended.run()
    ended.expect(S.LANDED)
    assert ended.status.unfinished == ""


@pytest.mark.parametrize("command", [End(), ReturnHome()])
def test_a_command_after_a_failsafe_finishes_nothing(command: Command) -> None:
    """The battery had ended the mission before."""
    low = flight(add(FAR), vehicle=KinematicVehicle(drain=0.02))
    low.run_to(S.RETURNING)
    low.tell(command)
    low.run()
    assert "battery" in low.status.unfinished
