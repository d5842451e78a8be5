"""A mission's status as JSON, there and back."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from filled import filled
from hypothesis import given
from hypothesis import strategies as st

from aerodaas.messages.mission import BatteryOutlook, MissionState, MissionStatus
from aerodaas.messages.odometry import Battery, GpsFix, Odometry
from aerodaas.messages.vehicle import VehicleMode, VehicleState
from aerodaas.protocol.schemas import StatusOut

SHARES = st.floats(0, 1)


def status(outlook: BatteryOutlook | None) -> MissionStatus:
    """Of a drone on its way."""
    return MissionStatus(10**9, MissionState.ENROUTE, "on its way", outlook=outlook)


@given(SHARES, SHARES, st.floats(0, 1e6))
def test_how_far_the_battery_lasts_comes_across(plan: float, at: float, hover: float) -> None:
    """As it was said, through JSON."""
    said = StatusOut.of(status(BatteryOutlook(plan, at, hover)), None)
    heard = StatusOut.model_validate_json(said.model_dump_json()).outlook
    assert heard == BatteryOutlook(plan, at, hover)


@pytest.mark.parametrize("outlook", [None, BatteryOutlook(math.inf, 0.3, 10.0)])
def test_what_is_no_figure_is_null(outlook: BatteryOutlook | None) -> None:
    """A hover without end needs more charge than a number tells, and JSON has no infinity."""
    assert '"outlook":null' in StatusOut.of(status(outlook), None).model_dump_json()


@pytest.mark.parametrize(
    ("fix", "said"),
    [
        (GpsFix(50.0, 8.0, 120.0, horizontal_sigma=1.5, satellites=9), (1.5, 9)),
        (GpsFix(50.0, 8.0, 120.0), (None, None)),
        (None, (None, None)),
    ],
)
def test_a_driver_that_does_not_know_says_so(
    fix: GpsFix | None, said: tuple[float | None, int | None]
) -> None:
    """Zero satellites and no error at all are what a driver leaves out, not what it measured."""
    odometry = Odometry(np.array([0.0, 0.0, 1.0]), np.zeros(3), 0.0)
    state = VehicleState(1, odometry, Battery(0.5), VehicleMode.GUIDED, armed=True, gps=fix)
    told = StatusOut.of(status(None), state)
    assert (told.position_sigma, told.satellites) == said


UNTOLD = {
    # Each visit is in what was visited, alerts tell of pictures that were not taken, and reason and
    # given_up of what is left undone.
    MissionStatus: {"visits", "photos", "unfinished"},
    # Complaints are in the mission's faults; of the rest, what people need comes as alerts and
    # answers. The simulator's truth, further figures and addresses are nobody's business.
    VehicleState: {
        *("armed", "faults", "ended", "gimbal", "zoom", "below", "actuators"),
        *("truth", "extra", "video"),
    },
}
"""Fields that a status does not tell, on purpose."""


@pytest.mark.parametrize("kind", [MissionStatus, VehicleState])
def test_each_field_is_told_or_is_named_here(kind: Any) -> None:  # noqa: ANN401 - a dataclass
    """One that is there makes the status another one."""
    whole = {one: filled(one) for one in (MissionStatus, VehicleState)}
    told = StatusOut.of(whole[MissionStatus], whole[VehicleState])
    for field in dataclasses.fields(kind):
        default: Any = field.default
        if field.default_factory is not dataclasses.MISSING:
            default = field.default_factory()
        if default is dataclasses.MISSING:
            continue
        less = {**whole, kind: dataclasses.replace(whole[kind], **{field.name: default})}
        same = StatusOut.of(less[MissionStatus], less[VehicleState]) == told
        assert same == (field.name in UNTOLD[kind]), field.name
