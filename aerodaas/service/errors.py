"""What the service cannot do: a request that is refused, and a database that does not answer."""

from __future__ import annotations

import re

from aerodaas.errors import AeroDaaSError

__all__ = ["RefusedError", "StoreError", "without_folders"]

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
