"""Streams behave alike in shared memory and by way of another node's ObjectRefs."""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
import ray
from publishing import send
from required import needs
from stream_reader import Reader, Seen, digest

from aerodaas.actors.streams import (
    MAX_DEPTH,
    UNDER_WAY,
    Publisher,
    RemoteReader,
    Subscriber,
    decode_message,
    shared_memory_available,
)
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Frame, Header

pytestmark = [
    needs(shared_memory_available(), "needs shared memory: `aerodaas doctor`"),
    pytest.mark.wall_clock,
]


def start_reader() -> Any:  # noqa: ANN401 - a Ray actor handle
    """Start a reader in a process of its own."""
    return ray.remote(Reader).options(num_cpus=0).remote()


@pytest.fixture(scope="module")
def reader(runtime: None) -> Iterator[Any]:  # noqa: ARG001
    """A reader in a process of its own."""
    handle = start_reader()
    yield handle
    ray.kill(handle)


def ask(reference: Any) -> Any:  # noqa: ANN401
    """The answer of the reader."""
    return ray.get(reference, timeout=30)


@dataclass
class Link:
    """A stream from this process to the reader's."""

    publisher: Publisher
    reader: Any
    stream: str

    def publish(self, stamp: int, item: object) -> Message[Any]:
        """Publish a measurement."""
        return send(self.publisher, item, Header(stamp, stamp, "camera"), 7 * stamp)

    def settle(self) -> None:
        """Wait until whatever was sent has arrived."""
        deadline = time.monotonic() + 20
        while any(remote._under_way for remote in self.publisher.remote):
            assert time.monotonic() < deadline
            time.sleep(0.002)

    def take(self) -> list[Seen]:
        """What the reader has got since the last call."""
        self.settle()
        seen: list[Seen] = ask(self.reader.take.remote(self.stream))
        return seen


Connect = Callable[..., Link]


@pytest.fixture(params=["shared memory", "another node"])
def connect(request: pytest.FixtureRequest, reader: Any) -> Iterator[Connect]:  # noqa: ANN401
    """Makes links over one transport, with a reader of the given depth.

    Two scopes on one host are two nodes: what is published in one is not seen in the other.
    """
    links: list[Link] = []

    def make(depth: int, under_way: int = UNDER_WAY) -> Link:
        scope, stream = f"test/{uuid.uuid4().hex[:8]}", f"s{uuid.uuid4().hex[:8]}"
        remote = request.param == "another node"
        ask(reader.open.remote(f"{scope}/other" if remote else scope, stream, depth))
        publisher = Publisher(scope, stream)
        if remote:
            publisher.remote = [RemoteReader(reader, under_way)]
        links.append(Link(publisher, reader, stream))
        return links[-1]

    yield make
    for link in links:
        link.settle()
        link.publisher.close()


def test_items_arrive_in_order_with_their_stamps(connect: Connect) -> None:
    """What a reader of some depth gets is what was published, unchanged and in order."""
    link = connect(MAX_DEPTH, under_way=MAX_DEPTH)
    for stamp in range(MAX_DEPTH):
        link.publish(stamp, f"item {stamp}")
    seen = link.take()
    told = [(one.seq, one.stamp, one.captured) for one in seen]
    assert told == [(i, i, 7 * i) for i in range(MAX_DEPTH)]
    assert [one.digest for one in seen] == [digest(f"item {i}") for i in range(MAX_DEPTH)]
    assert ask(link.reader.counts.remote(link.stream)) == (MAX_DEPTH, 0)


@pytest.mark.parametrize("depth", [1, 4])
def test_a_slow_reader_gets_the_newest_and_counts_what_it_missed(
    connect: Connect, depth: int
) -> None:
    """Keep-latest: a burst leaves its end; every gap is counted as drops."""
    link = connect(depth)
    link.publish(0, "first")
    assert [one.seq for one in link.take()] == [0]
    for stamp in range(1, 31):
        link.publish(stamp, stamp)
    seen = [one.seq for one in link.take()]
    assert seen[-1] == 30
    assert len(seen) <= depth
    assert seen == sorted(set(seen))
    received, dropped = ask(link.reader.counts.remote(link.stream))
    assert received == 1 + len(seen)
    assert received + dropped == 31


