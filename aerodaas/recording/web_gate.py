"""Gate before a WebSocket server that does not look at Host and Origin itself."""

from __future__ import annotations

import asyncio
import re
import threading
from contextlib import suppress
from http import HTTPStatus

from aerodaas.http_server.addresses import host_name, is_loopback, is_served, listen
from aerodaas.http_server.denial import answer_of

__all__ = ["WebGate"]

_MOST_HEAD = 16 << 10
_MOST_CLIENTS = 64
_PATIENCE = 5.0
"""Seconds for a client's request."""
_CHUNK = 1 << 16
_VIEWERS = frozenset({b"https://app.foxglove.dev", b"file://"})
"""Origins of Foxglove in a browser and on the desktop."""
_HEADER = re.compile(rb"^([!-9;-~]+):[ \t]*(.*?)[ \t]*\r?$", re.MULTILINE)
_REFUSED = answer_of(
    HTTPStatus.FORBIDDEN,
    "the live view answers to this machine's names and to Foxglove only: open it by the address "
    "told",
)


class WebGate:
    """Passes connections on to a local server once their request names this machine.

    A web page of a stranger's, or one whose name has been made to resolve to this machine, is
    refused; so are requests that are too long or too slow.
    """

    def __init__(self, host: str, port: int, target: tuple[str, int]) -> None:
        """Listen at `host`:`port` and pass on to `target`; raises OSError."""
        self._socket = listen(host, port)
        self.port: int = self._socket.getsockname()[1]
        """Port that it listens on."""
        self._host = host
        self._target = target
        self._clients: set[asyncio.Task[None]] = set()
        self._loop = asyncio.new_event_loop()
        self._server = self._loop.run_until_complete(
            asyncio.start_server(self._serve, sock=self._socket, limit=_MOST_HEAD)
        )
        self._thread = threading.Thread(target=self._run, name="live view", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop listening and end all connections."""
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(_PATIENCE)
        self._socket.close()

    def _run(self) -> None:
        self._loop.run_forever()
        self._loop.run_until_complete(self._end())
        self._loop.close()

    async def _end(self) -> None:
        self._server.close()
        tasks = asyncio.all_tasks() - {asyncio.current_task()}
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None  # noqa: S101 - it runs in one
        try:
            if len(self._clients) < _MOST_CLIENTS:
                self._clients.add(task)
                await self._pass_on(reader, writer)
        except (OSError, asyncio.IncompleteReadError, asyncio.LimitOverrunError, TimeoutError):
            pass
        except asyncio.TimeoutError:
            pass
        finally:
            self._clients.discard(task)
            writer.close()

    async def _pass_on(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        head = await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), _PATIENCE)
        if not self._admits(head):
            writer.write(_REFUSED)
            await writer.drain()
            return
        inner, outer = await asyncio.open_connection(*self._target)
        try:
            outer.write(head)
            ways = [
                asyncio.ensure_future(_copy(reader, outer)),
                asyncio.ensure_future(_copy(inner, writer)),
            ]
            await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
            for way in ways:
                way.cancel()
            await asyncio.gather(*ways, return_exceptions=True)
        finally:
            outer.close()

    def _admits(self, head: bytes) -> bool:
        headers: dict[bytes, list[bytes]] = {}
        for name, value in _HEADER.findall(head):
            headers.setdefault(name.lower(), []).append(value)
        hosts, origins = headers.get(b"host", []), headers.get(b"origin", [])
        if len(hosts) != 1 or len(origins) > 1:
            return False
        if not is_served(host_name(hosts[0]), self._host):
            return False
        if not origins or origins[0] in _VIEWERS:
            return True
        name = origins[0].partition(b"://")[2]
        return name == hosts[0] or is_loopback(host_name(name))


async def _copy(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    with suppress(OSError):
        while data := await reader.read(_CHUNK):
            writer.write(data)
            await writer.drain()
