"""A bound on the memory of this process."""

from __future__ import annotations

import resource
from pathlib import Path

__all__ = ["limit_memory"]

_STATUS = Path("/proc/self/status")


def limit_memory(more: int) -> None:
    """Let this process allocate `more` bytes on top of what it has, threads' stacks included.

    Beyond, an allocation fails, in Python by MemoryError. A lower limit stays; without Linux'
    `/proc`, nothing is limited.
    """
    if not _STATUS.exists():
        return
    words = _STATUS.read_text(encoding="ascii").split()
    wanted = int(words[words.index("VmData:") + 1]) * 1024 + more
    soft, hard = resource.getrlimit(resource.RLIMIT_DATA)
    if soft == resource.RLIM_INFINITY or wanted < soft:
        resource.setrlimit(resource.RLIMIT_DATA, (wanted, hard))
