"""Shared by the tests of vehicles' logs."""

from __future__ import annotations

from functools import partial

import pytest
from emulated import Flight, Stepped
from sitl.conftest import autopilot, boot

__all__ = ["autopilot", "boot", "flight"]


@pytest.fixture
def flight(monkeypatch: pytest.MonkeyPatch) -> Flight:
    """Makes flights of an emulated autopilot on a clock that the test moves."""
    return partial(Stepped, monkeypatch)
