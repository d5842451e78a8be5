"""A connection to a service that is cut after the service has handled a request."""

from __future__ import annotations

import socket
import threading
from urllib.parse import urlsplit

from typing_extensions import Self

_CHUNK = 1 << 16


class LostAnswers:
    """Proxy of one service that loses the first answers to submissions, and nothing else."""

    def __init__(self, url: str, lost: int = 1) -> None:
        """Lose the answers to the first `lost` submissions to the service at `url`."""
        parts = urlsplit(url)
        self._service = (parts.hostname or "", parts.port or 0)
        self._left = lost
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"http://127.0.0.1:{self._listener.getsockname()[1]}"
        self.submissions: list[bytes] = []
        """Heads of the submissions that went through."""

    def __enter__(self) -> Self:
        threading.Thread(target=self._accept, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self._listener.close()

    def _accept(self) -> None:
        while True:
            try:
                connection, _ = self._listener.accept()
            except OSError:
                return
            threading.Thread(target=self._carry, args=(connection,), daemon=True).start()

    def _carry(self, user: socket.socket) -> None:
        """Carry the requests of one connection."""
        with user, socket.create_connection(self._service) as service:
            while request := _message(user):
                service.sendall(request)
                answer = _message(service)
                if request.startswith(b"POST /v1/missions "):
                    self.submissions.append(request.partition(b"\r\n\r\n")[0])
                    if self._left:
                        self._left -= 1
                        return
                user.sendall(answer)


def _message(source: socket.socket) -> bytes:
    """One HTTP message whose length is told in its head; empty at the end of the connection."""
    found = b""
    while b"\r\n\r\n" not in found:
        chunk = source.recv(_CHUNK)
        if not chunk:
            return b""
        found += chunk
    head = found.partition(b"\r\n\r\n")[0]
    fields = dict(line.lower().split(b": ", 1) for line in head.split(b"\r\n")[1:])
    whole = len(head) + 4 + int(fields.get(b"content-length", b"0"))
    while len(found) < whole:
        found += source.recv(_CHUNK)
    return found
