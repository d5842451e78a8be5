"""Local Ray of an application, which outlives it until the last drone has landed.

A supervisor process keeps it (`ray_process.py`). After the end of the application, for any
reason, the supervisor waits until no drone flies, then ends exactly the processes that it
started.
"""

from __future__ import annotations

import json
import os
import secrets
import subprocess
import sys
import threading
from collections.abc import Mapping
from pathlib import Path
from queue import Empty, Queue

from aerodaas.types.errors import AeroDaaSError

__all__ = ["LocalRay"]

_STORE_BYTES = 128 * 2**20
"""Bytes of Ray's object store; streams use shared memory of their own."""
_ADDRESS = "127.0.0.2"
"""Loopback address, so that a lost Wi-Fi breaks no connection. Ray replaces 127.0.0.1 by an
address of the machine's network."""
_START_SECONDS = 400.0
_END_SECONDS = 20.0
_KEEPER = Path(__file__).with_name("ray_process.py")
_OPTIONS = (
    *("--head", "--port=0", f"--node-ip-address={_ADDRESS}"),
    *("--include-dashboard=false", "--include-log-monitor=false", "--disable-usage-stats"),
    *(f"--object-store-memory={_STORE_BYTES}", '--resources={"edge": 1, "cloud": 1}'),
)


class LocalRay:
    """Local Ray that starts in the background; `address` waits until it is ready."""

    node_address = _ADDRESS

    def __init__(self, variables: Mapping[str, str]) -> None:
        """Start Ray with `variables` as defaults of the environment; returns at once."""
        make_token()
        command = [sys.executable, "-I", "-S", str(_KEEPER), str(os.getpid()), *_OPTIONS]
        self._process = subprocess.Popen(  # noqa: S603 - our own file
            [*command, f"--num-cpus={os.cpu_count()}"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            env={**variables, **os.environ},
            start_new_session=True,
        )
        self._lines: Queue[str] = Queue()
        threading.Thread(target=self._listen, name="local Ray", daemon=True).start()
        self._address = ""

    @property
    def address(self) -> str:
        """Host and port of its head; waits for it. Raises AeroDaaSError if it does not start."""
        if not self._address:
            told = self._next(_START_SECONDS)
            if "address" not in told:
                self.end()
                raise AeroDaaSError(_failure(str(told.get("error", ""))))
            self._address = str(told["address"])
        return self._address

    def end(self) -> None:
        """Release Ray; returns when it has ended, or early while a drone has yet to land."""
        assert self._process.stdin is not None  # noqa: S101 - asked for
        self._process.stdin.close()
        if "flying" not in self._next(_END_SECONDS):
            self._process.wait()

    def _listen(self) -> None:
        assert self._process.stdout is not None  # noqa: S101 - asked for
        for line in self._process.stdout:
            self._lines.put(line)
        self._lines.put("{}")

    def _next(self, timeout: float) -> dict[str, object]:
        """The supervisor's next message; empty if it has ended, `flying` after the timeout."""
        try:
            return dict(json.loads(self._lines.get(timeout=timeout)))
        except Empty:
            return {"flying": True}


def _failure(reason: str) -> str:
    if "timed out" not in reason:
        return f"Ray does not start on this machine: {reason or 'its supervisor ended'}"
    load = f"{os.getloadavg()[0]:.1f} on {os.cpu_count()} cores"
    return (
        "Ray did not start within half a minute, twice: this machine is too busy "
        f"(load {load}); end other work and try again"
    )


def make_token() -> None:
    """Create the user's Ray token if missing, so that other users cannot use the local Ray."""
    named = {"RAY_AUTH_MODE", "RAY_AUTH_TOKEN", "RAY_AUTH_TOKEN_PATH"}
    path = Path.home() / ".ray" / "auth_token"
    if named & set(os.environ) or path.exists():
        return
    path.parent.mkdir(exist_ok=True)
    # Written to a file of its own and linked: two applications may start at the same time.
    own = path.with_name(f"auth_token.{os.getpid()}")
    with os.fdopen(os.open(own, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as file:
        file.write(secrets.token_hex(32))
    try:
        os.link(own, path)
    except FileExistsError:
        pass
    finally:
        own.unlink()
