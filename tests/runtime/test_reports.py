"""Reports of a run: latencies, and figures of several nodes."""

from __future__ import annotations

import gc

from aerodaas.messages.frames import Header
from aerodaas.runtime.node import Latencies, Node, Outlet
from aerodaas.runtime.reports import SentCount, merged_values, sent_counts


def test_the_newest_latencies_are_given_in_their_order() -> None:
    """As many as asked for, or all there are."""
    known = Latencies(kept=10)
    assert known.newest(3) == ()
    for value in (1.0, 2.0, 3.0):
        known.append(value)
    assert known.newest(2) == (2.0, 3.0)
    assert known.newest(9) == (1.0, 2.0, 3.0)
    assert known.newest(0) == ()


def test_latencies_kept_do_not_grow_with_the_flight() -> None:
    """The newest are kept, however many there were."""
    known = Latencies(kept=100)
    for value in range(500):
        known.append(float(value))
    kept = known.newest(1000)
    assert 100 <= len(kept) <= 200
    assert kept == tuple(float(value) for value in range(int(kept[0]), 500))


def test_a_report_is_made_while_messages_are_sent() -> None:
    """Messages that another thread sends meanwhile do not disturb it, whenever they come."""
    outlet = Outlet("drone/alerts")

    def send(*_: object) -> None:
        """Send a message in the middle of whatever allocates memory."""
        outlet.measure(None, Header(outlet.sent, 0, "drone"), 0)

    send()
    thresholds = gc.get_threshold()
    gc.callbacks.append(send)
    gc.set_threshold(1)
    try:
        counts = [sent_counts(outlet, [])["drone/alerts"].count for _ in range(50)]
    finally:
        gc.set_threshold(*thresholds)
        gc.callbacks.remove(send)
    assert counts == sorted(counts)
    assert counts[-1] > counts[0]


def test_figures_of_nodes_with_one_report_are_joined() -> None:
    """Tables and lists of one name; of other figures the last one counts."""

    class Counting(Node):
        def __init__(self, name: str, count: int) -> None:
            super().__init__(name, {})
            self._count = count

        def values(self) -> dict[str, object]:
            return {"busy": {self.name: self._count}, "errors": [self.name], "path": self.name}

    merged = merged_values([Counting("a", 1), Counting("b", 2)])
    assert merged == {"busy": {"a": 1, "b": 2}, "errors": ["a", "b"], "path": "b"}


def test_latencies_of_a_stream_are_told_by_median_and_tail() -> None:
    """None before the first message."""
    assert SentCount.of(0, ()) == SentCount(0, None, None)
    counted = SentCount.of(300, [float(value) for value in range(100, -1, -1)])
    assert (counted.count, counted.median_ms, counted.p99_ms) == (300, 50.0, 99.0)
