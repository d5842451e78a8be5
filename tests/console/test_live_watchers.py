"""Watchers of one mission: each gets the newest state, whatever the others do."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Awaitable, Callable
from typing import Any, cast

import pytest
from fastapi import WebSocket, WebSocketDisconnect

from aerodaas.service.backend import Missions
from aerodaas.service.live.hub import StreamHub
from aerodaas.service.live.session import LiveSession

_RATE = 20.0


class _Mission:
    """A mission of which only the version changes."""

    def __init__(self) -> None:
        self.number = 1

    def version(self, mission: str) -> int:
        del mission
        return self.number

    def text(self, mission: str) -> tuple[str, bool]:
        return json.dumps({"id": mission, "version": self.number}), False

    def record_presence(self, mission: str) -> None:
        del mission


class _Socket:
    """A watcher; one that is `held` takes a message only when it is let go."""

    def __init__(self) -> None:
        self.scope: dict[str, Any] = {}
        self.versions: list[int] = []
        self.waiting = 0
        """Messages that it has not taken."""
        self.free = asyncio.Event()
        self.free.set()

    async def accept(self, _: str | None) -> None:
        pass

    async def send_text(self, text: str) -> None:
        self.waiting += 1
        await self.free.wait()
        self.waiting -= 1
        self.versions.append(json.loads(text)["mission"]["version"])

    async def receive_text(self) -> str:
        await asyncio.Event().wait()
        return ""

    async def close(self) -> None:
        pass


async def _watched(check: Callable[[_Mission, list[_Socket]], Awaitable[None]], count: int) -> None:
    mission, hub = _Mission(), StreamHub(lambda *_: iter(()))
    sockets = [_Socket() for _ in range(count)]
    tasks = [
        asyncio.create_task(
            LiveSession(cast("WebSocket", one), cast("Missions", mission), hub, "m").run(
                _RATE, [], own=False
            )
        )
        for one in sockets
    ]
    try:
        await asyncio.wait_for(check(mission, sockets), 20.0)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


async def _until(holds: Callable[[], bool]) -> None:
    while not holds():  # noqa: ASYNC110 - what it looks at has no events
        await asyncio.sleep(0.01)


@pytest.mark.parametrize("slow", [1, 5])
def test_slow_watchers_hold_up_nobody(slow: int) -> None:
    """While they take nothing, the others get each state."""

    async def check(mission: _Mission, sockets: list[_Socket]) -> None:
        await _until(lambda: all(one.versions for one in sockets))
        for one in sockets[:slow]:
            one.free.clear()
        for _ in range(10):
            mission.number += 1
            await _until(lambda: all(mission.number in one.versions for one in sockets[slow:]))
        assert all(mission.number not in one.versions for one in sockets[:slow])

    asyncio.run(_watched(check, 6))


def test_a_slow_watcher_gets_the_newest_state_and_no_backlog() -> None:
    """One message waits for it, however many there were; what follows that is the newest."""

    async def check(mission: _Mission, sockets: list[_Socket]) -> None:
        slow, quick = sockets
        await _until(lambda: bool(slow.versions and quick.versions))
        slow.free.clear()
        mission.number = 2
        await _until(lambda: slow.waiting == 1)
        for number in range(3, 13):
            mission.number = number
            await _until(lambda: quick.versions[-1] == mission.number)
        assert slow.waiting == 1
        slow.free.set()
        await _until(lambda: slow.versions[-1] == 12)
        # A state that stays is told again after a while.
        assert list(dict.fromkeys(slow.versions)) == [1, 2, 12]

    asyncio.run(_watched(check, 2))


class _Failing(_Mission):
    """A mission whose state cannot be told, by a mistake of ours."""

    def text(self, mission: str) -> tuple[str, bool]:
        raise KeyError(mission)


def _view(socket: _Socket, mission: _Mission) -> None:
    """Show a mission until the view ends."""

    async def view() -> None:
        hub = StreamHub(lambda *_: iter(()))
        session = LiveSession(cast("WebSocket", socket), cast("Missions", mission), hub, "m")
        await asyncio.wait_for(session.run(_RATE, [], own=False), 20.0)

    asyncio.run(view())


def test_a_view_that_fails_is_told_of(caplog: pytest.LogCaptureFixture) -> None:
    """Its page connects again and again, and would show nothing without a word."""
    _view(_Socket(), _Failing())
    assert "m: a live view has failed" in caplog.text
    assert "KeyError: 'm'" in caplog.text


class _Gone(_Socket):
    """A watcher who goes."""

    async def send_text(self, text: str) -> None:
        del text
        raise WebSocketDisconnect(1006)

    async def receive_text(self) -> str:
        raise KeyError("text")


def test_a_watcher_who_goes_is_no_failure(caplog: pytest.LogCaptureFixture) -> None:
    """Nor is one who sends what no page sends."""
    _view(_Gone(), _Mission())
    assert caplog.text == ""
