"""A provider's service for benchmarks: a process of its own, in a folder that goes with it."""

from __future__ import annotations

import contextlib
import json
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from aerodaas.environment.provider.client import ProviderClient

__all__ = ["served"]

_START_SECONDS = 60.0
_EVERY = 0.02
"""Seconds between two looks at what it has said."""


@contextlib.contextmanager
def served(content: dict[str, Any], *words: str) -> Iterator[tuple[ProviderClient, str, int]]:
    """A service; yields a client with the administrator's token, the token, and the process' id."""
    with tempfile.TemporaryDirectory(prefix="load-", dir="/tmp") as temporary:
        folder = Path(temporary)
        (folder / "fleet.json").write_text(json.dumps(content), encoding="utf-8")
        command = [sys.executable, "-m", "aerodaas", "serve", str(folder / "fleet.json")]
        command += ["--state", str(folder / "s"), "--port", "0", "--no-rehearse", *words]
        with (
            (folder / "log").open("w") as log,
            subprocess.Popen(command, stdout=log, stderr=log) as process,  # noqa: S603 - ours
        ):
            try:
                said, until = "", time.monotonic() + _START_SECONDS
                while not (found := re.search(r"at (http://\S+)", said)):
                    if process.poll() is not None or time.monotonic() > until:
                        raise SystemExit(f"the service did not start: {said}")
                    time.sleep(_EVERY)
                    said = (folder / "log").read_text()
                token = re.findall(r"once: (\S+)", said)[0]
                yield ProviderClient(found[1], token), token, process.pid
            finally:
                process.terminate()
