"""Meeting place of publishers and subscribers of one node: sockets in a folder of this user's own.

A subscriber listens on a Unix socket, to which a link in the folder of each of its streams leads:
`streams/SCOPE/STREAM/ID.DEPTH -> ../ID`. A publisher connects to all that it finds there. Whoever
comes later rings the bells of the publishers in the folder, `ID.bell`. So either may come first, a
publisher that is started again finds the readers of the one that died, and nobody polls. Names are
hashed: the path of a socket has at most 107 characters.
"""

from __future__ import annotations

import contextlib
import os
import secrets
import socket
import struct
from collections.abc import Callable, Iterator
from hashlib import blake2b
from pathlib import Path
from typing import NamedTuple

from aerodaas.actors.private_folder import private_folder

__all__ = ["Listener", "NewSubscriber", "SubscriberListener", "streams_folder"]

_BACKLOG = 4096
_BELL = ".bell"
"""Ends the name of a publisher's bell."""
_DEAF = ".new"
"""Ends the name of a socket whose process does not listen yet."""
_CREDENTIALS = struct.Struct("3i")


def streams_folder() -> Path:
    """Return the folder of this user's sockets, made if missing.

    Raises AeroDaaSError as `private_folder` does.
    """
    return private_folder("streams")


def _hashed(name: str) -> str:
    return blake2b(name.encode(), digest_size=8).hexdigest()


def _socket() -> socket.socket:
    return socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET | socket.SOCK_NONBLOCK)


def _is_own(connection: socket.socket) -> bool:
    """Whether the process at the other end is of this user."""
    data = connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size)
    return bool(_CREDENTIALS.unpack(data)[1] == os.geteuid())


class Listener:
    """Socket of a subscriber, to which publishers connect."""

    def __init__(self, scope: str) -> None:
        """Listen in `scope`, the prefix of the run's stream names on this node."""
        self._folder = streams_folder() / _hashed(scope)
        self._id = secrets.token_hex(8)
        self._links: list[Path] = []
        self.socket = _socket()
        path = self._folder / self._id
        deaf = path.with_suffix(_DEAF)
        _make_in(self._folder, lambda: self.socket.bind(str(deaf)))
        self.socket.listen(_BACKLOG)
        deaf.rename(path)

    def announce(self, stream: str, depth: int) -> None:
        """Let publishers of `stream` find this socket: what they publish from now on arrives.

        Args:
            stream: Name of the stream.
            depth: Newest messages that are sent at a time.
        """
        link = self._folder / _hashed(stream) / f"{self._id}.{depth}"
        _make_in(link.parent, lambda: link.symlink_to(f"../{self._id}"))
        self._links.append(link)
        for bell in link.parent.glob(f"*{_BELL}"):
            _ring(bell)

    def accept(self) -> socket.socket | None:
        """Return the next publisher's connection; None if it is not of this user.

        Raises OSError if there is none, or no descriptor left for it.
        """
        connection, _ = self.socket.accept()
        connection.setblocking(False)  # noqa: FBT003 - the library's own signature
        if _is_own(connection):
            return connection
        connection.close()
        return None

    def close(self) -> None:
        """Stop listening, and remove the links."""
        self.socket.close()
        for path in (*self._links, self._folder / self._id):
            _delete(path)


class NewSubscriber(NamedTuple):
    """A subscriber that has come."""

    connection: socket.socket
    depth: int
    """Messages that its queue holds."""
    name: str


class SubscriberListener:
    """The subscribers of one stream, as its publisher finds them."""

    def __init__(self, scope: str, stream: str) -> None:
        """Look for subscribers of `stream` in `scope`."""
        self._folder = streams_folder() / _hashed(scope) / _hashed(stream)
        self._known: set[str] = set()
        self.bell = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
        """Can be read when subscribers have come."""
        self._path = self._folder / f"{secrets.token_hex(8)}{_BELL}"
        _make_in(self._folder, lambda: self.bell.bind(str(self._path)))
        self.waiting = True
        """Whether there may be new ones."""

    def rung(self) -> None:
        """Empty the bell: there may be new ones."""
        self.waiting = True
        with contextlib.suppress(OSError):
            while True:
                self.bell.recv(1)

    def new(self) -> Iterator[NewSubscriber]:
        """Connect to the subscribers that have come since the last call."""
        self.waiting = False
        try:
            names = {path.name for path in self._folder.iterdir() if path.suffix[1:].isdigit()}
        except OSError:  # no descriptor left
            self.waiting = True
            return
        self._known &= names
        for name in sorted(names - self._known):
            connection = self._connect(self._folder / name)
            if connection is not None:
                yield NewSubscriber(connection, int(Path(name).suffix[1:]), name)

    def close(self) -> None:
        """Look no more."""
        self.bell.close()
        _delete(self._path)

    def gone(self, name: str) -> None:
        """Connect again to a subscriber whose connection has ended, should it still listen."""
        self._known.discard(name)
        self.waiting = True

    def _connect(self, link: Path) -> socket.socket | None:
        self._known.add(link.name)
        try:
            connection = _socket()
        except OSError:  # no descriptor left
            self.gone(link.name)
            return None
        try:
            connection.connect(str(link))
        except (ConnectionRefusedError, FileNotFoundError):
            _remove(link)  # its process was killed
        except OSError:  # as many wait to be connected as may
            self.gone(link.name)
        else:
            if _is_own(connection):
                return connection
        connection.close()
        return None


def _remove(link: Path) -> None:
    with contextlib.suppress(OSError):
        link.resolve().unlink(missing_ok=True)
        link.unlink(missing_ok=True)


def _ring(bell: Path) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK) as ringer:
        try:
            ringer.sendto(b"\0", str(bell))
        except ConnectionRefusedError:
            bell.unlink(missing_ok=True)  # its process was killed
        except OSError:
            pass  # it rings already


def _make_in(folder: Path, make: Callable[[], None]) -> None:
    """Make something in a folder, which is made if missing."""
    while True:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        with contextlib.suppress(FileNotFoundError):  # who left last has just removed the folder
            make()
            return


def _delete(path: Path) -> None:
    """Remove something, and its folder after the last."""
    path.unlink(missing_ok=True)
    with contextlib.suppress(OSError):
        path.parent.rmdir()
        path.parent.parent.rmdir()
