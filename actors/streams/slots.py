"""Memory of large messages: slots of one anonymous file, written by a publisher, mapped by readers.

A slot is used again once no reader holds it, the one freed last first: its pages are in the caches
and mapped everywhere. The file (`memfd`) has no name and goes with the last process that maps it;
it is sealed against shrinking, so that no mapping can lose its pages.
"""

from __future__ import annotations

import fcntl
import mmap
import os
from dataclasses import dataclass
from io import FileIO

import numpy as np
from numpy.typing import NDArray

__all__ = ["Slot", "SlotPool", "map_slot"]

_SMALLEST = 1 << 16
"""Bytes of the smallest slot."""
_MOST = 1 << 30
"""Most bytes of a publisher's slots together; pages that were never written take no memory."""


@dataclass(eq=False)
class Slot:
    """Part of a pool's file."""

    offset: int
    memory: memoryview
    users: int = 0
    """Number of readers that were sent it and have not given it back."""


class SlotPool:
    """The slots of one publisher."""

    def __init__(self) -> None:
        """Create an empty file. Raises OSError if the system grants none."""
        self.file = FileIO(
            os.memfd_create("aerodaas-stream", os.MFD_CLOEXEC | os.MFD_ALLOW_SEALING), "r+"
        )
        fcntl.fcntl(self.file, fcntl.F_ADD_SEALS, fcntl.F_SEAL_SHRINK | fcntl.F_SEAL_SEAL)
        self._free: list[Slot] = []
        self._end = 0

    def acquire(self, size: int) -> Slot | None:
        """Return a slot of at least `size` bytes for writing; None if the pool has no more.

        Raises OSError if the system grants no more memory.
        """
        for index in range(len(self._free) - 1, -1, -1):
            if len(self._free[index].memory) >= size:
                return self._free.pop(index)
        capacity = max(_SMALLEST, 1 << (size - 1).bit_length())
        if self._end + capacity > _MOST:
            return None
        self.file.truncate(self._end + capacity)
        memory = mmap.mmap(self.file.fileno(), capacity, offset=self._end)
        slot = Slot(self._end, memoryview(memory))
        self._end += capacity
        return slot

    def put_back(self, slot: Slot) -> None:
        """Free a slot that has no users."""
        self._free.append(slot)

    def close(self) -> None:
        """Close the file; mappings of readers stay as they are."""
        self.file.close()


def map_slot(fd: int, offset: int, capacity: int) -> NDArray[np.uint8]:
    """Map a slot of a publisher's file for reading.

    Args:
        fd: Descriptor of the file.
        offset: Begin of the slot, bytes.
        capacity: Size of the slot, bytes.

    Raises:
        ValueError: If the file has no such slot.
    """
    memory = mmap.mmap(fd, capacity, prot=mmap.PROT_READ, offset=offset)
    return np.frombuffer(memory, np.uint8)
