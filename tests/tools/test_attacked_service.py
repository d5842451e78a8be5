"""Attacks on a service: its operator is answered within a second under each of them."""

from __future__ import annotations

import pytest

from tools.attacks import ATTACKS, main


@pytest.mark.slow
@pytest.mark.wall_clock
@pytest.mark.timeout(900)
def test_an_operator_is_answered_under_each_attack() -> None:
    """Hold and resume all the while, return and land at the end."""
    main(list(ATTACKS), seconds=8.0)
