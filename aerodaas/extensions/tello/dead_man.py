"""Watchdog process that stops the Tello when the driver's process is gone.

A Tello continues to fly by the last `rc` until it lands by itself, 15 seconds later. The
driver hands this process its own socket and tells it through a pipe, with every `rc`, whether
that moves the Tello. When the pipe closes without a goodbye, or falls silent while the Tello
moves (the driver's process hangs), this process centres the sticks, and then keeps silent, so
that the Tello lands by itself as it does for any dead program.
"""

from __future__ import annotations

import contextlib
import os
import select
import socket
import subprocess
import sys
import time

__all__ = ["DeadMan"]

_STILL, _MOVING, _GOODBYE = b"s", b"m", b"q"
_PATIENCE = 1.0
"""Longest silence in seconds before a moving Tello is stopped; the driver sends at 20 Hz."""
_REPEATS, _PAUSE = 3, 0.1


class DeadMan:
    """The driver's end of the pipe."""

    def __init__(self, link: socket.socket, peer: tuple[str, int]) -> None:
        """Start the process; it may send to `peer` through the socket `link`."""
        command = [sys.executable, "-I", "-S", __file__, str(link.fileno()), peer[0], str(peer[1])]
        # A session of its own, so that Ctrl-C in the terminal does not end the guard first.
        self._process = subprocess.Popen(  # noqa: S603 - our own file
            command,
            stdin=subprocess.PIPE,
            pass_fds=[link.fileno()],
            start_new_session=True,
            bufsize=0,
        )
        assert self._process.stdin is not None  # noqa: S101 - asked for a pipe
        self._pipe = self._process.stdin
        os.set_blocking(self._pipe.fileno(), False)

    def restart(self, *, moving: bool) -> None:
        """Record that the sticks were set."""
        # A watchdog that has died must not end the flight.
        with contextlib.suppress(OSError):
            self._pipe.write(_MOVING if moving else _STILL)

    def close(self) -> None:
        """End the watchdog: the driver sends nothing any more."""
        with contextlib.suppress(OSError):
            self._pipe.write(_GOODBYE)
            self._pipe.close()
        try:
            self._process.wait(timeout=5.0)
        except subprocess.TimeoutExpired:
            # Hanging, it would keep the Tello's port for ever.
            self._process.kill()
            self._process.wait()


def _guard(link: socket.socket, peer: tuple[str, int]) -> None:
    pipe = sys.stdin.fileno()
    moving = False
    while True:
        ready, _, _ = select.select([pipe], [], [], _PATIENCE if moving else None)
        words = os.read(pipe, 4096) if ready else b""
        if _GOODBYE in words:
            return
        if not words and moving:
            for _ in range(_REPEATS):
                with contextlib.suppress(OSError):
                    link.sendto(b"rc 0 0 0 0", peer)
                time.sleep(_PAUSE)
        if ready and not words:
            return
        moving = words.endswith(_MOVING)


if __name__ == "__main__":
    _guard(socket.socket(fileno=int(sys.argv[1])), (sys.argv[2], int(sys.argv[3])))
