"""Live view of a mission: its state at each change, and the items of its streams."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Callable, Sequence
from typing import Annotated, Any, TypeAlias

from fastapi import Query, WebSocket, WebSocketDisconnect

from aerodaas.clock import host_time_ns
from aerodaas.protocol.schemas import PictureForm
from aerodaas.service.backend import Missions
from aerodaas.service.http.gate import SUBPROTOCOL
from aerodaas.service.http.limits import RequestLimits
from aerodaas.service.live.hub import StreamHub, Watcher

__all__ = [
    "Form",
    "LiveSession",
    "Rate",
    "StreamNames",
    "StreamRequest",
    "end_jobs",
    "until_refused",
    "wanted_streams",
]

_log = logging.getLogger(__name__)
StreamRequest: TypeAlias = tuple[str, PictureForm]
"""A stream, and how its pictures are sent."""

Rate: TypeAlias = Annotated[float, Query(gt=0, le=RequestLimits.view_rate, allow_inf_nan=False)]
"""Most messages of a mission's state a second, of a view's address."""
StreamNames: TypeAlias = Annotated[str, Query(max_length=2000)]
"""Streams whose items are sent, too, by comma; of a view's address."""
Form: TypeAlias = Annotated[PictureForm, Query()]
"""How pictures are sent; of a view's address."""

_RENEWAL_SECONDS = 5.0
"""Wall seconds between two looks at whether a connection still may be had."""
_END_SECONDS = 0.2
"""Most seconds between two looks at whether a mission is over."""
_IDLE_SECONDS = 1.0
"""Most seconds between two messages of a mission that does not change."""


def wanted_streams(streams: str, form: PictureForm, depth: str) -> list[StreamRequest]:
    """Streams that comma-separated lists of names ask for, as many as one view may have.

    Args:
        streams: Streams whose items are sent.
        form: How their pictures are.
        depth: Streams of pictures whose depth is sent beside them.
    """
    wanted = [(name, form) for name in streams.split(",") if name]
    wanted += [(name, PictureForm.DEPTH) for name in depth.split(",") if name]
    return wanted[: RequestLimits.view_streams]


async def until_refused(allowed: Callable[[], bool]) -> None:
    """Return when the one behind a connection may not have it any more; asked in another thread."""
    while await asyncio.to_thread(allowed):  # noqa: ASYNC110 - a token's end has no event
        await asyncio.sleep(_RENEWAL_SECONDS)


async def end_jobs(
    what: str, sending: Sequence[asyncio.Task[Any]], reading: Sequence[asyncio.Task[Any]] = ()
) -> None:
    """Cancel the jobs of a connection, and wait for their end.

    Args:
        what: The connection, for the log.
        sending: Jobs that fail by mistakes of ours alone, which are logged; but for what is raised
            when the other side has gone.
        reading: Jobs that fail by what the other side sends, which is its own business.
    """
    for job in (*sending, *reading):
        job.cancel()
    await asyncio.gather(*reading, return_exceptions=True)
    for found in await asyncio.gather(*sending, return_exceptions=True):
        # A server raises RuntimeError for what is sent on a connection that has ended.
        gone = isinstance(found, WebSocketDisconnect | RuntimeError)
        if isinstance(found, Exception) and not gone:
            _log.error("%s has failed", what, exc_info=found)


class LiveSession:
    """One watcher's connection."""

    def __init__(self, socket: WebSocket, missions: Missions, hub: StreamHub, mission: str) -> None:
        """Show a mission to the one behind `socket`, which is not accepted yet."""
        self._socket = socket
        self._missions = missions
        self._hub = hub
        self._mission = mission
        # An item's two messages stay together.
        self._sending = asyncio.Lock()

    async def run(
        self,
        rate: float,
        streams: Sequence[StreamRequest],
        *,
        own: bool,
        allowed: Callable[[], bool] = lambda: True,
    ) -> None:
        """Accept the watcher; send until the mission is over, or the watcher has gone or must go.

        Args:
            rate: Most messages of the mission's state a second.
            streams: Whose items are sent, too.
            own: Whether the watcher counts as the mission's user, who is heard of so.
            allowed: Whether the watcher still may watch; called in another thread.
        """
        offered = self._socket.scope.get("subprotocols", ())
        await self._socket.accept(SUBPROTOCOL if SUBPROTOCOL in offered else None)
        state = asyncio.create_task(self._state(rate, own=own))
        gone = asyncio.create_task(self._read())
        refused = asyncio.create_task(until_refused(allowed))
        items = [asyncio.create_task(self._items(*one)) for one in streams]
        try:
            ends = (state, gone, refused)
            await asyncio.wait(ends, return_when=asyncio.FIRST_COMPLETED)
        finally:
            await end_jobs(f"{self._mission}: a live view", [state, refused, *items], [gone])
            with contextlib.suppress(WebSocketDisconnect, RuntimeError):
                await self._socket.close()

    async def _state(self, rate: float, *, own: bool) -> None:
        """Send the mission's state until it is over; its own user counts as present meanwhile."""
        sent, since, heard = -1, 0.0, 0.0
        loop = asyncio.get_running_loop()
        while True:
            now, version = loop.time(), self._missions.version(self._mission)
            if own and now - heard > _IDLE_SECONDS:
                heard = now
                await asyncio.to_thread(self._missions.record_presence, self._mission)
            if version != sent or now - since > _IDLE_SECONDS:
                sent, since = version, now
                text, over = self._missions.text(self._mission)
                head = f'"kind": "mission", "now": {host_time_ns()}'
                async with self._sending:
                    await self._socket.send_text(f'{{{head}, "mission": {text}}}')
                    if over:
                        await self._socket.send_text('{"kind": "end"}')
                        return
            await self._pause(1.0 / rate)

    async def _pause(self, seconds: float) -> None:
        """Wait, but not beyond the mission's end: the server may end with it."""
        loop = asyncio.get_running_loop()
        until = loop.time() + seconds
        while True:
            await asyncio.sleep(min(_END_SECONDS, seconds))
            if loop.time() >= until or self._missions.version(self._mission) < 0:
                return

    async def _items(self, stream: str, form: PictureForm) -> None:
        """Send the items of one stream; begins again where the flight has not begun yet."""
        while True:
            watcher = self._hub.add_watcher(self._mission, stream, form)
            try:
                await self._forward(watcher)
            finally:
                self._hub.remove_watcher(self._mission, stream, form, watcher)
            await asyncio.sleep(_IDLE_SECONDS / 2)

    async def _forward(self, watcher: Watcher) -> None:
        while (item := await watcher.next()) is not None:
            async with self._sending:
                await self._socket.send_text(item.text)
                if item.blob:
                    await self._socket.send_bytes(item.blob)

    async def _read(self) -> None:
        """Return when the watcher has gone; it has nothing to say."""
        with contextlib.suppress(WebSocketDisconnect, RuntimeError):
            while True:
                await self._socket.receive_text()
