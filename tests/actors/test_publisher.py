"""What a loop hands over is published in order, and what had to give way is counted and told."""

from __future__ import annotations

import threading
import time

from hypothesis import given, settings
from hypothesis import strategies as st

from aerodaas.actors.drone.background_publisher import _MOST_WAITING, BackgroundPublisher


@settings(max_examples=20)
@given(st.integers(0, 2 * _MOST_WAITING))
def test_what_is_dropped_is_counted_and_told_once_it_has_caught_up(extra: int) -> None:
    """All that fits is published in order; the loop never waits for it."""
    told: list[int] = []
    done: list[int] = []
    busy, go = threading.Event(), threading.Event()
    publisher = BackgroundPublisher(told.append)
    publisher.start()

    def occupy() -> None:
        busy.set()
        go.wait()

    publisher.do(occupy)
    busy.wait()
    for number in range(_MOST_WAITING + extra):
        publisher.do(lambda number=number: done.append(number))  # type: ignore[misc]
    go.set()
    until = time.monotonic() + 10.0
    while len(done) < _MOST_WAITING and time.monotonic() < until:
        time.sleep(0.001)
    publisher.close()
    assert done == list(range(_MOST_WAITING))
    assert publisher.dropped == extra
    assert told == ([extra] if extra else [])


def test_each_loss_is_told_by_itself_and_one_failure_is_no_others() -> None:
    """Numbers are of what was lost since the last time."""
    told: list[int] = []
    publisher = BackgroundPublisher(told.append)
    publisher.start()
    for lost in (3, 5):
        busy, go = threading.Event(), threading.Event()

        def occupy(busy: threading.Event = busy, go: threading.Event = go) -> None:
            busy.set()
            go.wait()
            raise ValueError("one message")

        publisher.do(occupy)
        busy.wait()
        for _ in range(_MOST_WAITING + lost):
            publisher.do(lambda: None)
        go.set()
        until = time.monotonic() + 10.0
        while (not told or told[-1] != lost) and time.monotonic() < until:
            time.sleep(0.001)
    publisher.close()
    assert told == [3, 5]
    assert publisher.dropped == 8
