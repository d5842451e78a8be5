"""The process that runs a target: one input after the other, each noted before it runs."""

from __future__ import annotations

import faulthandler
import os
import random
import signal
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path

from aerodaas.runtime.memory_limit import limit_memory
from tools.fuzz.blackbox import BlackBox
from tools.fuzz.coverage import Coverage
from tools.fuzz.finding import Finding, by_exception
from tools.fuzz.limits import Alarm, Limits, TooLongError, memory
from tools.fuzz.minimising import smaller
from tools.fuzz.mutation import mutated
from tools.fuzz.target import Target, load_target

__all__ = ["Done", "Job", "work"]

_LARGEST_KEPT, _MOST_KEPT = 2**14, 1000
"""Bytes and number of inputs that are mutated further because they reached something new."""
_WARM_UP = 50
"""Inputs after which memory is measured for the first time."""


@dataclass(frozen=True)
class Job:
    """What one worker is to do."""

    target: str
    box: Path
    log: Path
    seed: str
    first: int = 0
    """Number of the input to begin with: 0, or the one after that which ended a worker before."""
    inputs: int | None = None
    """Number at which to end; none ends by time only."""
    deadline: float | None = None
    """Of time.monotonic; what is given is run even then."""
    limits: Limits = field(default_factory=Limits)
    fixed: tuple[bytes, ...] | None = None
    """Inputs to run as they are, instead of mutations."""


@dataclass(frozen=True)
class Done:
    """A worker came to its end."""

    number: int
    """Of the first input that was not run."""
    growth: int
    """Bytes by which its memory grew after its first inputs."""


def work(job: Job, connection: Connection) -> None:
    """Run a job, sending each Finding and, last of all, Done."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # of the keyboard: for whoever watches
    with job.log.open("ab", buffering=0) as log:
        os.dup2(log.fileno(), 1)
        os.dup2(log.fileno(), 2)
        faulthandler.enable(log)
        worker = _Worker(job, load_target(job.target), BlackBox(job.box), connection)
        worker.run()
    connection.close()


class _Worker:
    def __init__(self, job: Job, target: Target, box: BlackBox, connection: Connection) -> None:
        self._job = job
        self._target = target
        self._box = box
        self._connection = connection
        self._pool = target.pool()
        self._given = len(self._pool)
        self._alarm = Alarm(job.limits)
        self._coverage = Coverage()
        self._number = job.first
        self._known: set[str] = set()
        self._in_thread: list[BaseException] = []
        threading.excepthook = self._note_thread

    def run(self) -> None:
        limit_memory(self._job.limits.memory)
        ground = 0
        for index, data in enumerate(self._inputs()):
            finding = self._attempt(data)
            if finding is None and self._coverage.grew:
                self._keep(data)
            if finding is not None and finding.kind == "hang":
                finding = self._attempt(data)  # a busy machine is no hang
            if finding is not None and finding.signature not in self._known:
                self._known.add(finding.signature)
                self._connection.send(smaller(finding, self._attempt))
            self._number += 1
            if index == min(_WARM_UP, self._given):
                ground = memory()
            if finding is not None and finding.kind == "memory":
                break  # what is left of this process has too little to go on
        self._connection.send(Done(self._number, memory() - ground if ground else 0))

    def _inputs(self) -> Iterator[bytes]:
        job = self._job
        if job.fixed is not None:
            yield from job.fixed[job.first :]
            return
        while job.inputs is None or self._number < job.inputs:
            late = job.deadline is not None and time.monotonic() > job.deadline
            if late and self._number >= self._given:
                return
            yield self._input(self._number)

    def _input(self, number: int) -> bytes:
        """Each that is given as it is, then mutations; the same for the same seed."""
        if number < self._given:
            return self._pool[number]
        rng = random.Random(f"{self._job.seed}/{number}")
        data = rng.choice(self._pool) if self._pool else b""
        if self._target.mutate is None:
            return mutated(data, self._pool, rng)
        if rng.random() < 0.75:  # noqa: PLR2004 - three in four know the format
            data = self._target.mutate(data, rng)
        return mutated(data, self._pool, rng) if rng.random() < 0.5 else data  # noqa: PLR2004

    def _keep(self, data: bytes) -> None:
        """Mutate this input further, too."""
        known = self._number < self._given or len(data) > _LARGEST_KEPT
        if not known and len(self._pool) < self._given + _MOST_KEPT:
            self._pool.append(data)

    def _attempt(self, data: bytes) -> Finding | None:
        """Run one input; what escapes from the target, or from a thread of its own."""
        self._box.record(self._number, data)
        self._in_thread.clear()
        try:
            with self._alarm.set(), self._coverage.watch():
                self._target.run(data)
        except TooLongError as error:
            return by_exception("hang", error, data)
        except MemoryError as error:
            return by_exception("memory", error, data)
        except BaseException as error:  # noqa: BLE001 - SystemExit is a finding, too
            return by_exception("exception", error, data)
        if self._in_thread:
            return by_exception("exception", self._in_thread[0], data)
        return None

    def _note_thread(self, failure: threading.ExceptHookArgs) -> None:
        if failure.exc_value is not None:
            self._in_thread.append(failure.exc_value)
