"""Which messages of a publisher all its readers have, told to all of them at once.

Whoever acts on a message may publish something that names it, such as the task that names a frame.
To no reader may that come before the message itself. So a publisher queues a message to all, writes
its number into a page that all of them map, and rings the one bell for which all of them wait. A
reader takes nothing beyond that number, and with anything it takes whatever was complete by then.
"""

from __future__ import annotations

import fcntl
import mmap
import os
from io import FileIO

__all__ = ["Completion", "Publication"]

_PAGE = mmap.PAGESIZE


class Publication:
    """The publisher's side."""

    def __init__(self) -> None:
        """Make the page and the bell. Raises OSError without memory or descriptors."""
        flags = os.MFD_CLOEXEC | os.MFD_ALLOW_SEALING
        self.page = FileIO(os.memfd_create("aerodaas-completion", flags), "r+")
        try:
            self.page.truncate(_PAGE)
            fcntl.fcntl(self.page, fcntl.F_ADD_SEALS, fcntl.F_SEAL_SHRINK | fcntl.F_SEAL_SEAL)
            # A whole number of the processor's own size: its store is never seen half done.
            self._number = memoryview(mmap.mmap(self.page.fileno(), _PAGE)).cast("Q")
            self.bell = os.eventfd(0, os.EFD_CLOEXEC | os.EFD_NONBLOCK)
        except OSError:
            self.page.close()
            raise

    def complete(self, number: int) -> None:
        """Tell all readers that each has the messages up to `number`."""
        self._number[0] = number
        os.eventfd_write(self.bell, 1)

    def close(self) -> None:
        """Tell no more; readers keep the page and the bell."""
        self.page.close()
        os.close(self.bell)


class Completion:
    """A reader's side. It never reads the bell, which it shares: each ring is an edge."""

    def __init__(self, page: int, bell: int) -> None:
        """Map the page, whose descriptor is closed; the bell's is kept."""
        self.bell = bell
        self._number = memoryview(mmap.mmap(page, _PAGE, prot=mmap.PROT_READ)).cast("Q")
        os.close(page)

    @property
    def number(self) -> int:
        """Number of the newest message that all readers have; 0 before the first."""
        return self._number[0]

    def close(self) -> None:
        """Hear no more."""
        os.close(self.bell)
