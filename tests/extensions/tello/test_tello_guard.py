"""The guard of a Tello word by word: when it centres the sticks, and when it keeps silent."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable, Iterator
from types import SimpleNamespace

import pytest

from aerodaas.extensions.tello import dead_man
from aerodaas.extensions.tello.dead_man import DeadMan

PEER = ("192.168.10.1", 8889)
SILENCE = None
"""Nothing is heard for as long as the guard is patient."""
CLOSED = b""
"""The pipe closes."""


class Guarded:
    """A guard's end of the pipe, on which happens what the test says; then it must have ended."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, *events: bytes | None) -> None:
        self.events = list(events)
        self.patience: list[float | None] = []
        self.said: list[bytes] = []
        self.pauses: list[float] = []
        self.broken = False
        stdin = SimpleNamespace(fileno=lambda: 99)
        for name, fake in (
            ("sys", SimpleNamespace(stdin=stdin)),
            ("select", SimpleNamespace(select=self._select)),
            ("os", SimpleNamespace(read=self._read)),
            ("time", SimpleNamespace(sleep=self.pauses.append)),
        ):
            monkeypatch.setattr(dead_man, name, fake)

    def _select(self, readable: list[int], *_: object) -> tuple[list[int], list[int], list[int]]:
        assert readable == [99]
        self.patience.append(_[-1])  # type: ignore[arg-type]
        if self.events[0] is not SILENCE:
            return [99], [], []
        assert _[-1] is not None, "it would wait for ever"
        self.events.pop(0)
        return [], [], []

    def _read(self, pipe: int, most: int) -> bytes:
        assert (pipe, most) == (99, 4096)
        words = self.events.pop(0)
        assert words is not None
        return words

    def sendto(self, content: bytes, peer: tuple[str, int]) -> None:
        """As the Tello's socket."""
        assert peer == PEER
        self.said.append(content)
        if self.broken:
            raise OSError

    def run(self) -> int:
        """Let the guard run until it ends; how often it centred the sticks."""
        dead_man._guard(self, PEER)  # type: ignore[arg-type]
        assert not self.events
        assert set(self.said) <= {b"rc 0 0 0 0"}
        return len(self.said)


@pytest.mark.parametrize(
    ("events", "centred"),
    [
        ([b"q"], 0),
        ([CLOSED], 0),
        ([b"m", b"q"], 0),
        ([b"m", CLOSED], 3),
        ([b"s", CLOSED], 0),
        ([b"mms", CLOSED], 0),
        ([b"ssm", CLOSED], 3),
        ([b"m", b"s", CLOSED], 0),
        ([b"m", SILENCE, CLOSED], 3),
        ([b"m", SILENCE, b"m", SILENCE, b"m", CLOSED], 9),
        ([b"mq"], 0),
        ([b"m", b"mqs"], 0),
    ],
)
def test_when_a_tello_is_stopped(
    monkeypatch: pytest.MonkeyPatch, events: list[bytes | None], centred: int
) -> None:
    """If the last word was that it moves, and no goodbye: three times, when the pipe falls silent.

    A second silence, or the end of a pipe that was silent, finds it stopped already.
    """
    assert Guarded(monkeypatch, *events).run() == centred


def test_it_is_patient_only_with_a_tello_that_moves(monkeypatch: pytest.MonkeyPatch) -> None:
    """A second; one that stands may be silent for ever, and so may one that was stopped."""
    guard = Guarded(monkeypatch, b"s", b"m", b"m", SILENCE, b"s", b"q")
    assert guard.run() == 3
    assert guard.patience == [None, None, 1.0, 1.0, None, None]
    assert guard.pauses == [0.1, 0.1, 0.1]


def test_a_wire_that_is_broken_does_not_end_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """It tries three times all the same, and goes on."""
    guard = Guarded(monkeypatch, b"m", SILENCE, b"m", CLOSED)
    guard.broken = True
    assert guard.run() == 6


class Process:
    """What the driver's end starts: its words, and how it was started."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.read, write = os.pipe()
        self.pipe = os.fdopen(write, "wb", buffering=0)
        self.started: list[tuple[list[str], dict[str, object]]] = []
        self.waited: list[float | None] = []
        self.killed = 0
        self.hangs = False

        def start(command: list[str], **how: object) -> SimpleNamespace:
            self.started.append((command, how))
            return SimpleNamespace(stdin=self.pipe, wait=self._wait, kill=self._kill)

        quiet = SimpleNamespace(Popen=start, PIPE=-1, TimeoutExpired=subprocess.TimeoutExpired)
        monkeypatch.setattr(dead_man, "subprocess", quiet)
        self.guard = DeadMan(SimpleNamespace(fileno=lambda: 42), PEER)  # type: ignore[arg-type]

    def _wait(self, timeout: float | None = None) -> None:
        self.waited.append(timeout)
        if self.hangs:
            raise subprocess.TimeoutExpired("guard", timeout or 0.0)

    def _kill(self) -> None:
        self.killed += 1
        self.hangs = False

    def words(self) -> bytes:
        """All that was said."""
        return os.read(self.read, 4096)


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch) -> Iterator[Process]:
    """A guard's process."""
    process = Process(monkeypatch)
    yield process
    process.pipe.close()
    os.close(process.read)


def _full(started: Process) -> None:
    os.set_blocking(started.read, False)
    for _ in range(100):
        started.pipe.write(b"m" * 4096)


def _dead(started: Process) -> None:
    os.dup2(started.pipe.fileno(), started.read)


@pytest.mark.parametrize("trouble", [_full, _dead])
def test_a_guard_that_hangs_or_has_died_ends_no_flight(
    started: Process, trouble: Callable[[Process], None]
) -> None:
    """What cannot be said to it is let be; closing waits for it all the same."""
    trouble(started)
    started.guard.restart(moving=True)
    started.guard.close()
    assert started.waited == [5.0]


def test_a_guard_that_does_not_leave_is_ended(started: Process) -> None:
    """It would keep the Tello's port for ever; whoever closes need not know of it."""
    started.hangs = True
    started.guard.close()
    assert started.killed == 1
    assert started.waited == [5.0, None]
