"""Each test flies on both autopilots; what the environment does not name is skipped."""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest

from sitl.autopilot import Autopilot
from sitl.autopilot import autopilot as started

VARIABLES = {"px4": "AERODAAS_SITL_PX4", "ardupilot": "AERODAAS_SITL_ARDUPILOT"}


@pytest.fixture
def boot() -> float:
    """Seconds since it was switched on; a test may want others."""
    return 5.0


@pytest.fixture(params=sorted(VARIABLES))
def autopilot(request: pytest.FixtureRequest, boot: float) -> Iterator[Autopilot]:
    """Each autopilot that is named."""
    variable = VARIABLES[request.param]
    named = os.environ.get(variable, "")
    if not named:
        pytest.skip(
            f"{variable} names no autopilot in simulation; set it to a URL such "
            "as udpin:0.0.0.0:14540, or to `start command => URL`"
        )
    with started(request.param, named, boot) as vehicle:
        yield vehicle
