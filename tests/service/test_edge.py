"""Turns on the edge: shared by tenants' weights, and never a reason for a flight to stand still."""

from __future__ import annotations

import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from aerodaas.actors.dispatch import edge_turns
from aerodaas.actors.dispatch.edge_turns import EdgeTurns
from aerodaas.config.options import EdgeShare
from aerodaas.errors import ConfigError
from aerodaas.service import edge as edges
from aerodaas.service.edge import EdgeArbiter


@pytest.fixture
def path() -> Iterator[Path]:
    """A short path of a socket."""
    with tempfile.TemporaryDirectory(prefix="edge-", dir="/tmp") as folder:
        yield Path(folder) / "edge"


class Worker:
    """A flight that always has work, each piece of which takes as long."""

    def __init__(self, path: Path, tenant: str, weight: float, seconds: float) -> None:
        self.done = 0
        self.seconds = seconds
        self._over = threading.Event()
        self._granted = threading.Event()
        self.turns = EdgeTurns(EdgeShare(path, tenant, weight), self._granted.set)
        self._thread = threading.Thread(target=self._work, daemon=True)
        self._thread.start()

    def _work(self) -> None:
        while not self._over.is_set():
            self.turns.ask()
            if self.turns.granted or self._granted.wait(0.2):
                self._granted.clear()
                self.turns.used = True
                time.sleep(self.seconds)
                self.done += 1
                self.turns.release(again=True)

    def close(self) -> None:
        """Stop."""
        self._over.set()
        self._thread.join()
        self.turns.close()


def worked(path: Path, *workers: tuple[str, float, float], seconds: float = 2.0) -> list[float]:
    """Seconds of work of each of these, given by tenant, weight and seconds a piece."""
    made = [Worker(path, *one) for one in workers]
    time.sleep(seconds)
    for one in made:
        one.close()
    return [one.done * one.seconds for one in made]


@pytest.fixture
def arbiter(path: Path) -> Iterator[EdgeArbiter]:
    """Turns for one at a time."""
    made = EdgeArbiter(path, 1)
    made.start()
    yield made
    made.close()


def test_tenants_share_by_weight_however_many_and_long_their_tasks(
    path: Path,
    arbiter: EdgeArbiter,  # noqa: ARG001 - at the path
) -> None:
    """Three times the weight, three times the work; two flights are no two shares."""
    much, *others = worked(path, ("farm", 3.0, 0.01), ("city", 1.0, 0.03), ("city", 1.0, 0.01))
    assert 2.0 < much / sum(others) < 4.5


def test_what_one_leaves_the_others_have(path: Path, arbiter: EdgeArbiter) -> None:  # noqa: ARG001
    """A tenant alone has all of it, whatever its weight."""
    (alone,) = worked(path, ("farm", 0.01, 0.01), seconds=0.6)
    assert alone > 0.2


def test_no_more_run_at_once_than_there_are_slots(path: Path) -> None:
    """And no fewer."""
    arbiter = EdgeArbiter(path, 2)
    arbiter.start()
    made = [EdgeTurns(EdgeShare(path, f"t{n}"), lambda: None) for n in range(4)]
    for one in made:
        one.ask()
    time.sleep(0.4)
    granted = [one for one in made if one.granted]
    assert len(granted) == 2
    granted[0].release()
    time.sleep(0.2)
    assert sum(one.granted for one in made) == 2
    for one in made:
        one.close()
    arbiter.close()


def test_a_flight_that_keeps_its_turn_loses_it(
    path: Path,
    arbiter: EdgeArbiter,  # noqa: ARG001
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It hangs, or was killed without its connection being closed."""
    monkeypatch.setattr(edges, "_LONGEST", 300_000_000)
    hangs, waits = (EdgeTurns(EdgeShare(path, name), lambda: None) for name in ("a", "b"))
    hangs.ask()
    time.sleep(0.1)
    waits.ask()
    time.sleep(0.1)
    assert (hangs.granted, waits.granted) == (True, False)
    time.sleep(1.2)
    assert waits.granted
    hangs.close()
    waits.close()


def test_no_flight_stands_still_for_want_of_a_turn(
    path: Path,
    arbiter: EdgeArbiter,  # noqa: ARG001
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """After a while it takes one; what it is granted too late is given back with it."""
    monkeypatch.setattr(edge_turns, "_MOST_WAIT", 0.3)
    first, second = (EdgeTurns(EdgeShare(path, name), lambda: None) for name in ("a", "b"))
    first.ask()
    time.sleep(0.1)
    second.ask()
    seen = [second.granted]
    time.sleep(0.4)
    seen.append(second.granted)
    first.release()
    time.sleep(0.1)
    second.release()
    first.ask()
    time.sleep(0.1)
    assert [*seen, second.granted, first.granted] == [False, True, False, True]
    first.close()
    second.close()


def test_without_a_service_the_edge_is_free(path: Path) -> None:
    """At once where it never was, and for what waits when it ends."""
    alone = EdgeTurns(EdgeShare(path, "farm"), lambda: None)
    alone.ask()
    assert alone.granted
    arbiter = EdgeArbiter(path, 1)
    arbiter.start()
    woken = threading.Event()
    has, waits = (EdgeTurns(EdgeShare(path, "farm"), woken.set) for _ in range(2))
    has.ask()
    assert woken.wait(5.0)
    woken.clear()
    waits.ask()
    assert not woken.wait(0.2)
    arbiter.close()
    assert woken.wait(5.0)
    assert waits.granted


def test_strangers_words_change_nothing(path: Path, arbiter: EdgeArbiter) -> None:  # noqa: ARG001
    """A connection that does not say whose it is gets no turn."""
    import socket  # noqa: PLC0415 - only here

    with socket.socket(socket.AF_UNIX) as stranger:
        stranger.connect(str(path))
        stranger.sendall(b"aaaa\n")
        stranger.settimeout(5.0)
        assert stranger.recv(1) == b""
    (alone,) = worked(path, ("farm", 1.0, 0.01), seconds=0.3)
    assert alone > 0.0


def test_a_path_that_no_socket_can_have_is_told(tmp_path: Path) -> None:
    """Before anything flies."""
    with pytest.raises(ConfigError, match="too long a path"):
        EdgeArbiter(tmp_path / ("x" * 120), 1)