def test_the_last_message_arrives_though_the_link_was_busy(connect: Connect) -> None:
    """A command that ends a burst is not lost to what came before it."""
    link = connect(depth=MAX_DEPTH)
    picture = np.zeros((720, 1280, 3), np.uint8)
    for stamp in range(8):
        link.publish(stamp, Frame(Header(stamp, stamp, "camera"), picture))
    link.publish(8, "land")
    assert link.take()[-1].digest == digest("land")


def test_a_reader_that_never_reads_harms_nobody(connect: Connect) -> None:
    """A reader that is stuck, however deep its queue, does not hold up the others."""
    link = connect(depth=MAX_DEPTH)
    with_local = Subscriber(link.publisher.scope, {link.stream: 1})
    for stamp in range(4 * MAX_DEPTH):
        link.publish(stamp, stamp)
        assert [message.seq for message in with_local.receive(0)] == [stamp]
    seen = link.take()
    assert seen[-1].seq == 4 * MAX_DEPTH - 1
    with_local.close()


@pytest.mark.parametrize("shape", [(16, 16, 3), (720, 1280, 3), (2160, 3840, 3)])
def test_frames_of_any_size_pass(connect: Connect, shape: tuple[int, int, int]) -> None:
    """A stream takes small and large frames, one after the other."""
    link = connect(depth=2)
    for stamp, size in enumerate([shape, (8, 8, 3), shape]):
        image = np.full(size, stamp + 1, np.uint8)
        frame = Frame(Header(stamp, stamp, "camera"), image)
        link.publish(stamp, frame)
        (seen,) = link.take()
        assert seen.digest == digest(frame)


def test_one_subscriber_keeps_the_order_in_which_its_streams_were_named() -> None:
    """Messages that wait together come stream by stream, whatever their order of arrival."""
    scope = f"test/{uuid.uuid4().hex[:8]}"
    publishers = {name: Publisher(scope, name) for name in ("b", "a")}
    subscriber = Subscriber(scope, {"a": 4, "b": 4})
    for stamp in range(3):
        for name, publisher in publishers.items():
            send(publisher, f"{name}{stamp}", Header(stamp, stamp, name), 0)
    assert [message.item for message in subscriber.receive(0)] == [
        "a0",
        "a1",
        "a2",
        "b0",
        "b1",
        "b2",
    ]
    assert subscriber.receive(0) == []
    subscriber.close()


def test_a_waiting_reader_wakes_for_a_message_and_for_a_call() -> None:
    """`receive` sleeps, and returns as soon as there is a reason to."""
    scope = f"test/{uuid.uuid4().hex[:8]}"
    publisher, subscriber = Publisher(scope, "s"), Subscriber(scope, {"s": 1})
    send(publisher, "x", Header(0, 0, "c"), 0)
    assert [message.item for message in subscriber.receive(60.0)] == ["x"]
    subscriber.wake()
    assert subscriber.receive(60.0) == []
    subscriber.close()


def test_a_dead_reader_on_another_node_does_not_stop_the_publisher(runtime: None) -> None:  # noqa: ARG001
    """The publisher goes on, and the reader that is alive gets everything."""
    scope = f"test/{uuid.uuid4().hex[:8]}"
    dead, alive = start_reader(), start_reader()
    for one in (dead, alive):
        ask(one.open.remote(f"{scope}/other", "s", 64))
    publisher = Publisher(scope, "s")
    publisher.remote = [RemoteReader(dead), RemoteReader(alive)]
    link = Link(publisher, alive, "s")
    link.publish(0, 0)
    assert [one.seq for one in link.take()] == [0]
    ray.kill(dead)
    for stamp in range(1, 6):
        link.publish(stamp, stamp)
        assert [one.seq for one in link.take()] == [stamp]
    ray.kill(alive)


def test_who_asks_is_given_the_newest_once() -> None:
    """From the first question on; whoever knew a publisher that has died is given all again."""
    publisher = Publisher(f"test/{uuid.uuid4().hex[:8]}", "s")

    def numbers(first: int) -> list[int]:
        return [decode_message(memoryview(data)).seq for data in publisher.since(first)]

    send(publisher, 0, Header(0, 0, "camera"), 0)
    assert numbers(0) == []
    for stamp in range(1, 8):
        send(publisher, stamp, Header(stamp, stamp, "camera"), stamp)
    assert numbers(0) == [4, 5, 6, 7]
    assert numbers(7) == [7]
    assert numbers(8) == []
    assert numbers(99) == [4, 5, 6, 7]
    publisher.close()
