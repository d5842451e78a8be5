"""Runs a target in processes of its own, watches them and gathers what they find."""

from __future__ import annotations

import multiprocessing
import os
import signal
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path

from tools.fuzz.blackbox import BlackBox
from tools.fuzz.finding import Finding, by_fault
from tools.fuzz.limits import Limits, kept_waiting
from tools.fuzz.worker import Done, Job, work

__all__ = ["Result", "fuzz", "replay"]

_PERIOD = 0.1
_START = 120.0
"""Seconds that a target has to be imported."""
_GRACE = 5.0
"""Seconds after an input's own limit from which on a worker is taken to hang in native code."""
_MOST = 20
"""Findings after which a target is left."""
_SPAWN = multiprocessing.get_context("spawn")


@dataclass
class Result:
    """What came of one target."""

    target: str
    inputs: int = 0
    seconds: float = 0.0
    growth: int = 0
    """Bytes by which the memory of the worker that grew most did so."""
    findings: list[Finding] = field(default_factory=list)
    found: Callable[[Finding], None] = field(default=lambda _: None, repr=False)
    """Called with each finding when it is met, for a campaign of hours can end at any time."""
    interrupted: bool = False
    """Whether it was ended from the keyboard: what it has found until then is here."""

    def add(self, finding: Finding) -> None:
        """Keep a finding unless an equal one is known."""
        if all(finding.signature != known.signature for known in self.findings):
            self.findings.append(finding)
            self.found(finding)


def fuzz(
    target: str,
    *,
    inputs: int | None = None,
    seconds: float | None = None,
    seed: int = 0,
    jobs: int = 1,
    limits: Limits | None = None,
    progress: Callable[[Result], None] = lambda _: None,
    found: Callable[[Finding], None] = lambda _: None,
) -> Result:
    """Feed a target with its pool and mutations of it.

    Args:
        target: Its name.
        inputs: How many inputs, all workers together.
        seconds: How long; seeds and corpus are run even if that takes longer. Whatever comes first
            ends it.
        seed: The same one makes the same inputs with the same number of jobs.
        jobs: Workers at once.
        limits: Of one input.
        progress: Called a few times a second.
        found: Called with each finding when it is met.

    Returns what was found, also if it is interrupted (Ctrl-C).
    """
    deadline = None if seconds is None else time.monotonic() + seconds
    each = None if inputs is None else -(-inputs // jobs)
    with _folder() as folder:
        plans = [
            Job(
                target,
                folder / f"{index}.box",
                folder / f"{index}.log",
                f"{seed}/{index}",
                inputs=each,
                deadline=deadline,
                limits=limits or Limits(),
            )
            for index in range(jobs)
        ]
        return _watched(Result(target, found=found), plans, progress)


def replay(
    target: str,
    inputs: Sequence[bytes],
    limits: Limits | None = None,
    found: Callable[[Finding], None] = lambda _: None,
) -> Result:
    """Run inputs as they are, all of them, whatever the first ones do."""
    with _folder() as folder:
        box, log = folder / "replay.box", folder / "replay.log"
        job = Job(target, box, log, "", limits=limits or Limits(), fixed=tuple(inputs))
        return _watched(Result(target, found=found), [job], lambda _: None)


@contextmanager
def _folder() -> Iterator[Path]:
    with tempfile.TemporaryDirectory(prefix="aerodaas-fuzz-") as name:
        yield Path(name)


def _watched(result: Result, jobs: list[Job], progress: Callable[[Result], None]) -> Result:
    begun = time.monotonic()
    watchers = [_Watcher(job, result) for job in jobs]
    try:
        while any([watcher.step() for watcher in watchers]):  # noqa: C419 - all of them
            result.inputs = sum(watcher.number for watcher in watchers)
            result.seconds = time.monotonic() - begun
            progress(result)
            if len(result.findings) >= _MOST:
                break
            time.sleep(_PERIOD)
    except KeyboardInterrupt:
        result.interrupted = True
    finally:
        result.inputs = sum(watcher.number for watcher in watchers)
        result.seconds = time.monotonic() - begun
        for watcher in watchers:
            watcher.close()
    return result


class _Watcher:
    """One worker at a time for a job: started again after the input that ended it."""

    def __init__(self, job: Job, result: Result) -> None:
        self._job = job
        self._result = result
        self._box = BlackBox(job.box)
        self._steps = 0
        self._over = False
        self._patience = _GRACE + job.limits.wall
        self._process: BaseProcess
        self._connection: Connection
        self._start()

    @property
    def number(self) -> int:
        """Inputs that were run."""
        return self._box.read()[1] + 1 if self._box.steps else 0

    def step(self) -> bool:
        """Take in what the worker says; whether it goes on."""
        if self._over:
            return False
        alive = self._process.is_alive()
        try:
            while self._connection.poll():
                told = self._connection.recv()
                if isinstance(told, Finding):
                    self._result.add(told)
                elif isinstance(told, Done):
                    return self._done(told)
        except (EOFError, OSError):
            alive = False
            self._process.join(_GRACE)
        if not alive:
            return self._ended("crash", _how(self._process.exitcode))
        steps = self._box.steps
        if steps != self._steps:
            self._steps, self._seen = steps, self._time()
        elif self._time() - self._seen > (self._patience if steps != self._before else _START):
            os.kill(self._process.pid or 0, signal.SIGABRT)  # its handler writes a traceback
            self._process.join(_GRACE)
            return self._ended("hang", "stuck outside Python")
        return True

    def _time(self) -> float:
        """Seconds by the wall, without those in which the worker waited for a processor."""
        return time.monotonic() - kept_waiting(self._process.pid)

    def close(self) -> None:
        self._end()
        self._box.close()

    def _start(self) -> None:
        self._before = self._steps = self._box.steps
        self._connection, theirs = _SPAWN.Pipe()
        self._process = _SPAWN.Process(target=work, args=(self._job, theirs), daemon=True)
        self._process.start()
        self._seen = self._time()
        theirs.close()

    def _end(self) -> None:
        self._process.kill()
        self._process.join()
        self._connection.close()

    def _done(self, done: Done) -> bool:
        self._result.growth = max(self._result.growth, done.growth)
        return self._again(done.number)

    def _ended(self, kind: str, how: str) -> bool:
        """Report the input that ended a worker, and go on after it."""
        log = self._job.log.read_text(encoding="utf-8", errors="replace")
        steps, number, data = self._box.read()
        if steps == self._before:
            raise RuntimeError(f"target {self._job.target} could not be started: {how}\n{log}")
        self._result.add(by_fault("hang" if kind == "hang" else "crash", how, log[-8000:], data))
        return self._again(number + 1)

    def _again(self, number: int) -> bool:
        self._end()
        job = self._job
        last = job.inputs if job.fixed is None else len(job.fixed)
        late = job.deadline is not None and time.monotonic() > job.deadline
        if late or (last is not None and number >= last):
            self._over = True
            return False
        job.log.write_bytes(b"")
        self._job = replace(job, first=number)
        self._start()
        return True


def _how(code: int | None) -> str:
    if code is not None and code < 0:
        return f"ended by {signal.Signals(-code).name}"
    return f"ended with exit code {code}"
