"""Runs of one application with several seeds, side by side, each in a process of its own.

A run inherits nothing of another one, as an application's modules may keep state.
"""

from __future__ import annotations

import contextlib
import json
import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from pathlib import Path
from typing import Any

from aerodaas.cli.failure import Failure, failure_of, show_failure
from aerodaas.cli.flying.application import run_application
from aerodaas.config.options import RunOptions
from aerodaas.environment.signals import heed_interrupts, raise_on_signals
from aerodaas.errors import ConfigError, IncompleteError, RecordingError
from aerodaas.recording.report.report import SUMMARY

__all__ = ["ApplicationRun", "SeededRun", "fly_seeds"]

_OUTPUT = "output.txt"
"""Name of the file, beside the recording, with what a run has printed."""
_WRONG_INPUT = 2
"""Exit code of a run whose input is wrong, and so that of all others."""


@dataclass(frozen=True)
class ApplicationRun:
    """An application with its arguments and the options of a run."""

    application: Path
    words: list[str]
    """Arguments of the application."""
    options: RunOptions

    def with_seed(self, seed: int) -> ApplicationRun:
        """Copy of the run with `seed`, recorded in a folder below `options.record`."""
        assert self.options.record is not None  # noqa: S101 - `fly_seeds` needs it
        folder = self.options.record / f"seed-{seed}"
        return replace(self, options=replace(self.options, seed=seed, record=folder))


@dataclass(frozen=True)
class SeededRun:
    """Result of one run."""

    seed: int
    folder: Path
    """Where its recording is, its figures, and what it printed."""
    failure: str = ""
    """Why it failed; empty for one that has flown to its end."""
    summary: dict[str, Any] | None = None
    """Figures, as in `summary.json`; None without a recording."""


def fly_seeds(
    run: ApplicationRun, seeds: Sequence[int], jobs: int, done: Callable[[SeededRun], None]
) -> list[SeededRun]:
    """Fly `run` once for each seed, `jobs` at a time; a run that fails ends no other one.

    Args:
        run: What to fly; its `options.record` is the folder that gets a folder for each seed.
        seeds: Seeds of the simulation, each once.
        jobs: Most runs at a time, 1 or more.
        done: Called with each run that has ended.

    Returns:
        The runs, in the order of `seeds`.

    Raises:
        ConfigError: With the reason of the first run whose input is wrong, as it is for all.
        KeyboardInterrupt: After Ctrl-C, once all runs have landed and ended.
    """
    raise_on_signals()
    ended: dict[int, SeededRun] = {}
    waiting = deque(seeds)
    flying: dict[Connection, tuple[SpawnProcess, int, Path]] = {}
    try:
        while waiting or flying:
            while waiting and len(flying) < jobs:
                seed = waiting.popleft()
                answer, process, folder = _start(run.with_seed(seed))
                flying[answer] = process, seed, folder
            ready = wait(list(flying))
            for answer in [answer for answer in flying if answer in ready]:
                process, seed, folder = flying[answer]
                failure = _failure(answer, process)
                del flying[answer]
                summary = _summary(folder / SUMMARY)
                ended[seed] = SeededRun(seed, folder, failure, summary)
                done(ended[seed])
    finally:
        _interrupt([process for process, _, _ in flying.values()])
    return [ended[seed] for seed in seeds]


def _start(run: ApplicationRun) -> tuple[Connection, SpawnProcess, Path]:
    """Start the process of a run: its answer, itself, and the folder of the recording."""
    folder = run.options.record
    assert folder is not None  # noqa: S101 - it has a seed
    try:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / _OUTPUT).touch()
    except OSError as error:
        raise RecordingError(f"cannot write into {folder}: {error.strerror}") from None
    spawn = multiprocessing.get_context("spawn")
    answer, answering = spawn.Pipe(duplex=False)
    process = spawn.Process(target=_fly, args=(run, folder / _OUTPUT, answering))
    process.start()
    # The process now holds its only other end, so that its end is the end of the answer.
    answering.close()
    return answer, process, folder


def _failure(answer: Connection, process: SpawnProcess) -> str:
    """Why a run failed, once its process has answered or ended; empty if it did not.

    Raises ConfigError for a wrong input.
    """
    with answer:
        try:
            failure: Failure | None = answer.recv()
        except EOFError:
            failure = None
    process.join()
    if failure is None:
        code = process.exitcode
        return f"its process ended with code {code}, see {_OUTPUT}" if code else ""
    if failure.code == _WRONG_INPUT:
        raise ConfigError(failure.text)
    return failure.text


def _interrupt(processes: Sequence[SpawnProcess]) -> None:
    """Have the drones of these processes land, and wait for their ends."""
    while alive := [process for process in processes if process.is_alive()]:
        for process in alive:
            assert process.pid is not None  # noqa: S101 - started
            os.kill(process.pid, signal.SIGINT)
        # Ctrl-C once more interrupts them once more: then they end without landing.
        with contextlib.suppress(KeyboardInterrupt):
            for process in alive:
                process.join()


def _fly(run: ApplicationRun, output: Path, answer: Connection) -> None:
    """Fly in a process of its own; the exit code is that of `aerodaas run`.

    An incomplete mission is no failure here: it is an outcome among others of the seeds, with
    figures of its own.
    """
    # Ctrl-C at the terminal reaches the command alone, which then interrupts the runs.
    os.setsid()
    heed_interrupts()
    threading.Thread(target=_end_with_parent, name="tie", daemon=True).start()
    printed = os.open(output, os.O_WRONLY | os.O_TRUNC)
    os.dup2(printed, 1)
    os.dup2(printed, 2)
    try:
        run_application(run.application, run.words, run.options)
    except IncompleteError as error:
        show_failure(failure_of(error))
    except KeyboardInterrupt:
        raise SystemExit(128 + signal.SIGINT) from None
    except Exception as error:  # noqa: BLE001 - the application may raise anything
        failure = failure_of(error)
        show_failure(failure)
        answer.send(failure)
        raise SystemExit(failure.code) from None


def _end_with_parent() -> None:
    """End this process and its children once the command has ended, however it did."""
    parent = multiprocessing.parent_process()
    assert parent is not None  # noqa: S101 - `_fly` runs in a child
    parent.join()
    os.killpg(os.getpgrp(), signal.SIGKILL)


def _summary(path: Path) -> dict[str, Any] | None:
    """Figures of a run; None if it was not recorded, or ended before it flew."""
    try:
        return dict(json.loads(path.read_text(encoding="utf-8")))
    except (FileNotFoundError, ValueError):
        return None
