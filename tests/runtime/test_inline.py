"""The inline executor: order of steps, delivery of messages, failures and the end."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import pytest
from hosts import item_of
from hypothesis import given
from hypothesis import strategies as st

from aerodaas.clock import NANOSECONDS, Clock
from aerodaas.errors import AeroDaaSError, SourceError
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Header
from aerodaas.runtime.inline import InlineExecutor, Tap
from aerodaas.runtime.node import NEVER, Node
from aerodaas.runtime.session import next_due
from aerodaas.runtime.stream_names import alert_stream

Steps = list[tuple[str, int, list[Any]]]
"""Node, mission time and items of each step of a flight."""


class Recorder(Node):
    """Logs its steps, and publishes what `react` makes of them on a stream of its name."""

    def __init__(
        self,
        name: str,
        *reads: str,
        log: Steps | None = None,
        period: int | None = None,
        react: Callable[[int, list[Any]], Sequence[Any]] = lambda _, __: (),
    ) -> None:
        super().__init__(name, dict.fromkeys(reads, 8))
        self.log: Steps = [] if log is None else log
        self.period = period
        self.react = react
        self.received: list[Message[Any]] = []
        self.closed = 0
        self._due = NEVER
        self.outlet(name)

    def start(self, clock: Clock) -> Sequence[Message[Any]]:
        """Be due at once, if it has a period."""
        self._due = NEVER if self.period is None else clock.now()
        return ()

    @property
    def due(self) -> int:
        """Multiples of its period."""
        return self._due

    def step(self, now: int, inputs: Sequence[Message[Any]]) -> Sequence[Message[Any]]:
        """Log, and react."""
        if self.period is not None and now >= self._due:
            self._due += self.period
        self.received += inputs
        items = [message.item for message in inputs]
        self.log.append((self.name, now, items))
        return [self.message(item, now) for item in self.react(now, items)]

    def message(self, item: Any, now: int) -> Message[Any]:  # noqa: ANN401
        """Make the next message of its stream."""
        outlet = self.outlet(self.name)
        return outlet.measure(item, Header(outlet.sent, now, self.name), 0)

    def close(self) -> None:
        """Count the calls."""
        self.closed += 1


class Newest(Recorder):
    """Takes the newest messages when its own time has come, as a camera does."""

    waits_for_inputs = False


def started(*nodes: Node, first: Sequence[Node] = ()) -> InlineExecutor:
    """An executor of these nodes, each a part of its own, started in their reversed order."""
    executor = InlineExecutor()
    for node in nodes:
        executor.add(node.name, [node], first=node in first)
    executor.open(nodes)
    executor.start(reversed(nodes))
    return executor


def run(executor: InlineExecutor, until: int) -> None:
    """Advance from moment to moment."""
    while executor.next_moment <= until:
        executor.advance_to(executor.next_moment)


def test_a_vehicle_is_stepped_before_what_measures_it() -> None:
    """At each of its times, though it was added last; else a camera would see it as it was."""
    camera = Newest("camera", "vehicle", period=20)
    vehicle = Recorder("vehicle", period=10, react=lambda now, _: [now])
    run(started(camera, vehicle, first=[vehicle]), 40)
    assert [(now, items) for _, now, items in camera.log] == [(0, [0]), (20, [20]), (40, [40])]


def test_messages_are_handed_on_until_none_is_left() -> None:
    """Along the nodes' order, also against it, within one moment."""
    log: Steps = []
    source = Recorder("source", "b", log=log, period=10, react=lambda _, got: [] if got else [1])
    a = Recorder("a", "source", log=log, react=lambda _, got: [got[0] + 1])
    b = Recorder("b", "a", log=log, react=lambda _, got: [got[0] + 1])
    executor = started(source, a, b)
    executor.advance_to(0)
    assert log == [("source", 0, []), ("a", 0, [1]), ("b", 0, [2]), ("source", 0, [3])]
    assert executor.next_moment == 10


