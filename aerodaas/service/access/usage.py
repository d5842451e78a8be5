"""What missions have used, as a table."""

from __future__ import annotations

from collections.abc import Iterable

from aerodaas.protocol.schemas import UsageOut
from aerodaas.service.store import Usage

__all__ = ["usage_csv", "usage_out"]


def usage_out(usage: Usage) -> UsageOut:
    """A row as the HTTP interface shows it."""
    raise NotImplementedError


def usage_csv(rows: Iterable[Usage]) -> str:
    """Rows as CSV with a header; compute seconds are their sum over all resources.

    Spreadsheets take no text of it for a formula.
    """
    raise NotImplementedError
