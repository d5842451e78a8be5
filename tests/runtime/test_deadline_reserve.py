"""What the way to an executor takes is measured and held in reserve."""

from __future__ import annotations

from aerodaas.messages.envelope import Message, TraceSpan
from aerodaas.messages.frames import Header
from aerodaas.runtime.dispatch.costs import DeadlineReserve
from aerodaas.schedulers.analytics.base import MILLISECOND

_FAR = 10_000 * MILLISECOND


def _answer(work_ms: int) -> Message[object]:
    spans = (TraceSpan("camera", 0, 1), TraceSpan("model/done", 5, 5 + work_ms * MILLISECOND))
    return Message("model/done", 0, 0, Header(0, 0, "camera"), 0, spans, None)


def test_the_reserve_follows_the_way_and_not_the_work() -> None:
    """Work of 100 ms, whose way takes 1 to 40 ms: the 95th percentile is 38."""
    way = DeadlineReserve()
    assert way.reserve(_FAR) == 5 * MILLISECOND
    for extra in range(1, 41):
        way.travelled(_answer(100), (100 + extra) * MILLISECOND)
    assert way.reserve(_FAR) == 38 * MILLISECOND


def test_late_timers_count_on_top() -> None:
    """All 3 ms late, an execution's way taking 10."""
    way = DeadlineReserve()
    for _ in range(40):
        way.delayed(3 * MILLISECOND)
        way.travelled(_answer(50), 60 * MILLISECOND)
    assert way.reserve(_FAR) == 13 * MILLISECOND


def test_a_near_deadline_keeps_most_of_its_time() -> None:
    """At most a tenth of it is held in reserve."""
    way = DeadlineReserve()
    for _ in range(40):
        way.travelled(_answer(50), 250 * MILLISECOND)
    assert way.reserve(100 * MILLISECOND) == 10 * MILLISECOND