def test_a_steps_messages_come_in_the_order_of_what_is_read() -> None:
    """Of one stream in the order of publishing, however the streams' nodes are ordered."""
    states = Recorder("states", period=10, react=lambda _, __: ["state"])
    frames = Recorder("frames", period=10, react=lambda _, __: ["frame 1", "frame 2"])
    reader = Recorder("reader", "frames", "states")
    started(states, frames, reader).advance_to(0)
    assert reader.log == [("reader", 0, ["frame 1", "frame 2", "state"])]


def test_a_node_that_does_not_wait_holds_the_newest_message_of_each_stream() -> None:
    """Until its own time has come; no message is a reason to step it."""
    fast = Recorder("fast", period=10, react=lambda now, _: [now])
    slow = Newest("slow", "fast", period=40)
    run(started(fast, slow), 100)
    assert [items for _, _, items in slow.log] == [[0], [40], [80]]


@dataclass
class Graph:
    """An acyclic graph of nodes by number; each reads nodes of smaller numbers only."""

    inputs: list[list[int]]
    periods: list[int | None]
    order: list[int] = field(default_factory=list)
    """Order in which nodes are added."""


@st.composite
def graphs(draw: st.DrawFn) -> Graph:
    """Graphs of up to seven nodes; what has no inputs has a period."""
    count = draw(st.integers(1, 7))
    inputs = [
        sorted(draw(st.sets(st.integers(0, number - 1), max_size=3))) if number else []
        for number in range(count)
    ]
    periods = [
        draw(st.sampled_from([3, 5, 10]) if not inputs[number] else st.sampled_from([None, 4]))
        for number in range(count)
    ]
    return Graph(inputs, periods, draw(st.permutations(range(count))))


def flown(graph: Graph) -> tuple[dict[str, list[tuple[int, int, Any]]], list[Recorder]]:
    """Messages of each stream (number, stamp, item) and the nodes, after 30 ns.

    Of the order in which nodes are added what is documented is kept: a node stands behind those
    whose results it reads.
    """

    def node(number: int) -> Recorder:
        def react(now: int, got: list[Any]) -> list[int]:
            value = hash((number, now, *got))
            return [value] * (1 + value % 2)

        reads = [f"n{source}" for source in graph.inputs[number]]
        return Recorder(f"n{number}", *reads, period=graph.periods[number], react=react)

    nodes = {number: node(number) for number in graph.order}
    ordered: list[int] = []
    while len(ordered) < len(nodes):
        ordered.append(
            next(
                number
                for number in graph.order
                if number not in ordered and set(graph.inputs[number]) <= set(ordered)
            )
        )
    executor = InlineExecutor()
    for number, one in nodes.items():
        executor.add(f"part{number}", [one])
    executor.order([nodes[number] for number in ordered])
    sink = Recorder("sink", *(f"n{number}" for number in range(len(nodes))))
    executor.add("sink", [sink])
    everyone = [*nodes.values(), sink]
    executor.open(everyone)
    executor.start(everyone)
    run(executor, 30)
    streams: dict[str, list[tuple[int, int, Any]]] = {name: [] for name in sink.reads}
    for message in sink.received:
        streams[message.stream].append((message.seq, message.stamp, message.item))
    return streams, everyone


@given(graphs(), st.randoms(use_true_random=False))
def test_messages_do_not_depend_on_the_order_of_adding(graph: Graph, random: Any) -> None:  # noqa: ANN401
    """Each is delivered once to each reader, and no stream knows how the nodes were added."""
    streams, nodes = flown(graph)
    for name, messages in streams.items():
        sent = [seq for seq, _, _ in messages]
        assert sent == list(range(len(sent)))
        for node in nodes:
            if name in node.reads:
                assert [one.seq for one in node.received if one.stream == name] == sent
    other = Graph(graph.inputs, graph.periods, random.sample(graph.order, len(graph.order)))
    assert flown(other)[0] == streams


