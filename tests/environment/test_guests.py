"""Guests: applications of others, which have what the owner grants and no way to the rest."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest
from flying import FLAT, Flyer, hop, recorded

from aerodaas import Environment
from aerodaas.config.grants import parse_words
from aerodaas.environment.guests import admit_guests
from aerodaas.recording.reader import Recording
from aerodaas.types.errors import ConfigError

HEAD = """
import os, sys, time
from aerodaas import AeroListData, AeroNavigation, Analytics, Environment, Odometry, Waypoint
from aerodaas.analytics import NavigableAnalytics, RemoteAnalytics
from aerodaas.types.data import Readings

env = Environment("environment.json")
drone = env.get_robot_by_id("drone")
"""
GUEST = (
    HEAD
    + '''
class HighWater(Analytics[Readings]):
    """The greatest height so far; a class of the guest's own file."""

    accepts = (Odometry,)
    highest = 0.0

    def process(self, item, context):
        self.highest = max(self.highest, item.height)
        return Readings(context.now(), {"highest": self.highest})

edge = env.get_compute_resource_by_id("edge")
odometry = drone.get_sensor_by_id("odom_drone").get_data_stream()
watch = HighWater().deploy(edge)
watch.analyse(odometry)
'''
)
READY = "drone.start_mission()\n"
RIGHTS = ("sense:odom_drone", "compute:edge")
CONTENT = {**FLAT, "schedulers": {"trajectory": "ordered"}}


@pytest.fixture
def guest(tmp_path: Path) -> Path:
    """Where a guest's file goes: nothing of the owner's is there."""
    (tmp_path / "elsewhere").mkdir()
    return tmp_path / "elsewhere" / "theirs.py"


def owner(env: Environment) -> None:
    """Two waypoints."""
    env.get_robot_by_id("drone").navigate(hop((6, 0), (6, 6)))


def admitted(flyer: Flyer, guest: Path, text: str, *rights: str) -> tuple[Environment, list[str]]:
    """An owner's environment with this guest, and why the guest was left out."""
    guest.write_text(text)
    with flyer.options(guests=(guest,), grants={"theirs": rights}):
        env = Environment(flyer.write(CONTENT))
        owner(env)
        from aerodaas.config.options import current_options

        return env, admit_guests(current_options.get(), env)


def refusal(flyer: Flyer, guest: Path, text: str, *rights: str) -> str:
    """Why a guest was left out; the owner's graph is as it was."""
    env, refused = admitted(flyer, guest, text, *rights)
    assert len(refused) == 1
    assert refused[0].startswith("the guest theirs does not take part: ")
    assert not [node for node in env.graph.nodes.values() if node.kind != "sensor"]
    assert len(env.graph.navigation) == 1
    return refused[0]


@pytest.mark.parametrize(
    ("text", "rights", "said"),
    [
        ("drone.navigate(AeroNavigation(data=[Waypoint('m', 1, 1, 2)]))", (), "fly:drone.*navigate"),
        (
            "env.trajectory_scheduler().add_navigation(AeroListData([Waypoint('m', 1, 0, 2)]))",
            (),
            "fly:drone.*theirs.py:.*add_navigation",
        ),
        ("drone.get_sensor_by_id('odom_drone')", (), "odom_drone.*theirs.py:.*get_sensor_by_id"),
        ("env.get_compute_resource_by_id('edge')", ("sense",), "no compute resource"),
        ("sys.exit(3)", (), r"sys.exit\(3\)"),
        ("os._exit(3)", (), "ended, with code 3"),
        ("raise RuntimeError('boo')", (), "RuntimeError: boo at theirs.py"),
        ("x = bytearray(1 << 30)", ("memory:400",), "MemoryError"),
        ("this is no python", (), "SyntaxError"),
        ("", (), "never called start_mission"),
    ],
)
def test_a_guest_that_cannot_take_part_is_left_out(
    flyer: Flyer, guest: Path, text: str, rights: tuple[str, ...], said: str
) -> None:
    """By name, with its line; the owner's process and graph are as they were."""
    ready = READY if text else ""
    if text.startswith("this"):
        ready = ""
    found = refusal(flyer, guest, HEAD + text + "\n" + ready, *rights)
    import re

    assert re.search(f"(?s){said}", found), found
