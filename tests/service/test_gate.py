"""Each limit of requests under way: what exceeds it is refused, and an operator never is."""

from __future__ import annotations

import asyncio
from collections.abc import MutableMapping
from dataclasses import dataclass
from typing import Any

import pytest
from starlette.types import Receive, Scope, Send

from aerodaas.protocol.schemas import PictureForm, Role
from aerodaas.service.access.principal import Principal
from aerodaas.service.http.gate import Admission, LimitsMiddleware
from aerodaas.service.http.limits import PROVIDER, RequestLimits
from aerodaas.service.live.session import wanted_streams


@dataclass
class Tokens:
    """A token is the role and the account that it belongs to."""

    def of(self, token: str, address: str) -> Principal:
        """The account of a token."""
        del address
        role, _, account = token.partition("/")
        return Principal(account, "tenant", Role(role), frozenset(), token)


class Held:
    """A gate whose application answers nothing until it is let go."""

    def __init__(self) -> None:
        self.free = asyncio.Event()
        self.gate = LimitsMiddleware(self._wait, Admission(Tokens()), PROVIDER)
        self.asked: list[asyncio.Task[int]] = []

    async def _wait(self, scope: Scope, receive: Receive, send: Send) -> None:
        del scope, receive
        await self.free.wait()
        await send({"type": "http.response.start", "status": 200, "headers": []})

    async def ask(self, token: str, kind: str, address: str, size: int) -> int:
        """Status of a request."""
        sent: list[MutableMapping[str, Any]] = []

        async def receive() -> MutableMapping[str, Any]:
            return {"type": "http.request"}

        async def send(message: MutableMapping[str, Any]) -> None:
            sent.append(message)

        headers = [
            (b"authorization", f"Bearer {token}".encode()),
            (b"content-length", b"%d" % size),
        ]
        path, method = ("/v1/missions", "POST") if size else ("/v1/fleet", "GET")
        scope = {"type": kind, "path": path, "method": method, "headers": headers}
        extensions = {"websocket.http.response": {}}
        await self.gate({**scope, "client": (address, 1), "extensions": extensions}, receive, send)
        return int(sent[0]["status"])


LARGE = RequestLimits.large_bytes + 1


@pytest.mark.parametrize(
    ("most", "kind", "accounts", "addresses", "size"),
    [
        (RequestLimits.account_requests, "http", 1, 1, 0),
        (RequestLimits.account_large_requests, "http", 1, 1, LARGE),
        (RequestLimits.requests, "http", 400, 1, 0),
        (RequestLimits.large_requests, "http", 400, 1, LARGE),
        (PROVIDER.account_views, "websocket", 1, 400, 0),
        (RequestLimits.address_views, "websocket", 400, 1, 0),
        (RequestLimits.views, "websocket", 400, 400, 0),
    ],
)
def test_what_exceeds_a_limit_is_refused(
    most: int, kind: str, accounts: int, addresses: int, size: int
) -> None:
    """By account, by address, and for all together; an operator's request is answered all the same.

    Once the others are answered, there is room again.
    """

    async def count() -> None:
        held = Held()

        def asked(number: int) -> asyncio.Task[int]:
            account, address = number % accounts, number % addresses
            words = f"pilot/{account}", kind, f"10.0.{address // 200}.{address % 200}", size
            return asyncio.ensure_future(held.ask(*words))

        requests = [asked(number) for number in range(most + 3)]
        while sum(one.done() for one in requests) < 3:  # noqa: ASYNC110 - of several tasks
            await asyncio.sleep(0.01)
        await asyncio.sleep(0.05)
        refused = [one.result() for one in requests if one.done()]
        assert refused == [429] * 3
        operator = asyncio.ensure_future(held.ask("operator/0", kind, "10.0.0.0", size))
        await asyncio.sleep(0.05)
        assert not operator.done()
        held.free.set()
        assert await operator == 200
        assert (await asyncio.gather(*requests)).count(200) == most
        assert await asked(0) == 200

    asyncio.run(count())


def test_a_live_view_has_as_many_streams_as_it_may() -> None:
    """Those named first; pictures and their depth count alike."""
    names = [f"drone/{number}" for number in range(20)]
    asked = wanted_streams(",".join(names), PictureForm.JPEG, ",".join(names))
    assert asked == [(name, PictureForm.JPEG) for name in names[:16]]
    few = wanted_streams("drone/cam", PictureForm.JPEG, ",".join(names))
    assert few[1:] == [(name, PictureForm.DEPTH) for name in names[:15]]
