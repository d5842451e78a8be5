"""Meetings with people: nobody who turns round or comes is touched, and an alert tells."""

from __future__ import annotations

import pytest

from aerodaas.analytics.follow.followers import VipFollowAnalytics
from tools.tuning.chase import TELLO, Chase
from tools.tuning.meetings import CONTACT, STRANGER, Nearest, NoGuard, returning, stranger
from tools.tuning.perception import TruthPerception
from tools.tuning.walk import PERSON


def meet(
    case: str, speed: float, *, rate: float = 10.0, seed: int = 2, guarded: bool = True
) -> tuple[float, list[str]]:
    """Least distance in metres, and the alerts, of one meeting."""
    world, turn = (returning if case == "returns" else stranger)(speed, seed)
    person = world.thing(PERSON)
    others = [world.thing(STRANGER)] if case == "stranger" else []
    near = Nearest([*others, person])
    follow = VipFollowAnalytics()
    if not guarded:
        follow.controller.guard = NoGuard(follow.controller.limits)
    seen = [(one, "person") for one in others] if guarded else []
    eyes = TruthPerception(person, "vest", TELLO, bystanders=seen, seed=seed)
    chase = Chase(person, "vest", rate, 0.25, seed=seed)
    flown = chase.fly(follow, eyes, turn + 6.0 / speed + 3.0, monitor=near)
    return near.least, flown.alerts


@pytest.mark.parametrize("speed", [0.7, 1.0, 1.3, 1.8])
@pytest.mark.parametrize("case", ["returns", "stranger"])
def test_nobody_who_comes_is_touched(case: str, speed: float) -> None:
    """Not nearer than half a metre, and an alert says that the drone gives way."""
    least, alerts = meet(case, speed)
    assert least > 0.5
    assert "person_close" in alerts


@pytest.mark.parametrize("case", ["returns", "stranger"])
def test_without_the_guard_they_are(case: str) -> None:
    """So that the guard is what keeps them apart."""
    assert meet(case, 1.0, guarded=False)[0] < CONTACT


def test_at_five_frames_a_second_too() -> None:
    """Frames come later, and the drone keeps farther behind who walks: no contact."""
    assert meet("returns", 1.0, rate=5.0)[0] > CONTACT
