"""Errors of the service: a refused request, a database that does not answer, and their log."""

from __future__ import annotations

import logging
import re

from aerodaas.errors import AeroDaaSError

__all__ = ["RefusedError", "RepeatedErrorLog", "StoreError", "without_folders"]

_FOLDERS = re.compile(r"(?<![\w/:.~-])/(?:[^\s/'\":;,()]+/)+")
"""The folders of an absolute path, up to its last part."""


def without_folders(text: str) -> str:
    """A text for users, which the provider's folders are no business of: paths by their last part.

    Addresses (`https://…`) stay.
    """
    return _FOLDERS.sub("", text)


class RefusedError(AeroDaaSError):
    """A request is not carried out.

    Attributes:
        status: HTTP status of the answer.
        text: Why, and the remedy.
        retry_after: Seconds after which the same request may succeed; None if it never will.
    """

    exit_code = 2

    def __init__(self, status: int, text: str, retry_after: float | None = None) -> None:
        """Refuse with HTTP `status` and `text`."""
        super().__init__(text)
        self.status = status
        self.text = text
        self.retry_after = retry_after

    def __reduce__(self) -> tuple[type[RefusedError], tuple[int, str, float | None]]:
        """Pickle by the constructor's own arguments: errors cross process boundaries."""
        return (type(self), (self.status, self.text, self.retry_after))


class StoreError(AeroDaaSError):
    """The database is full, missing, locked, out of reach or of another version."""


class RepeatedErrorLog:
    """Logs each errors of what is tried many times a second once, for as long as it is the same.

    For one thread.
    """

    def __init__(self, log: logging.Logger) -> None:
        """Write to `log`."""
        self._log = log
        self._logged: dict[str, str] = {}

    def log_error(self, subject: str, error: Exception, *, trace: bool = False) -> None:
        """Log a subject's trouble, unless it is known already.

        Args:
            subject: What has the trouble.
            error: The trouble.
            trace: Whether its traceback is logged.
        """
        said = f"{type(error).__name__}: {error}"
        if self._logged.get(subject) != said:
            self._logged[subject] = said
            self._log.warning("%s: %s", subject, error, exc_info=error if trace else None)

    def log_recovery(self, subject: str) -> None:
        """Log that a subject's errors is over, if it had any."""
        if self._logged.pop(subject, None) is not None:
            self._log.warning("%s: goes on", subject)