def broken(at: int, error: Exception) -> Callable[[int, list[Any]], Sequence[Any]]:
    """A reaction that raises from mission time `at` on."""

    def react(now: int, got: list[Any]) -> Sequence[Any]:
        if now >= at:
            raise error
        return got

    return react


def test_a_node_that_raises_ends_and_the_others_go_on() -> None:
    """Its part's error names node, message and mission time; it is stepped no more."""
    second = NANOSECONDS // 2
    source = Recorder("source", period=second, react=lambda now, _: [now])
    bad = Recorder("bad", "source", react=broken(NANOSECONDS, KeyError("x")))
    good = Recorder("good", "source")
    alerts = Recorder("alerts", alert_stream("bad"))
    executor = started(source, bad, good, alerts)
    run(executor, 2 * NANOSECONDS)
    part = executor.parts["bad"]
    assert part.phase == "failed"
    text = str(part.error)
    assert text.startswith("bad: KeyError: 'x'")
    assert text.endswith("(at 1.000 s of mission time, with source #2)")
    assert len(bad.log) == 3
    assert len(good.log) == 5
    (alert,) = (item_of(message) for message in alerts.received)
    assert (alert.kind, alert.text, alert.header.stamp) == ("actor_failed", text, NANOSECONDS)
    assert executor.parts["good"].phase == "running"
    executor.close()
    assert executor.parts["good"].phase == "done"
    assert part.report().error is part.error
    assert bad.closed == 1


def test_a_failure_without_a_message_names_the_time_only() -> None:
    """As of a source; an error of the project's own keeps its words."""
    source = Recorder("source", period=10, react=broken(0, SourceError("no lens")))
    executor = started(source)
    run(executor, 100)
    assert str(executor.parts["source"].error) == "source: no lens (at 0.000 s of mission time)"
    assert executor.next_moment == NEVER


def test_a_node_that_cannot_start_ends_and_the_others_fly() -> None:
    """What starting one raises is its own failure."""

    class Unstarted(Recorder):
        def start(self, clock: Clock) -> Sequence[Message[Any]]:
            raise SourceError(f"no signal at {clock.now()}")

    good = Recorder("good", period=10)
    executor = started(Unstarted("bad", period=10), good)
    run(executor, 30)
    assert str(executor.parts["bad"].error).startswith("bad: no signal at 0")
    assert len(good.log) == 4


