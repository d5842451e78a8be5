"""The local Ray of an application: started for it alone, and by no means ended with it.

A process of its own keeps it (`ray_process.py`). When the application has gone, for whatever
reason, that waits until no drone flies any more, then ends exactly the processes that it started.
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
"""Object store; streams travel in shared memory of their own."""
_ADDRESS = "127.0.0.2"
"""Of the loopback interface, so that a Wi-Fi that goes away takes no connection with it. Ray
replaces 127.0.0.1 by an address of the machine's network."""
_START_SECONDS = 400.0
_END_SECONDS = 20.0
_KEEPER = Path(__file__).with_name("ray_process.py")
_OPTIONS = (
    *("--head", "--port=0", f"--node-ip-address={_ADDRESS}"),
    *("--include-dashboard=false", "--include-log-monitor=false", "--disable-usage-stats"),
    *(f"--object-store-memory={_STORE_BYTES}", '--resources={"edge": 1, "cloud": 1}'),
)


class LocalRay:
    """Begins to start when made; `address` waits until it is there."""

    node_address = _ADDRESS

    def __init__(self, variables: Mapping[str, str]) -> None:
        """Start it with these environment variables on top of ours; returns at once."""
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
        """Host and port of its head, once it is there; AeroDaaSError if it does not start."""
        if not self._address:
            told = self._next(_START_SECONDS)
            if "address" not in told:
                self.end()
                raise AeroDaaSError(_failure(str(told.get("error", ""))))
            self._address = str(told["address"])
        return self._address

    def end(self) -> None:
        """Release the supervisor; returns after its end, or at once while a drone still lands."""
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
        """The supervisor's next line; empty if it has ended or is silent for too long."""
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
    """See to it that this user has a token, so that no one else can use a Ray of ours."""
    named = {"RAY_AUTH_MODE", "RAY_AUTH_TOKEN", "RAY_AUTH_TOKEN_PATH"}
    path = Path.home() / ".ray" / "auth_token"
    if named & set(os.environ) or path.exists():
        return
    path.parent.mkdir(exist_ok=True)
    # Made beside and moved, for two applications may start at the same time.
    own = path.with_name(f"auth_token.{os.getpid()}")
    with os.fdopen(os.open(own, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as file:
        file.write(secrets.token_hex(32))
    try:
        os.link(own, path)
    except FileExistsError:
        pass
    finally:
        own.unlink()
