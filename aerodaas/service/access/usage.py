"""Usage of missions as a table."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable
from datetime import datetime, timezone

from aerodaas.protocol.schemas import UsageOut
from aerodaas.recording.new_file import harmless
from aerodaas.service.store import Usage

__all__ = ["usage_csv"]

_COLUMNS = tuple(UsageOut.model_fields)


def usage_csv(rows: Iterable[Usage]) -> str:
    """Rows as CSV with a header; `compute_seconds` is the sum over all resources.

    Moments are ISO 8601 in UTC. Spreadsheets take no text of it for a formula.
    """
    text = io.StringIO(newline="")
    writer = csv.writer(text)
    writer.writerow(_COLUMNS)
    for row in rows:
        cells = {name: getattr(row, name) for name in _COLUMNS}
        cells["started"] = datetime.fromtimestamp(row.started, timezone.utc).isoformat()
        cells["compute_seconds"] = sum(row.compute_seconds.values())
        writer.writerow(map(harmless, cells.values()))
    return text.getvalue()
