"""The five mission patterns of the paper, flown by the setpoint loop."""

from __future__ import annotations

import numpy as np
import pytest
from flights import add, flight, length, live, navigation, square

from aerodaas.config.model import LimitsConfig, MissionConfig
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.messages.mission import MissionState as S
from aerodaas.messages.waypoints import NavigationType, VelocityCommand, Waypoint
from aerodaas.mission.commands import ClearNavigation, Command, StreamItem
from aerodaas.schedulers.trajectory.nearest_neighbor import NearestNeighborScheduler

FARM = LimitsConfig(cruise_speed=0.5)


def velocity(priority: int = 1, forward: float = 0.0, left: float = 0.0) -> StreamItem:
    """One velocity command by stream."""
    item = VelocityCommand(forward, left, priority=priority)
    return StreamItem("drone/follow", AeroNavigation(NavigationType.ANALYTICS_DRIVEN, [item]))


def test_static_waypoints_farm_survey() -> None:
    """(a) Four corners with 5 s of hover each, back to the start, landed, in about two minutes."""
    farm = flight(add(*square(hover=5.0)), limits=FARM)
    farm.run()
    farm.expect(S.LANDED)
    assert farm.status.visited == ("wp1", "wp2", "wp3", "wp4")
    assert farm.states == [
        S.TAKING_OFF,
        S.LOITERING,
        *[S.ENROUTE, S.LOITERING] * 3,
        S.RETURNING,
        S.LANDING,
        S.LANDED,
    ]
    assert np.linalg.norm(farm.vehicle.position) < 0.5
    assert 38.0 < length(farm.track) < 45.0
    assert farm.status.distance == pytest.approx(length(farm.track), rel=0.05)
    assert 90.0 < farm.seconds < 130.0
    speeds = np.diff(np.array(farm.track)[:, :2], axis=0) / 0.05
    assert np.linalg.norm(speeds, axis=1).max() < 0.55


def test_dynamic_waypoints_are_woven_in() -> None:
    """(b) Waypoints that a remote user adds in flight are visited, the nearest first."""
    survey = flight(add(*square(), ordered=False), scheduler=NearestNeighborScheduler())
    survey.run(until=lambda: "wp2" in survey.status.visited)
    assert survey.tell(
        add(Waypoint("near", 10, 3, 1.5), Waypoint("far", 0, 20, 1.5), ordered=False)
    )
    survey.run()
    survey.expect(S.LANDED)
    assert survey.status.visited == ("wp1", "wp2", "near", "wp3", "wp4", "far")


def test_sensor_driven_from_nothing() -> None:
    """(c) Velocity commands alone fly the drone; when they stop it holds, then returns."""
    limits = LimitsConfig(silence_return=5.0)
    follow = flight(live(), limits=limits)
    follow.run_to(S.HOLDING)
    follow.keep_saying(lambda: velocity(forward=1.0), 8.0, rate=5)
    follow.expect(S.FOLLOWING)
    assert follow.vehicle.position[0] > 5.0
    follow.run(1.0)
    follow.expect(S.HOLDING)
    stood = follow.vehicle.position.copy()
    follow.run(3.0)
    assert np.linalg.norm(follow.vehicle.position - stood) < 0.5
    follow.run_to(S.RETURNING)
    assert "silent" in follow.status.reason
    follow.run()
    follow.expect(S.LANDED)
    assert np.linalg.norm(follow.vehicle.position) < 0.5


def test_urgent_commands_preempt_and_the_plan_resumes() -> None:
    """(d) The interrupted waypoint and its remaining hover are served after the event."""
    options = MissionConfig(resume_after=2.0)
    plan = [Waypoint("a", 5, 0, 1.5, 4.0, priority=2), Waypoint("b", 10, 0, 1.5, priority=2)]
    track = flight(live(), add(*plan), options=options, limits=LimitsConfig(silence_return=2.0))
    track.run_to(S.LOITERING)
    track.run(2.0)
    track.keep_saying(lambda: velocity(left=1.0), 5.0, rate=10)
    track.expect(S.DIVERTED)
    assert track.vehicle.position[1] > 3.0
    assert not track.status.visited
    track.run_to(S.ENROUTE)
    assert track.status.reason == "flying to a"
    track.run_to(S.LOITERING)
    began = track.seconds
    track.run(until=lambda: "a" in track.status.visited)
    assert track.seconds - began == pytest.approx(2.0, abs=0.2)
    track.run()
    track.expect(S.LANDED)
    assert track.status.visited == ("a", "b")


def test_urgent_waypoints_preempt_and_the_plan_resumes() -> None:
    """(d) The same with waypoints: DIVERTED while they last, then the old target."""
    survey = flight(add(Waypoint("a", 8, 0, 1.5, priority=2), Waypoint("b", 8, 8, 1.5, priority=2)))
    survey.run_to(S.ENROUTE)
    survey.run(3.0)
    survey.tell(add(Waypoint("event", 0, 6, 1.5, 1.0, priority=1)))
    survey.turn()
    survey.expect(S.DIVERTED)
    assert survey.status.target is not None
    assert survey.status.target.id == "event"
    survey.run()
    assert survey.status.visited == ("event", "a", "b")


@pytest.mark.parametrize("way", ["stream", "clear_first", "clear"])
def test_abort_forgets_the_plan(way: str) -> None:
    """(e) After the queue was cleared, no waypoint of the old plan is ever visited."""
    rescue = flight(live(clear_first=way == "stream"), add(*square()[1:]))
    rescue.run(until=lambda: "wp2" in rescue.status.visited)
    urgent: Command
    if way == "stream":
        target = navigation([Waypoint("person", 3, 3, 1.5)])
        urgent = StreamItem("drone/follow", target)
    else:
        urgent = add(Waypoint("person", 3, 3, 1.5), clear_first=way == "clear_first")
        if way == "clear":
            rescue.tell(ClearNavigation())
    assert rescue.tell(urgent).accepted
    rescue.run()
    rescue.expect(S.LANDED)
    assert rescue.status.visited == ("wp2", "person")
