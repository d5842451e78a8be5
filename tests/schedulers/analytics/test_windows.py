"""Windows of quality of experience: which tasks count, and when the bonus is won."""

from __future__ import annotations

import pytest

from aerodaas.schedulers.analytics.base import Profile, QoeGoal, Task
from aerodaas.schedulers.analytics.windows import QoeWindows


def profile(model: str, goal: QoeGoal | None) -> Profile:
    """A model of which only the goal matters here."""
    return Profile(model, 10.0, 100, 10, 20, qoe=goal)


def counted(tasks: list[tuple[Profile, int, bool]]) -> QoeWindows:
    """Windows that have seen tasks by profile, arrival and whether they were in time."""
    windows = QoeWindows()
    for number, (kind, at, in_time) in enumerate(tasks):
        task = Task(number, kind, at, at + kind.deadline)
        windows.arrived(task)
        if in_time:
            windows.done(task)
    return windows


def test_a_window_belongs_to_arrivals_and_is_won_at_its_share() -> None:
    """One of two in time at 0 to 999 is a half, and enough; one of three at 1000 to 1999 is not."""
    m = profile("m", QoeGoal(5.0, 0.5, 1000))
    first = [(m, 0, False), (m, 999, True)]
    second = [(m, 1000, True), (m, 1500, False), (m, 1999, False)]
    windows = counted([*first, *second])
    assert windows.won == {"m": (1, 2)}
    assert windows.utility == 5.0
    assert counted(second).won == {"m": (0, 1)}
    assert counted(second).utility == 0


@pytest.mark.parametrize(("in_time", "won"), [(8, 0), (9, 1), (10, 1)])
def test_nine_of_ten_are_needed(in_time: int, won: int) -> None:
    """At a share of 0.9, each task counted once."""
    m = profile("m", QoeGoal(7.0, 0.9, 1000))
    windows = counted([(m, number, number < in_time) for number in range(10)])
    assert windows.won == {"m": (won, 1)}
    assert windows.utility == 7.0 * won


def test_each_model_has_windows_of_its_own() -> None:
    """A model without a goal has none."""
    wins = profile("wins", QoeGoal(3.0, 1.0, 100))
    loses = profile("loses", QoeGoal(50.0, 1.0, 100))
    plain = profile("plain", None)
    windows = counted([(wins, 5, True), (loses, 5, False), (plain, 5, True), (wins, 205, True)])
    assert windows.won == {"wins": (2, 2), "loses": (0, 1)}
    assert windows.utility == 6.0
