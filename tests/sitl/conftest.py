"""Each test flies on both autopilots; what the environment does not name is skipped."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from required import needs_peer, peer

from sitl.autopilot import Autopilot
from sitl.autopilot import autopilot as started

VARIABLES = {"ardupilot": "AERODAAS_SITL_ARDUPILOT", "px4": "AERODAAS_SITL_PX4"}


@pytest.fixture
def boot() -> float:
    """Seconds since it was switched on; a test may want others."""
    return 5.0


@pytest.fixture(
    params=[pytest.param(family, marks=needs_peer(name)) for family, name in VARIABLES.items()]
)
def autopilot(request: pytest.FixtureRequest, boot: float) -> Iterator[Autopilot]:
    """Each autopilot that is named."""
    with started(request.param, peer(VARIABLES[request.param]), boot) as vehicle:
        yield vehicle
