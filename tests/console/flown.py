"""Flights with a console as people start them, by `aerodaas run --console` in its own process."""

from __future__ import annotations

import os
import re
import select
import signal
import socket
import subprocess
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path

from typing_extensions import Self

__all__ = ["Proxy", "Watched"]

_ROOT = Path(__file__).resolve().parents[2]
_START_SECONDS = 120.0


class Watched:
    """An application in flight, with the addresses of its console."""

    def __init__(self, application: str | Path, folder: Path, *words: str) -> None:
        """Fly a file, or one of `apps/`, at the clock's speed; the recording goes into `folder`."""
        file = application if isinstance(application, Path) else f"apps/{application}.py"
        self.recording = folder / "flight" / "flight.mcap"
        self._log = folder / "log"
        self._command = [
            sys.executable, "-m", "aerodaas", "run", str(file), "--console",
            "--console-address", "127.0.0.1:0", "--record", str(folder / "flight"), *words,
        ]  # fmt: skip

    def __enter__(self) -> Self:
        with self._log.open("w") as log:
            self._process = subprocess.Popen(
                self._command, stdout=log, stderr=log, cwd=_ROOT, env={**os.environ}
            )
        until = time.monotonic() + _START_SECONDS
        while len(found := re.findall(r"http://\S+#token=\S+", self._log.read_text())) < 2:
            assert self._process.poll() is None, self._log.read_text()
            assert time.monotonic() < until, self._log.read_text()
            time.sleep(0.1)
        self.pilot, self.viewer = found[:2]
        return self

    def __exit__(self, *_: object) -> None:
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGTERM)
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(120)
        if self._process.poll() is None:
            self._process.kill()

    def ended(self) -> int:
        """Wait until the application has ended; returns its exit status."""
        return self._process.wait(180)


class Proxy:
    """A way to a port that can be cut, with all that is on it, and mended."""

    def __init__(self, port: int) -> None:
        """Lead to a port of this machine."""
        self._target = port
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._listener.getsockname()[1]
        self._open = True
        self._pairs: list[socket.socket] = []
        threading.Thread(target=self._accept, daemon=True).start()

    def cut(self) -> None:
        """End all connections, and refuse new ones."""
        self._open = False
        for one in self._pairs:
            with suppress(OSError):
                one.shutdown(socket.SHUT_RDWR)
        self._pairs.clear()

    def mend(self) -> None:
        """Let connections through again."""
        self._open = True

    def close(self) -> None:
        """Lead nowhere any more."""
        self.cut()
        self._listener.close()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                inner, _ = self._listener.accept()
                if not self._open:
                    inner.close()
                    continue
                outer = socket.create_connection(("127.0.0.1", self._target))
                self._pairs += [inner, outer]
                threading.Thread(target=_carry, args=(inner, outer), daemon=True).start()


def _carry(inner: socket.socket, outer: socket.socket) -> None:
    ways = {inner: outer, outer: inner}
    with suppress(OSError), inner, outer:
        while True:
            for one in select.select(list(ways), [], [])[0]:
                data = one.recv(65536)
                if not data:
                    return
                ways[one].sendall(data)
