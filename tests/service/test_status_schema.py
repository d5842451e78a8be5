"""A robot's status as JSON, there and back."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from filled import filled

from aerodaas.messages.mission import BatteryOutlook, RobotStatus
from aerodaas.protocol.schemas import MissionOut, MissionPhase


def through_json(status: RobotStatus) -> RobotStatus:
    """As a client of a service reads it."""
    words = dict.fromkeys(("id", "name", "tenant", "account"), "own")
    said = MissionOut(
        **words, phase=MissionPhase.FLYING, robots=["r"], submitted=0.0, status={"r": status}
    )
    return MissionOut.model_validate_json(said.model_dump_json()).status["r"]


def test_every_field_comes_across_but_what_is_nobodys_business() -> None:
    """The simulator's truth, further figures, addresses, the list before take-off, latencies."""
    whole = filled(RobotStatus)
    vehicle = whole.vehicle
    assert vehicle is not None
    assert vehicle.truth
    assert vehicle.extra
    assert vehicle.video
    shown = replace(vehicle, truth=None, extra={}, video="")
    assert through_json(whole.public) == RobotStatus(whole.mission, shown)


def test_an_address_is_not_sent_by_mistake() -> None:
    """It may hold a password."""
    heard = through_json(filled(RobotStatus)).vehicle
    assert heard is not None
    assert heard.video == ""


def test_what_is_no_figure_is_not_known_afterwards() -> None:
    """A hover without end needs more charge than a number tells, and JSON has no infinity."""
    whole = filled(RobotStatus)
    endless = replace(whole.mission, outlook=BatteryOutlook(math.inf, 0.3, 10.0))
    outlook = through_json(RobotStatus(endless)).mission.outlook
    assert outlook is not None
    assert math.isnan(outlook.plan)
    assert (outlook.returns_at, outlook.hover) == (0.3, pytest.approx(10.0))
