"""The audit log: who did what to what, and whether it was accepted."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress

from aerodaas.mission.commands import Answer
from aerodaas.service.access.principal import Principal
from aerodaas.service.errors import StoreError
from aerodaas.service.store import AuditEntry, Store

__all__ = ["Audit"]

_LONGEST = 500
"""Characters of a text."""
_LONGEST_NAME = 100
_MOST = 1_000_000
"""Entries kept; the oldest go first."""
_TRIM_EVERY = 1000
"""Entries after which those beyond the most are dropped."""
_MOST_LATE = 1000


class Audit:
    """Writes the audit log, whose texts and number of entries are bounded. Threads may share it."""

    def __init__(
        self, store: Store, clock: Callable[[], float] = time.time, most: int = _MOST
    ) -> None:
        """Keep the newest `most` entries, or a few more, in `store`; `clock` is Unix time."""
        self._store = store
        self._clock = clock
        self._most = most
        self._lock = threading.Lock()
        self.approved_hash: Callable[[str], str] = lambda _mission: ""
        """Tells the hash by which a mission was approved; empty for one that was not proposed."""
        self._late: deque[AuditEntry] = deque(maxlen=_MOST_LATE)

    def write(
        self,
        who: Principal | None,
        action: str,
        target: str = "",
        text: str = "",
        *,
        accepted: bool,
        address: str = "",
        required: bool = True,
    ) -> None:
        """Write an entry.

        Args:
            who: Sender of the request; None without a valid token.
            action: `lease.request`, `mission.submit`, …
            target: Id of what it was done to.
            text: Details; cut at 500 characters, what cannot be printed replaced.
            accepted: Whether it was carried out.
            address: Where the request came from.
            required: Whether it must not be done unaudited. What makes a drone safe (cancel,
                return home, land) goes on without; such an entry is written with the next one.

        Raises:
            StoreError: If it is required and the database does not take it.
        """
        entry = AuditEntry(
            at=self._clock(),
            account=who.account if who else "",
            tenant=who.tenant if who else "",
            address=_bounded(address, _LONGEST_NAME),
            action=_bounded(action, _LONGEST_NAME),
            accepted=accepted,
            target=_bounded(target, _LONGEST_NAME),
            text=_bounded(text, _LONGEST),
        )
        with self._lock:
            try:
                number = self._store.audit.add(*self._late, entry)
            except StoreError:
                if required:
                    raise
                self._late.append(entry)
                return
            written = 1 + len(self._late)
            self._late.clear()
            # Whether a multiple of the interval lies among the numbers just given.
            if number % _TRIM_EVERY < written:
                with suppress(StoreError):
                    self._store.audit.trim(number - self._most + 1)

    def note_answer(self, who: Principal, action: str, target: str, answer: Answer) -> None:
        """Write what a drone answered to a command: nobody in the air waits for a disk.

        Args:
            who: The account that gave the command.
            action: Name of the command.
            target: What it was given to.
            answer: What the drone said.
        """
        said = f"{self.approved_hash(target.partition('/')[0])} {answer.text}".strip()
        action, accepted = f"mission.{action}", answer.accepted
        self.write(who, action, target, said, accepted=accepted, required=False)

    def newest(self, limit: int) -> list[AuditEntry]:
        """The newest entries, at most `limit`, newest first; raises StoreError."""
        return self._store.audit.newest(limit)


def _bounded(text: str, longest: int) -> str:
    """One line of at most so many characters, none of which commands a terminal."""
    cut = text if len(text) <= longest else f"{text[: longest - 1]}…"
    return "".join(one if one.isprintable() else "\N{REPLACEMENT CHARACTER}" for one in cut)
