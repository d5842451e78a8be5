"""Processes that end with the one that started them, whatever ends that."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import psutil
import pytest
from waiting import until

STARTED = """
import subprocess, sys, time
from aerodaas.service.flights.folder import end_with_starter
end_with_starter()
own = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
print(own.pid, flush=True)
time.sleep(600)
"""
STARTER = f"""
import subprocess, sys, time
started = subprocess.Popen(
    [sys.executable, "-c", {STARTED!r}],
    stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True, text=True,
)
# Others that it starts hold no end of the pipe.
other = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
print(started.pid, started.stdout.readline().strip(), other.pid, flush=True)
time.sleep(600)
"""
SECONDS = 30.0


def gone(process: psutil.Process) -> bool:
    """Whether a process has ended; nobody may have asked how."""
    try:
        return bool(process.status() == psutil.STATUS_ZOMBIE)
    except psutil.NoSuchProcess:
        return True


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_a_tied_process_ends_with_its_starter_and_takes_its_own_along(number: int) -> None:
    """What the starter has started otherwise goes on."""
    with subprocess.Popen(
        [sys.executable, "-c", STARTER], stdout=subprocess.PIPE, text=True
    ) as starter:
        assert starter.stdout is not None
        tied, tied_own, other = map(psutil.Process, map(int, starter.stdout.readline().split()))
        try:
            time.sleep(0.5)
            assert not any(map(gone, (tied, tied_own, other)))
            os.kill(starter.pid, number)
            starter.wait(SECONDS)
            until(lambda: gone(tied) and gone(tied_own), SECONDS)
            assert not gone(other)
        finally:
            for process in (tied, tied_own, other):
                if not gone(process):
                    process.kill()
