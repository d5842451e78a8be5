"""A delivery, flown whole in simulation: in the recording, and the same in a replay."""

from __future__ import annotations

from typing import Any

import pytest
from flying import FLAT, Flyer, robot

from aerodaas import AeroNavigation, Environment, Waypoint
from aerodaas.recording.reader import Recording

CARRIED: list[dict[str, Any]] = [
    {"id": "hook", "type": "gripper"},
    {"id": "hatch", "type": "servo", "channel": 9, "positions": {"open": 1900, "closed": 1100}},
    {"id": "chute", "type": "parachute", "may_release": True},
]


def content() -> dict[str, Any]:
    """One drone that carries them, over flat ground."""
    return {**FLAT, "robots": [robot(actuators=CARRIED)]}


def deliver(env: Environment) -> None:
    """Open, release, close elsewhere."""
    stops = [
        Waypoint("drop", 4, 0, 3, actuate={"hatch": "open", "hook": "release"}),
        Waypoint("away", 4, 4, 3, actuate={"hatch": "closed"}),
    ]
    env.get_robot_by_id("drone").navigate(AeroNavigation(data=stops))


def moved(recording: Recording) -> list[dict[str, str]]:
    """What was moved, each change once."""
    found: list[dict[str, str]] = []
    for one in recording.records(schemas=("aerodaas.VehicleState",)):
        state = one.value.actuators
        if state and (not found or found[-1] != state):
            found.append(state)
    return found


@pytest.mark.slow
def test_a_delivery_is_in_its_recording(flyer: Flyer) -> None:
    """Each position from the moment at which it was taken; a replay flies the same."""
    run = flyer.fly(deliver, content(), simulated_time=True)
    assert run.recording is not None
    with Recording.open(run.recording) as recording:
        assert moved(recording) == [
            {"hatch": "open"},
            {"hatch": "open", "hook": "release"},
            {"hatch": "closed", "hook": "release"},
        ]
    again = flyer.fly(deliver, replay=run.recording, record=flyer.folder / "again")
    assert again.recording is not None
    with Recording.open(again.recording) as recording:
        missions = [one.value for one in recording.records(schemas=("aerodaas.MissionStatus",))]
        alerts = [one.value for one in recording.records(schemas=("aerodaas.Alert",))]
    assert missions[-1].visited == ("drop", "away")
    assert [one for one in alerts if one.kind == "actuator"] == []
