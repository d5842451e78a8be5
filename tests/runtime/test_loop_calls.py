"""Calls that a loop executes for other threads, between its cycles."""

from __future__ import annotations

import threading
import time

import pytest

from aerodaas.errors import MissionError
from aerodaas.runtime.nodes.loop_calls import LoopCalls, LoopOverError


def _serve_until(calls: LoopCalls, count: int) -> None:
    while count > 0:
        count -= calls.serve()


def test_a_command_that_raises_is_its_senders_failure() -> None:
    """What the loop carries out for somebody raises there, and the loop goes on."""
    calls = LoopCalls(lambda: None)
    loop = threading.Thread(target=lambda: _serve_until(calls, 3))
    loop.start()
    with pytest.raises(ZeroDivisionError):
        calls.ask(lambda: 1 // 0, 5.0)
    assert calls.ask(lambda: 7, 5.0) == 7
    assert calls.ask(threading.get_ident, 5.0) == loop.ident
    loop.join()
    calls.close("the mission is over")
    with pytest.raises(LoopOverError, match="the mission is over"):
        calls.ask(lambda: 8, 5.0)


def test_what_a_call_changed_is_published_before_it_is_answered() -> None:
    """A caller that reads afterwards reads its own call's effect, in a loop however slow."""
    value, published = [0], [0]

    def publish() -> None:
        time.sleep(0.05)
        published[0] = value[0]

    def add() -> None:
        value[0] += 1

    calls = LoopCalls(lambda: None, publish)
    loop = threading.Thread(target=lambda: _serve_until(calls, 3))
    loop.start()
    for count in range(1, 4):
        calls.ask(add, 5.0)
        assert published == [count]
    loop.join()


def test_a_command_that_nobody_came_to_is_not_obeyed_later() -> None:
    """Its sender was told that it was withdrawn."""
    made: list[int] = []
    calls = LoopCalls(lambda: None)
    with pytest.raises(MissionError, match="withdrawn"):
        calls.ask(lambda: made.append(1), 0.01)
    assert calls.serve() == 0
    assert made == []
