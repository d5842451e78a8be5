"""Makes the input of a finding smaller, as long as it fails in the same way."""

from __future__ import annotations

import time
from collections.abc import Callable

from tools.fuzz.finding import Finding

__all__ = ["smaller"]

_TRIES = 400
_SECONDS = 3.0


def smaller(finding: Finding, attempt: Callable[[bytes], Finding | None]) -> Finding:
    """Remove blocks of the input, the large ones first, while `attempt` finds the same.

    Hangs and exhausted memory are left as they are: each try would cost the whole limit.
    """
    if finding.kind != "exception":
        return finding
    tries, end = 0, time.monotonic() + _SECONDS
    block = max(1, len(finding.data) // 2)
    while True:
        start = 0
        while start < len(finding.data):
            if tries >= _TRIES or time.monotonic() > end:
                return finding
            tries += 1
            found = attempt(finding.data[:start] + finding.data[start + block :])
            if found is not None and found.signature == finding.signature:
                finding = found
            else:
                start += block
        if block == 1:
            return finding
        block //= 2
