"""The gate at which a drone's loop takes changes: when, in which thread, and what if not."""

from __future__ import annotations

import threading
import time

import pytest

from aerodaas.actors._growth_gate import GrowthGate
from aerodaas.errors import MissionError


class Loop:
    """Visits a gate until stopped, and counts its turns."""

    def __init__(self, gate: GrowthGate) -> None:
        """Begin to turn."""
        self.turns = self.settled = 0
        self._gate = gate
        self._stopping = threading.Event()
        self.thread = threading.Thread(target=self._run)
        self.thread.start()

    def _run(self) -> None:
        while not self._stopping.wait(0.001):
            self._gate.visit(settle=self._settle)
            self.turns += 1

    def _settle(self) -> None:
        self.settled += 1

    def stop(self) -> None:
        """Turn no more."""
        self._stopping.set()
        self._gate.release()
        self.thread.join()


def test_changes_are_made_in_the_loops_own_thread() -> None:
    """One after another, each before its caller goes on."""
    gate = GrowthGate()
    loop, made = Loop(gate), []
    for _ in range(3):
        gate.change(lambda: made.append(threading.current_thread()), 5.0)
    loop.stop()
    assert made == [loop.thread] * 3
    assert not loop.settled


def test_what_a_change_raises_is_its_callers() -> None:
    """The loop goes on."""
    gate = GrowthGate()
    loop = Loop(gate)

    def fail() -> None:
        raise ValueError("no")

    with pytest.raises(ValueError, match="no"):
        gate.change(fail, 5.0)
    turns = loop.turns
    gate.change(lambda: None, 5.0)
    loop.stop()
    assert loop.turns > turns


def test_time_stands_still_between_hold_and_release() -> None:
    """After all that was under way is done; changes are made meanwhile."""
    gate = GrowthGate()
    loop, made = Loop(gate), []
    assert gate.hold(5.0)
    turns = loop.turns
    assert loop.settled == 1
    gate.change(lambda: made.append(loop.turns), 5.0)
    time.sleep(0.05)
    assert made == [turns]
    assert loop.turns == turns
    gate.release()
    gate.change(lambda: None, 5.0)
    loop.stop()
    assert loop.turns > turns


def test_a_loop_that_has_ended_is_told() -> None:
    """Whoever wants a change is not kept waiting for ever."""
    gate = GrowthGate()
    assert not gate.hold(0.05)
    with pytest.raises(MissionError, match="the mission has ended"):
        gate.change(lambda: None, 0.05)
