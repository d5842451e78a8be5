"""Where a lockstep's time stands still: after what was under way, and calls are served."""

from __future__ import annotations

import threading
import time

from aerodaas.actors.lockstep.growth_gate import GrowthGate
from aerodaas.runtime.loop_calls import LoopCalls


class Loop:
    """Visits a gate until stopped, and counts its turns."""

    def __init__(self) -> None:
        """Begin to turn."""
        self.turns = self.settled = 0
        self.calls = LoopCalls(lambda: None)
        self.gate = GrowthGate(self.calls.serve)
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        while not self._stopping.wait(0.001):
            self.gate.visit(self._settle)
            self.calls.serve()
            self.turns += 1

    def _settle(self) -> None:
        self.settled += 1

    def stop(self) -> None:
        """Turn no more."""
        self._stopping.set()
        self.gate.release()
        self._thread.join()


def test_time_stands_still_between_hold_and_release() -> None:
    """After all that was under way is done; calls are served meanwhile."""
    loop = Loop()
    assert loop.gate.hold(5.0)
    assert loop.settled == 1
    turns = loop.turns
    assert loop.calls.ask(lambda: loop.turns, 5.0) == turns
    time.sleep(0.05)
    assert loop.turns == turns
    loop.gate.release()
    while loop.turns == turns:
        time.sleep(0.001)
    loop.stop()
    assert loop.settled == 1


def test_a_loop_that_has_ended_is_told() -> None:
    """Whoever wants time to stand still is not kept waiting for ever."""
    assert not GrowthGate(lambda: None).hold(0.05)
