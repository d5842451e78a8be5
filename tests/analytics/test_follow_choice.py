"""Whom a follower of vests chooses: who is seen well, or for long, and from high enough."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from follow_world import Snapshot, frame

from aerodaas.analytics.follow.followers import VipFollowAnalytics
from aerodaas.messages.detections import Detection
from aerodaas.messages.odometry import Odometry


def test_a_wall_that_looks_like_a_vest_for_a_moment_is_not_followed() -> None:
    """Unsure, or cut by the picture's edges: what ends a search must be seen well."""
    wall = Detection((0.0, 40.0, 400.0, 720.0), "vest", 0.56)
    unsure = Detection((500.0, 200.0, 600.0, 340.0), "vest", 0.38)
    for box in (wall, unsure):
        follow = VipFollowAnalytics()
        for step in range(10):
            item = frame(step, box)
            assert follow.process(item, Snapshot(item.header.stamp, None, [])) is None


def first_command(follow: VipFollowAnalytics, score: float, since: int = 0) -> int | None:
    """Show a vest of a score at 10 Hz for 6 s; returns the step of the first command."""
    for step in range(since, since + 60):
        item = frame(step, Detection((560.0, 200.0, 720.0, 430.0), "vest", score))
        if follow.process(item, Snapshot(item.header.stamp, None, [])) is not None:
            return step
    return None


@pytest.mark.parametrize(
    ("score", "step"), [(0.5, 4), (0.49, 20), (0.41, 20), (0.4, 20), (0.39, None)]
)
def test_a_vest_that_is_seen_for_long_need_not_be_as_sure(score: float, step: int | None) -> None:
    """As from the side, where an arm hides most of it: 4 of 20 searches had passed one by."""
    assert first_command(VipFollowAnalytics(), score) == step


def test_what_begins_well_and_is_unsure_from_then_on_is_not_followed() -> None:
    """However long it stays in sight: its mean counts."""
    follow = VipFollowAnalytics()
    for step in range(60):
        score = 0.45 if step < 3 else 0.35
        item = frame(step, Detection((560.0, 200.0, 720.0, 430.0), "vest", score))
        assert follow.process(item, Snapshot(item.header.stamp, None, [])) is None


def test_what_was_seen_from_the_ground_is_looked_at_again_from_above() -> None:
    """A passer's shirt was in sight for long; the vest near by is seen from a height only."""
    follow, times = VipFollowAnalytics(), []
    for step in range(80):
        height = 0.0 if step < 40 else 1.5
        where = Odometry(np.array([0.0, 0.0, height]), np.zeros(3), 0.0)
        box = Detection((560.0, 200.0, 720.0, 430.0), "vest", 0.45)
        item = replace(frame(step, box), odometry=where)
        if follow.process(item, Snapshot(item.header.stamp, where, [])) is not None:
            times.append(step)
    assert times[0] == 60


def test_after_a_target_was_given_up_the_next_one_must_be_sure() -> None:
    """Somebody in a bright shirt must not take the place of who is followed."""
    follow = VipFollowAnalytics()
    assert first_command(follow, 0.9) is not None
    step = 60
    while follow.target is not None:
        item = frame(step)
        follow.process(item, Snapshot(item.header.stamp, None, []))
        step += 1
        assert step < 1000
    assert first_command(follow, 0.49, step) is None
    assert first_command(follow, 0.6, step + 60) is not None


@pytest.mark.parametrize(("passer_score", "followed"), [(0.45, "vest"), (0.7, "passer")])
def test_a_doubtful_target_gives_way_to_a_surer_one(passer_score: float, followed: str) -> None:
    """Only one that looks doubtful itself does, and only to one that is not just as doubtful."""
    follow = VipFollowAnalytics()
    passer, vest = (180.0, 200.0, 220.0, 270.0), (560.0, 200.0, 720.0, 430.0)
    command = None
    for step in range(60):
        boxes = [Detection(passer, "vest", 0.6 if step < 10 else passer_score)]
        if step > 20:
            boxes.append(Detection(vest, "vest", 0.8))
        item = frame(step, *boxes)
        command = follow.process(item, Snapshot(item.header.stamp, None, []))
    assert command is not None
    left = command.commands[0].yaw_rate
    assert abs(left) < 0.05 if followed == "vest" else left > 0.2


def test_nobody_is_chosen_before_the_drone_is_up() -> None:
    """From the ground a passer's shirt is in the picture, and the vest near by is above it."""
    follow = VipFollowAnalytics()
    passer, vest = (180.0, 200.0, 220.0, 270.0), (760.0, 200.0, 920.0, 430.0)
    commands = []
    for step in range(60):
        height = min(1.5, max(0.0, 0.05 * (step - 20)))
        boxes = [Detection(passer, "vest", 0.65)]
        if height > 0.7:
            boxes.append(Detection(vest, "vest", 0.9))
        where = Odometry(np.array([0.0, 0.0, height]), np.zeros(3), 0.0)
        item = replace(frame(step, *boxes), odometry=where)
        commands.append(follow.process(item, Snapshot(item.header.stamp, where, [])))
    turns = [one.commands[0].yaw_rate for one in commands if one is not None]
    assert commands[:40] == [None] * 40
    assert len(turns) > 10
    assert max(turns) < 0.0, "to the right, where the vest is"
