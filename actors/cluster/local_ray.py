"""Local Ray of an application, which outlives it until the last drone has landed.

A supervisor process keeps it (`ray_process.py`). After the end of the application, for any
reason, the supervisor waits until no drone flies, then ends exactly the processes that it
started.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from importlib.util import find_spec
from pathlib import Path
from queue import Empty, Queue

from aerodaas.actors.cluster.authentication import make_token, require_authentication
from aerodaas.actors.cluster.ray_variables import LOOPBACK_ONLY
from aerodaas.actors.private_folder import private_folder
from aerodaas.config.secrets import MAVLINK_KEY
from aerodaas.errors import AeroDaaSError

__all__ = ["LOOPBACK", "LocalRay"]

_STORE_BYTES = 128 * 2**20
"""Bytes of Ray's object store; streams use shared memory of their own."""
LOOPBACK = "127.0.0.1"
"""Loopback address: no other machine reaches it, and a lost Wi-Fi breaks no connection."""
_START_SECONDS = 400.0
_END_SECONDS = 20.0
_KEEPER = Path(__file__).with_name("ray_process.py")
_OPTIONS = (
    *("--head", f"--node-ip-address={LOOPBACK}"),
    *("--include-dashboard=false", "--include-log-monitor=false", "--disable-usage-stats"),
    *(f"--object-store-memory={_STORE_BYTES}", '--resources={"edge": 1, "cloud": 1}'),
    # By default two Rays would quarrel over one port.
    "--dashboard-port=",
    # Ray opens this one only with the packages of ray[client], and refuses it without.
    *(["--ray-client-server-port="] if find_spec("grpc") else []),
)


class LocalRay:
    """Local Ray that starts in the background; `address` waits until it is ready."""

    def __init__(self) -> None:
        """Start Ray; returns at once."""
        if require_authentication():
            make_token()
        command = [sys.executable, "-I", "-S", str(_KEEPER), str(os.getpid()), _streams()]
        self._process = subprocess.Popen(  # noqa: S603 - our own file
            [*command, *_OPTIONS, f"--num-cpus={os.cpu_count()}"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            env={**_inherited(), **LOOPBACK_ONLY},
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
            if told is None or "address" not in told:
                self.end()
                raise AeroDaaSError(_failure(told))
            self._address = str(told["address"])
        return self._address

    def end(self) -> None:
        """Release Ray; returns when it has ended, or early while a drone has yet to land."""
        assert self._process.stdin is not None  # noqa: S101 - asked for
        self._process.stdin.close()
        told = self._next(_END_SECONDS)
        if told is not None and "flying" not in told:
            self._process.wait()

    def _listen(self) -> None:
        assert self._process.stdout is not None  # noqa: S101 - asked for
        for line in self._process.stdout:
            self._lines.put(line)
        self._lines.put("{}")

    def _next(self, timeout: float) -> dict[str, object] | None:
        """The supervisor's next message; empty if it has ended, None after the timeout."""
        try:
            return dict(json.loads(self._lines.get(timeout=timeout)))
        except Empty:
            return None


def _streams() -> str:
    """Folder of the sockets of this user's streams; empty where it cannot be used."""
    try:
        return str(private_folder("streams"))
    except AeroDaaSError:
        return ""


def _inherited() -> dict[str, str]:
    """This process' variables, but for what no actor gets but those that fly."""
    return {name: value for name, value in os.environ.items() if name != MAVLINK_KEY}


def _failure(told: dict[str, object] | None) -> str:
    if told is None:
        load = f"{os.getloadavg()[0]:.1f} on {os.cpu_count()} cores"
        return (
            f"Ray did not start within {_START_SECONDS:.0f} s: this machine is too busy "
            f"(load {load}); end other work and try again"
        )
    reason = told.get("error", "its supervisor was killed")
    return f"Ray does not start on this machine: {reason}"