def test_alerts_are_published_once_in_five_seconds() -> None:
    """The same words of the same source; each has the mission time at which it was raised."""
    node = Recorder("node", period=NANOSECONDS)
    reader = Recorder("reader", alert_stream("node"))
    executor = started(node, reader)

    def react(now: int, got: list[Any]) -> Sequence[Any]:
        node.host.alert("kind", "the same", now)
        node.host.alert("kind", "the same", source="another")
        node.host.alert("kind", f"at {now}", values={"now": now})
        return got

    node.react = react
    run(executor, 11 * NANOSECONDS)
    told = [item_of(message) for message in reader.received]
    same = [one.header.stamp // NANOSECONDS for one in told if one.text == "the same"]
    assert same == [0, 0, 5, 5, 10, 10]
    assert sum(one.text.startswith("at ") for one in told) == 12
    report = executor.parts["node"].report()
    assert list(report.alerts) == told
    assert report.sent[alert_stream("node")].count == len(told)


def test_a_wake_from_another_thread_steps_a_node_without_a_message() -> None:
    """Once, at the next opportunity, and the other parts not at all."""
    sleeper, other = Recorder("sleeper"), Recorder("other")
    clock = Recorder("clock", period=10)
    executor = started(sleeper, other, clock)
    run(executor, 0)
    thread = threading.Thread(target=sleeper.host.wake)
    thread.start()
    thread.join()
    run(executor, 20)
    assert sleeper.log == [("sleeper", 10, [])]
    assert other.log == []


def test_a_message_from_another_thread_is_delivered_at_the_next_moment() -> None:
    """To its readers and taps, in the order of posting."""
    outside, reader = Recorder("outside"), Recorder("reader", "outside")
    executor = started(outside, reader, Recorder("clock", period=10))
    tap = executor.tap("outside")

    def post() -> None:
        for number in range(3):
            executor.post(outside.message(number, 0))

    thread = threading.Thread(target=post)
    thread.start()
    thread.join()
    assert reader.log == []
    run(executor, 0)
    assert [item_of(message) for message in reader.received] == [0, 1, 2]
    assert [message.item for message in tap.receive(0.0)] == [0, 1, 2]
    assert tap.receive(0.0) == []


def test_a_tap_keeps_the_newest_messages_for_a_slow_thread() -> None:
    """The flight does not wait for it."""
    tap, source = Tap(), Recorder("source")
    for number in range(1000):
        tap.put(source.message(number, 0))
    kept = [message.item for message in tap.receive(0.0)]
    assert kept == list(range(1000 - len(kept), 1000))
    assert 0 < len(kept) < 1000


def test_retired_nodes_get_nothing_more() -> None:
    """While another one is stepped to its end."""
    source = Recorder("source", period=10, react=lambda now, _: [now])
    reader = Recorder("reader", "source")
    executor = started(source, reader)
    run(executor, 10)
    executor.retire([reader])
    executor.step(source, 20)
    assert [item_of(message) for message in reader.received] == [0, 10]
    assert executor.clock.now() == 20


def test_the_close_records_what_is_told_last() -> None:
    """A node closes after what it has been told; who comes later hears what closing tells."""

    class Parting(Recorder):
        def close(self) -> None:
            super().close()
            self.host.alert("parting", self.name)

    one, two = Parting("one"), Parting("two")
    recorder = Recorder("recorder", alert_stream("one"), alert_stream("two"))
    executor = started(one, two, recorder)
    executor.close()
    assert [item_of(message).text for message in recorder.received] == ["one", "two"]
    assert [node.closed for node in (one, two, recorder)] == [1, 1, 1]
    assert {part.phase for part in executor.parts.values()} == {"done"}


@pytest.mark.parametrize("error", [AeroDaaSError("no space"), OSError("no space")])
def test_what_a_close_raises_is_the_parts_error(error: Exception) -> None:
    """Those that come later are closed all the same."""

    class Unclosed(Recorder):
        def close(self) -> None:
            raise error

    last = Recorder("last")
    executor = started(Unclosed("bad"), last)
    executor.close()
    assert "no space" in str(executor.parts["bad"].error)
    assert executor.parts["last"].error is None
    assert last.closed == 1


def test_warnings_become_alerts_of_the_part_at_work() -> None:
    """A module that logs one need not know who has called it."""
    logger = logging.getLogger("aerodaas.test_inline")

    def warn(now: int, got: list[Any]) -> Sequence[Any]:
        logger.warning("warm at %d", now)
        return got

    executor = started(Recorder("quiet", period=10), Recorder("warm", period=10, react=warn))
    handler = executor.log_handler()
    logger.addHandler(handler)
    try:
        run(executor, 10)
    finally:
        logger.removeHandler(handler)
    assert [one.text for one in executor.parts["warm"].report().alerts] == [
        "warm at 0",
        "warm at 10",
    ]
    assert executor.parts["quiet"].report().alerts == ()


def test_moments_are_those_of_the_nodes_rates() -> None:
    """Mission time jumps from one to the next and stops at no other."""
    nodes = [Recorder(f"at {rate}", period=int(NANOSECONDS / rate)) for rate in (4, 5)]
    executor, moments = started(*nodes), []
    while executor.next_moment <= NANOSECONDS:
        moments.append(executor.next_moment)
        executor.advance_to(executor.next_moment)
    due = {stamp for rate in (4, 5) for stamp in _due(rate)}
    assert moments == sorted(due)
    assert all(one < another for one, another in pairwise(moments))


def _due(rate: float) -> list[int]:
    stamps = [0]
    while stamps[-1] < NANOSECONDS:
        stamps.append(next_due(rate, stamps[-1]))
    return stamps
