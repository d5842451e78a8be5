"""What a process asks of the operating system: each measure where granted, and told where not."""

from __future__ import annotations

import gc
import os
import resource
import subprocess
import sys
import threading

import pytest

from aerodaas.actors.priority import SWITCH, punctual


def run(code: str, **environment: str) -> str:
    """What a process of its own prints."""
    done = subprocess.run(
        [
            sys.executable,
            "-c",
            f"from aerodaas.actors.priority import *\nimport os, threading\n{code}",
        ],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, **environment},
    )
    return done.stdout.strip()


_OTHERS = """
go = threading.Event()
found = []
def other():
    go.wait()
    found.append(niceness())
thread = threading.Thread(target=other)
thread.start()
be_nice(7)
be_nice(3)
go.set()
thread.join()
print(niceness(), found[0])
"""


def test_all_threads_of_a_process_become_nice_and_never_less() -> None:
    """Those that were there before, too: Linux knows niceness by thread."""
    assert run(_OTHERS) == "7 7"


def test_scheduling_is_left_alone_where_that_is_asked_for() -> None:
    """By an environment variable."""
    assert run(_OTHERS, **{SWITCH: "off"}) == "0 0"
    assert run("with punctual() as refused: import gc; print(gc.isenabled())", **{SWITCH: "off"})


def test_niceness_is_raised_back_or_said_to_be_what_it_is() -> None:
    """Where the limits allow it, as for root; elsewhere the answer is the niceness there is."""
    may = os.geteuid() == 0 or resource.getrlimit(resource.RLIMIT_NICE)[0] >= 20
    said = run("os.setpriority(os.PRIO_PROCESS, 0, 9)\nprint(raise_niceness(), niceness())")
    assert said == ("0 0" if may else "9 9")


def test_garbage_waits_while_a_loop_is_punctual(monkeypatch: pytest.MonkeyPatch) -> None:
    """And is collected again afterwards, with all else as it was; a loop that raises included."""
    monkeypatch.delenv(SWITCH, raising=False)
    interval, scheduling = sys.getswitchinterval(), os.sched_getscheduler(0)

    def loop() -> None:
        with punctual() as refused:
            assert all(isinstance(why, str) and why for why in refused)
            assert not gc.isenabled()
            assert gc.get_freeze_count() > 0
            assert sys.getswitchinterval() <= interval

    thread = threading.Thread(target=loop)
    thread.start()
    thread.join()
    with pytest.raises(ZeroDivisionError), punctual():
        raise ZeroDivisionError
    assert gc.isenabled()
    assert sys.getswitchinterval() == interval
    assert os.sched_getscheduler(0) == scheduling
