"""The fuzzing harness tells a target that raises, hangs, crashes or takes all memory."""

from __future__ import annotations

import time

import pytest

from tools.fuzz import limits
from tools.fuzz.campaign import Result, fuzz, replay
from tools.fuzz.finding import Finding
from tools.fuzz.limits import Limits, TooLongError

_TARGET = "tests.fuzz.broken_target"
_LIMITS = Limits(seconds=0.5, wall=1.5, memory=2**26)


@pytest.fixture(scope="module")
def replayed() -> Result:
    """One input for each way of failing, harmless ones at both ends."""
    return replay(_TARGET, [b"-", *(bytes([way]) + b"__!" for way in b"rdlbnmsax"), b"-"], _LIMITS)


@pytest.mark.slow
def test_every_input_is_run_whatever_the_others_do(replayed: Result) -> None:
    """Crashes and hangs end a process, not the campaign."""
    assert replayed.inputs == 11


@pytest.mark.slow
@pytest.mark.parametrize(
    ("way", "kind", "title"),
    [
        ("r", "exception", "KeyError"),
        ("d", "exception", "RecursionError"),
        ("l", "hang", "stuck"),
        ("b", "hang", "TooLongError"),
        ("n", "hang", "TooLongError"),
        ("m", "memory", "MemoryError"),
        ("s", "crash", "SIGSEGV"),
        ("a", "crash", "SIGABRT"),
        ("x", "exception", "SystemExit"),
    ],
)
def test_each_way_of_failing_is_told_with_its_input(
    replayed: Result, way: str, kind: str, title: str
) -> None:
    """Its kind, what was raised and where in the target."""
    (found,) = (one for one in replayed.findings if one.data[:1] == way.encode())
    assert found.kind == kind
    assert title in found.title
    assert "broken_target.py" in found.trace


@pytest.mark.slow
def test_a_finding_is_made_smaller(replayed: Result) -> None:
    """Down to the bytes without which it fails in another way, or not at all."""
    assert b"r!" in {one.data for one in replayed.findings}


def test_a_threads_failure_is_a_finding() -> None:
    """Though nothing escapes from the call itself."""
    (found,) = replay(_TARGET, [b"t"], _LIMITS).findings
    assert "RecursionError" in found.title


@pytest.mark.parametrize("starved", [True, False])
def test_a_busy_machine_is_no_hang(monkeypatch: pytest.MonkeyPatch, starved: bool) -> None:  # noqa: FBT001
    """Time without a processor, though ready to run, does not count; any other does."""
    if starved:
        monkeypatch.setattr(limits, "kept_waiting", time.monotonic)
    alarm = limits.Alarm(Limits(seconds=60.0, wall=0.1))
    struck = False
    try:
        with alarm.set():
            time.sleep(1.0)
    except TooLongError:
        struck = True
    assert struck is not starved


def test_time_without_a_processor_is_read() -> None:
    """Of this process; none of one that is not there."""
    assert limits.kept_waiting() > 0
    assert limits.kept_waiting(2**22 + 1) == 0.0


def test_a_finding_is_told_when_it_is_met() -> None:
    """A campaign of hours may be interrupted at any time, or killed."""
    told: list[Finding] = []

    def stop(_result: Result) -> None:
        if told:
            raise KeyboardInterrupt

    result = fuzz(f"{_TARGET}_by_luck", seconds=600.0, seed=5, progress=stop, found=told.append)
    assert result.interrupted
    assert result.findings == told
    assert len(told) == 1
    assert result.inputs > 0


def test_mutation_finds_a_failure_and_tells_it_once() -> None:
    """From a harmless seed, by itself; the same seed makes the same inputs."""
    runs = [fuzz(f"{_TARGET}_by_luck", inputs=3000, seed=5) for _ in range(2)]
    first, second = ([one.data for one in run.findings] for run in runs)
    assert len(first) == 1
    assert first == second
    assert all(run.inputs == 3000 for run in runs)
