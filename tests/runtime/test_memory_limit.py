"""A process that has a bound on its memory keeps to it."""

from __future__ import annotations

import subprocess
import sys

_PROGRAM = """
import resource
from aerodaas.runtime.memory_limit import limit_memory

limit_memory(1 << 26)
first = resource.getrlimit(resource.RLIMIT_DATA)[0]
limit_memory(1 << 30)
assert resource.getrlimit(resource.RLIMIT_DATA)[0] == first
small = bytearray(1 << 24)
try:
    bytearray(1 << 27)
except MemoryError:
    print("bounded")
"""


def test_more_than_the_bound_is_not_allocated_and_the_least_bound_stays() -> None:
    """In a process of its own, as a bound cannot be taken back."""
    command = [sys.executable, "-c", _PROGRAM]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout == "bounded\n"
