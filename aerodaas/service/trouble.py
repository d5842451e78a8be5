"""What goes wrong again and again, logged when it begins, changes and ends."""

from __future__ import annotations

import logging

__all__ = ["TroubleLog"]


class TroubleLog:
    """Logs each trouble of what is tried many times a second once, for as long as it is the same.

    For one thread.
    """

    def __init__(self, log: logging.Logger) -> None:
        """Write to `log`."""
        self._log = log
        self._told: dict[str, str] = {}

    def tell(self, subject: str, error: Exception, *, trace: bool = False) -> None:
        """Log a subject's trouble, with its traceback if asked, unless it is known already."""
        said = f"{type(error).__name__}: {error}"
        if self._told.get(subject) != said:
            self._told[subject] = said
            self._log.warning("%s: %s", subject, error, exc_info=error if trace else None)

    def over(self, subject: str) -> None:
        """Log that a subject's trouble is over, if it had any."""
        if self._told.pop(subject, None) is not None:
            self._log.warning("%s: goes on", subject)
