"""Ends of a stream on one node: what dies, gets stuck or talks nonsense harms no other."""

from __future__ import annotations

import os
import resource
import socket
import subprocess
import sys
import tempfile
import threading
import time
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule
from publishing import child_variables, send
from required import needs, needs_root

from aerodaas.actors.streams import (
    MAX_DEPTH,
    Publisher,
    Subscriber,
    rendezvous,
    shared_memory_available,
)
from aerodaas.actors.streams.completion import Publication
from aerodaas.actors.streams.local_publisher import MAX_BORROWED, _ReaderLink
from aerodaas.actors.streams.slots import Slot, SlotPool
from aerodaas.actors.streams.wire import LONGEST, packet
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Header

pytestmark = needs(shared_memory_available(), "needs shared memory: `aerodaas doctor`")

LARGE = 100_000
"""Bytes that travel in a slot, and are not copied."""


def scope_of_its_own() -> str:
    """A scope that nobody else uses."""
    return f"test/{uuid.uuid4().hex[:8]}"


def publish(publisher: Publisher, number: int, size: int = 8) -> None:
    """Publish an array full of its number."""
    header = Header(number, number, "camera")
    send(publisher, np.full(size // 8, number, np.int64), header, 0)


def number_in(message: Message[Any]) -> int:
    """The number in an array, which must be in all of it."""
    item: Any = message.item
    assert item.min() == item.max()
    return int(item[0])


def slots(publisher: Publisher) -> tuple[int, int]:
    """Bytes of a publisher's slots, and of those that are free."""
    local = publisher._local
    assert local is not None
    assert local._pool is not None
    return local._pool._end, sum(len(slot.memory) for slot in local._pool._free)


def child(code: str, *words: str) -> subprocess.Popen[str]:
    """Run the code in a process of its own."""
    return subprocess.Popen(
        [sys.executable, "-c", code, *words],
        stdout=subprocess.PIPE,
        text=True,
        env=child_variables(),
    )


class KeepLatest(RuleBasedStateMachine):
    """A subscriber gets the newest `depth` messages since it last looked, whatever else happens."""

    depth = 3

    def __init__(self) -> None:
        super().__init__()
        self.scope = scope_of_its_own()
        self.publisher = Publisher(self.scope, "s")
        self.subscriber = Subscriber(self.scope, {"s": self.depth})
        self.number = 0
        self.waiting: list[int] = []
        self.held: list[tuple[int, Message[Any]]] = []

    @rule(count=st.integers(1, 2 * MAX_DEPTH), size=st.sampled_from([8, 3000, 20_000, LARGE]))
    def publish(self, count: int, size: int) -> None:
        """Publish a burst, of messages in packets or in slots."""
        for _ in range(count):
            publish(self.publisher, self.number, size)
            self.waiting.append(self.number)
            self.number += 1

    @rule(keep=st.booleans())
    def receive(self, keep: bool) -> None:  # noqa: FBT001
        """Look, and perhaps hold on to what has come."""
        messages = self.subscriber.receive(0.0)
        assert [number_in(one) for one in messages] == self.waiting[-self.depth :]
        if keep:
            self.held += [(number_in(one), one) for one in messages]
        self.waiting.clear()

    @precondition(lambda self: self.held)
    @rule(data=st.data())
    def let_go(self, data: st.DataObject) -> None:
        """Let go of one message."""
        self.held.pop(data.draw(st.integers(0, len(self.held) - 1)))

    @rule()
    def restart_publisher(self) -> None:
        """What the old one has sent is still read."""
        self.publisher.close()
        self.publisher = Publisher(self.scope, "s")

    @rule()
    def restart_subscriber(self) -> None:
        """What the old one holds stays; the new one has missed what was before it."""
        self.subscriber.close()
        self.subscriber = Subscriber(self.scope, {"s": self.depth})
        self.waiting.clear()

    @invariant()
    def what_is_held_stays_as_it_was(self) -> None:
        """No slot is used again too early."""
        for number, message in self.held:
            assert number_in(message) == number

    def teardown(self) -> None:
        """Close both."""
        self.publisher.close()
        self.subscriber.close()


def test_what_a_publisher_sent_before_it_ended_comes_before_its_successors() -> None:
    """Whichever queue the system names first."""
    for _ in range(20):
        scope = scope_of_its_own()
        subscriber = Subscriber(scope, {"s": 8})
        for first in (0, 3):
            publisher = Publisher(scope, "s")
            for number in range(first, first + 3):
                publish(publisher, number)
            publisher.close()
        assert [number_in(one) for one in subscriber.receive(1.0)] == list(range(6))
        subscriber.close()


TestKeepLatest = KeepLatest.TestCase
TestKeepLatest.settings = settings(max_examples=40, stateful_step_count=30, deadline=None)


_HOLDER = """
import sys, time
from aerodaas.actors.streams import Subscriber
subscriber = Subscriber(sys.argv[1], {"s": 8})
print("ready", flush=True)
kept = []
while len(kept) < 12:
    kept += subscriber.receive(1.0)
print("full", flush=True)
time.sleep(600)
"""


def test_slots_of_a_killed_reader_return() -> None:
    """All of them, those that it held and those in its queue; its socket is removed."""
    scope = scope_of_its_own()
    publisher = Publisher(scope, "s")
    with child(_HOLDER, scope) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "ready\n"
        for number in range(12):
            publish(publisher, number, LARGE)
            time.sleep(0.01)
        assert holder.stdout.readline() == "full\n"
        for number in range(12, 40):
            publish(publisher, number, LARGE)
        whole, free = slots(publisher)
        assert free < whole
        holder.kill()
        holder.wait()
    publish(publisher, 40, LARGE)
    publish(publisher, 41, LARGE)
    assert slots(publisher) == (whole, whole)
    publisher.close()
    folder = rendezvous.streams_folder() / rendezvous._hashed(scope)
    assert not folder.exists()


_TALKER = """
import sys
import numpy as np
from publishing import send
from aerodaas.actors.streams import Publisher
from aerodaas.messages.frames import Header
publisher, number = Publisher(sys.argv[1], "s"), 0
while True:
    send(publisher, np.full(20_000, number), Header(number, number, "camera"), 0)
    number += 1
    if number == 20:
        print("talks", flush=True)
"""


def test_a_publisher_killed_while_it_sends_leaves_whole_messages() -> None:
    """None is torn, what was sent is read to its end, and the next publisher is heard."""
    scope = scope_of_its_own()
    subscriber = Subscriber(scope, {"s": 2})
    for _ in range(3):
        last = -1
        with child(_TALKER, scope) as talker:
            assert talker.stdout is not None
            assert talker.stdout.readline() == "talks\n"
            for _ in range(50):
                for message in subscriber.receive(5.0):
                    assert number_in(message) > last
                    last = number_in(message)
            talker.kill()
            talker.wait()
        while messages := subscriber.receive(0.0):
            assert number_in(messages[-1]) > last
            last = number_in(messages[-1])
        assert last >= 20
    subscriber.close()


_STATE_FIRST = """
import sys, time
import numpy as np
from publishing import send
from aerodaas.actors.streams import Publisher
from aerodaas.messages.frames import Header
state, frames = Publisher(sys.argv[1], "state"), Publisher(sys.argv[1], "frames")
for number in range(100_000):
    for publisher, size in ((state, 1), (frames, 1 + number % 2000)):
        send(publisher, np.full(size, number), Header(number, number, "camera"), 0)
"""


def test_what_was_published_before_a_message_is_there_with_it() -> None:
    """The state in which a frame was taken, though the frame's stream is read first."""
    scope = scope_of_its_own()
    subscriber = Subscriber(scope, {"frames": 1, "state": 1})
    newest = {"frames": -1, "state": -1}
    with child(_STATE_FIRST, scope) as talker:
        for _ in range(1000):
            for message in subscriber.receive(5.0):
                newest[message.stream] = number_in(message)
            assert newest["state"] >= newest["frames"]
        talker.kill()
    subscriber.close()


def test_no_reader_takes_a_message_that_another_does_not_have_yet(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Not even where the one before it, which all have, was dropped for it."""
    scope = scope_of_its_own()
    publisher = Publisher(scope, "s")
    readers = [Subscriber(scope, {"s": 1}) for _ in range(3)]
    during: list[int] = []
    queue_to = _ReaderLink.send

    def observed(
        self: _ReaderLink, data: bytes, slot: Slot | None, pool: SlotPool | None
    ) -> list[Slot]:
        freed = queue_to(self, data, slot, pool)
        during.extend(number_in(message) for one in readers for message in one.receive(0.0))
        return freed

    publish(publisher, 0, LARGE)
    monkeypatch.setattr(_ReaderLink, "send", observed)
    for number in range(1, 20):
        during.clear()
        publish(publisher, number, (8, LARGE)[number % 2])
        assert number not in during
        if number % 3:
            for one in readers:
                assert [number_in(message) for message in one.receive(0.0)] == [number]
    for one in readers:
        one.close()
    publisher.close()


def test_what_not_all_have_when_its_publisher_dies_nobody_gets(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its stream ends with the message before."""
    scope = scope_of_its_own()
    publisher, subscriber = Publisher(scope, "s"), Subscriber(scope, {"s": 4})
    publish(publisher, 0)
    monkeypatch.setattr(Publication, "complete", lambda *_: None)
    publish(publisher, 1)
    publisher.close()
    assert [number_in(message) for message in subscriber.receive(1.0)] == [0]
    assert subscriber._local is not None
    assert not subscriber._local._links
    subscriber.close()


_RELAY = """
import sys
from aerodaas.actors.streams import Publisher, Subscriber
from aerodaas.runtime.node import Outlet
frames, tasks = Subscriber(sys.argv[1], {"frames": 1}), Publisher(sys.argv[1], "tasks")
outlet = Outlet("tasks")
print(flush=True)
while True:
    for message in frames.receive(5.0):
        tasks.publish(outlet.derive(message.item, message, 0, message.stamp))
"""


def test_what_was_made_of_a_message_is_not_there_before_it() -> None:
    """A task names a frame that its executor has, though the dispatcher was woken for it, too."""
    scope = scope_of_its_own()
    with child(_RELAY, scope) as relay:
        assert relay.stdout is not None
        relay.stdout.readline()
        frames = Publisher(scope, "frames")
        publish(frames, 0)  # the relay is the first of its readers
        others = [Subscriber(scope, {"frames": 1}) for _ in range(20)]
        executor = Subscriber(scope, {"tasks": 1, "frames": 1})
        newest = dict.fromkeys(executor.received, -1)

        def talk() -> None:
            for number in range(600):
                publish(frames, number, LARGE)
                time.sleep(0.001)

        talking = threading.Thread(target=talk)
        talking.start()
        while talking.is_alive():
            for message in executor.receive(0.1):
                newest[message.stream] = number_in(message)
            assert newest["frames"] >= newest["tasks"]
        talking.join()
        assert newest["tasks"] > 500
        relay.kill()
    for one in (*others, executor):
        one.close()
    frames.close()


@pytest.fixture
def many_descriptors() -> Iterator[None]:
    """As many as may be had."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
    yield
    resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


@pytest.mark.usefixtures("many_descriptors")
def test_a_hundred_readers_of_which_half_never_read() -> None:
    """Each of the others gets each message, and memory stays bounded."""
    scope = scope_of_its_own()
    publisher = Publisher(scope, "s")
    stuck = [Subscriber(scope, {"s": 4}) for _ in range(50)]
    readers = [Subscriber(scope, {"s": 4}) for _ in range(50)]
    for number in range(30):
        publish(publisher, number, LARGE)
        for one in readers:
            assert [number_in(message) for message in one.receive(1.0)] == [number]
    whole, _ = slots(publisher)
    assert whole <= (4 + 2) << 17
    for one in (*stuck, *readers):
        one.close()
    publisher.close()


def test_a_reader_that_gives_nothing_back_is_sent_no_more_than_its_share(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Whatever it does: the publisher counts what it has sent."""
    scope = scope_of_its_own()
    publisher = Publisher(scope, "s")
    greedy, quick = (Subscriber(scope, {"s": 2}) for _ in range(2))
    assert greedy._local is not None
    for number in range(100):
        publish(publisher, number, LARGE)
        greedy.receive(0.0)
        for link in greedy._local._links.values():
            monkeypatch.setattr(link, "_give_back", lambda _: None)
        assert [number_in(message) for message in quick.receive(0.0)] == [number]
    whole, _ = slots(publisher)
    assert whole <= (MAX_BORROWED + 2 + 2 + 2) << 17
    for one in (greedy, quick):
        one.close()
    publisher.close()


def test_a_reader_that_holds_its_fill_and_copies_one_more_gets_the_newest() -> None:
    """Its share is reckoned for the moment in which it holds the most."""
    scope = scope_of_its_own()
    publisher, subscriber = Publisher(scope, "s"), Subscriber(scope, {"s": 2})
    held = []
    for number in range(MAX_BORROWED - 1):
        publish(publisher, number, LARGE)
        held += subscriber.receive(1.0)
    publish(publisher, 100, LARGE)
    assert subscriber._local is not None
    (link,) = subscriber._local._links.values()
    assert packet(link.queue, LONGEST)  # taken, and neither copied nor given back yet
    for number in range(101, 104):
        publish(publisher, number, LARGE)
    assert [number_in(message) for message in subscriber.receive(1.0)] == [102, 103]
    assert [number_in(message) for message in held] == list(range(MAX_BORROWED - 1))
    subscriber.close()
    publisher.close()


_STARVED = """
import os, resource, sys
from publishing import send
from aerodaas.actors.streams import Publisher, Subscriber
from aerodaas.messages.frames import Header
publisher, old = Publisher(sys.argv[1], "s"), Subscriber(sys.argv[1], {"s": 1})
new = Subscriber(sys.argv[1], {"s": 1})
def publish(number):
    send(publisher, number, Header(number, number, "camera"), 0)
    return [[m.item for m in one.receive(0.0)] for one in (old, new)]
link = next(iter(os.scandir("/proc/self/fd")))
resource.setrlimit(resource.RLIMIT_NOFILE, (64, 64))
spare = []
try:
    while True:
        spare.append(os.open("/dev/null", os.O_RDONLY))
except OSError:
    pass
print([publish(number) for number in range(3)], len(spare) > 5)
for one in spare[:2]:
    os.close(one)
print(publish(3))
for one in spare[2:]:
    os.close(one)
print([publish(number) for number in (4, 5)])
"""


def test_without_descriptors_publishing_goes_on_and_readers_are_found_later() -> None:
    """Nothing raises, nothing spins, and once there are some again all is as it should be."""
    with child(_STARVED, scope_of_its_own()) as starved:
        told, _ = starved.communicate(timeout=60)
    first, second, third = told.splitlines()
    assert first == "[[[], []], [[], []], [[], []]] True"
    assert second.startswith("[")
    assert third == "[[[4], [4]], [[5], [5]]]"


@pytest.fixture
def open_folder() -> Iterator[Path]:
    """A folder that everybody may write to, with a path short enough for a socket's."""
    with tempfile.TemporaryDirectory(dir="/tmp") as name:
        Path(name).chmod(0o777)
        yield Path(name)


@needs_root
def test_another_user_is_refused_at_either_end(
    open_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By the kernel's word on who it is, even where a folder has been opened to all."""
    monkeypatch.setattr(rendezvous, "streams_folder", lambda: open_folder)
    listener = rendezvous.Listener("scope")
    listener.announce("s", 4)
    arrivals = rendezvous.SubscriberListener("scope", "s")
    for path in [path for path in open_folder.rglob("*") if path.exists()]:
        path.chmod(0o777)
    foreign = os.fork()
    if not foreign:
        try:
            os.setuid(65534)
            caller = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            caller.connect(str(listener._folder / listener._id))
            rendezvous.Listener("scope").announce("s", 4)
            time.sleep(600)
        finally:
            os._exit(1)
    until = time.monotonic() + 20
    links: list[str] = []
    while len(links) < 3:
        assert time.monotonic() < until
        links = [path.name for path in arrivals._folder.iterdir()]
        time.sleep(0.01)
    try:
        assert listener.accept() is None
        assert [arrival.name for arrival in arrivals.new()] == [listener._links[0].name]
    finally:
        os.kill(foreign, 9)
        os.waitpid(foreign, 0)
    listener.close()
    arrivals.close()
