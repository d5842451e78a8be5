"""Runs of one application with several seeds, side by side, each in a process of its own.

All share one local Ray: one for each would cost 5 s of a core and 200 MB more.
"""

from __future__ import annotations

import contextlib
import json
import os
import pickle
import select
import signal
import subprocess
import sys
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from typing_extensions import Self

from aerodaas.actors.cluster.local_ray import LocalRay
from aerodaas.actors.cluster.ray_variables import LOCAL_VARIABLES
from aerodaas.cli.seeds.job import OUTPUT, Job
from aerodaas.environment.signals import raise_on_signals
from aerodaas.recording.report.report import SUMMARY
from aerodaas.types.errors import ConfigError, RecordingError

__all__ = ["SeededRun", "fly_seeds"]

_WRONG_INPUT = 2
"""Exit code of a run whose input is wrong, and so that of all others."""


@dataclass(frozen=True)
class SeededRun:
    """What came out of one run."""

    seed: int
    folder: Path
    """Where its recording is, its figures, and what it printed."""
    failure: str = ""
    """Why it failed; empty for one that has flown to its end."""
    summary: dict[str, Any] | None = None
    """Figures, as in `summary.json`; None without a recording."""


def fly_seeds(
    job: Job, seeds: Iterable[int], jobs: int, done: Callable[[SeededRun], None]
) -> list[SeededRun]:
    """Fly `job` once for each seed, `jobs` at a time; a run that fails ends no other one.

    Args:
        job: What to fly; its `options.record` is the folder that gets a folder for each run.
        seeds: Seeds of the simulation, each once.
        jobs: Most runs at a time, 1 or more.
        done: Told of each run that has ended.

    Returns:
        The runs, in the order of `seeds`.

    Raises:
        ConfigError: With the reason of the first run whose input is wrong, as it is for all.
        AeroDaaSError: If Ray does not start.
        KeyboardInterrupt: After Ctrl-C, once all runs have landed and ended.
    """
    seeds = list(seeds)
    ended: dict[int, SeededRun] = {}
    with _shared_ray(job.options.address) as address, _Processes() as flying:
        job = replace(job, options=replace(job.options, address=address))
        waiting = deque(seeds)
        while waiting or flying:
            while waiting and len(flying) < jobs:
                flying.start(job.with_seed(waiting.popleft()))
            for run in flying.await_end():
                ended[run.seed] = run
                done(run)
    return [ended[seed] for seed in seeds]


@contextlib.contextmanager
def _shared_ray(address: str | None) -> Iterator[str]:
    """Address of a Ray for all runs: the one that is asked for, or a local one meanwhile."""
    joined = address or os.environ.get("RAY_ADDRESS")
    if joined:
        yield joined
        return
    ray = LocalRay(LOCAL_VARIABLES)
    try:
        yield ray.address
    finally:
        ray.end()


class _Processes:
    """The processes under way; a context manager, whose exit interrupts and awaits them."""

    def __init__(self) -> None:
        self._flying: dict[int, tuple[subprocess.Popen[bytes], Job]] = {}
        """By the descriptor of their answer."""

    def __len__(self) -> int:
        return len(self._flying)

    def __enter__(self) -> Self:
        raise_on_signals()
        return self

    def __exit__(self, *_: object) -> None:
        processes = [process for process, job in self._flying.values()]
        self._flying.clear()
        while any(process.poll() is None for process in processes):
            for process in processes:
                process.send_signal(signal.SIGINT)
            # Ctrl-C once more interrupts them once more: then they end without landing.
            with contextlib.suppress(KeyboardInterrupt):
                for process in processes:
                    process.wait()

    def start(self, job: Job) -> None:
        folder = job.options.record
        assert folder is not None  # noqa: S101 - it has a seed
        try:
            folder.mkdir(parents=True, exist_ok=True)
            output = (folder / OUTPUT).open("wb")
        except OSError as error:
            raise RecordingError(f"cannot write into {folder}: {error.strerror}") from None
        with output:
            process = subprocess.Popen(
                [sys.executable, "-m", "aerodaas.cli.seeds"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=output,
                # Ctrl-C at the terminal reaches this process alone, which then tells the others.
                start_new_session=True,
            )
        assert process.stdin is not None  # noqa: S101 - asked for
        assert process.stdout is not None  # noqa: S101 - asked for
        self._flying[process.stdout.fileno()] = process, job
        with contextlib.suppress(BrokenPipeError):
            process.stdin.write(pickle.dumps(job))
            process.stdin.flush()

    def await_end(self) -> list[SeededRun]:
        """Wait until a process ends; returns the runs that have ended."""
        ready, _, _ = select.select(list(self._flying), [], [])
        return [self._end(descriptor) for descriptor in ready]

    def _end(self, descriptor: int) -> SeededRun:
        process, job = self._flying[descriptor]
        assert process.stdout is not None  # noqa: S101 - asked for
        text = process.stdout.read().decode(errors="replace")
        code = process.wait()
        del self._flying[descriptor]
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                pipe.close()
        if code == _WRONG_INPUT and text:
            raise ConfigError(text)
        folder, seed = job.options.record, job.options.seed
        assert folder is not None  # noqa: S101 - it has a seed
        assert seed is not None  # noqa: S101 - likewise
        failure = (text or f"its process ended with code {code}, see {OUTPUT}") if code else ""
        return SeededRun(seed, folder, failure, _summary(folder / SUMMARY))


def _summary(path: Path) -> dict[str, Any] | None:
    """Figures of a run; None if it was not recorded, or ended before it flew."""
    try:
        return dict(json.loads(path.read_text(encoding="utf-8")))
    except (FileNotFoundError, ValueError):
        return None
