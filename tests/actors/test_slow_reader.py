"""A reader that falls behind loses messages; nobody else notices."""

from __future__ import annotations

import uuid

import numpy as np
import pytest
from publishing import send
from required import needs

from aerodaas.actors.streams import MAX_DEPTH, Publisher, Subscriber, shared_memory_available
from aerodaas.messages.frames import Header

pytestmark = [
    needs(shared_memory_available(), "needs shared memory: `aerodaas doctor`"),
    pytest.mark.wall_clock,
]


def test_a_slow_recorder_starves_nobody() -> None:
    """With several readers that never read, a quick one gets every message."""
    scope = f"test/{uuid.uuid4().hex}"
    publisher = Publisher(scope, "camera")
    slow = [Subscriber(scope, {"camera": MAX_DEPTH}) for i in range(3)]
    quick = Subscriber(scope, {"camera": 1})
    received = 0
    for number in range(3 * MAX_DEPTH):
        picture = np.full(1000, number % 256, np.uint8)
        send(publisher, picture, Header(number, number, "camera"), 0)
        received += len(quick.receive(0.0))
    assert received == 3 * MAX_DEPTH
    for subscriber in slow:
        first = subscriber.receive(0.0)[0]
        assert first.seq == 2 * MAX_DEPTH
    for subscriber in (*slow, quick):
        subscriber.close()
    publisher.close()


def test_what_a_slow_reader_lost_is_counted() -> None:
    """Gaps in the numbering are drops."""
    scope = f"test/{uuid.uuid4().hex}"
    publisher = Publisher(scope, "camera")
    subscriber = Subscriber(scope, {"camera": 8})
    received = 0
    for number in range(50):
        send(publisher, number, Header(number, number, "camera"), 0)
        if number % 20 == 0:
            received += len(subscriber.receive(0.0))
    while messages := subscriber.receive(0.0):
        received += len(messages)
    assert subscriber.received["camera"] == received
    assert subscriber.dropped["camera"] == 50 - received
    subscriber.close()
    publisher.close()
