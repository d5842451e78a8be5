"""HereLink: the connection by which a provider's flight asks analyses at the user's side."""

from __future__ import annotations

import contextlib
import threading
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from aerodaas.environment.here_server import HereServer
from aerodaas.environment.provider.client import ProviderClient
from aerodaas.environment.provider.follower import MissionFollower
from aerodaas.environment.provider.pauses import pauses
from aerodaas.environment.provider.wire import WireConnection
from aerodaas.errors import AeroDaaSError, SourceError

__all__ = ["HereLink"]

_WORKERS = 8
"""Questions that are answered at once; each analysis is asked for one item at a time."""
_REFUSALS = 2
"""Refusals for the same reason after which they are told: one may come as the mission ends."""


class HereLink:
    """Answers a flight's questions until it is over; connects again when the connection is lost."""

    def __init__(
        self,
        client: ProviderClient,
        follower: MissionFollower,
        server: HereServer,
        say: Callable[[str], None] = lambda _: None,
    ) -> None:
        """Answer by an open `server`, which is closed with this; `say` is told of refusals."""
        self._say = say
        self._client = client
        self._follower = follower
        self._server = server
        self._closed = threading.Event()
        self._connection: WireConnection | None = None
        self._workers = ThreadPoolExecutor(_WORKERS, "here")
        threading.Thread(target=self._run, name="here", daemon=True).start()

    def revealed(self, item: object) -> object:
        """As `HereServer.revealed`."""
        return self._server.revealed(item)

    def close(self) -> None:
        """Answer no more; raises what an analysis raises when it is closed."""
        self._closed.set()
        connection = self._connection
        if connection is not None:
            connection.close()
        self._workers.shutdown(wait=True, cancel_futures=True)
        self._server.close()

    def _run(self) -> None:
        waiting, refusals = pauses(), Counter[str]()
        while not self._closed.is_set() and not self._follower.mission.phase.over:
            try:
                self._connect()
            except (SourceError, RuntimeError):
                # The follower meets and tells the same; the flight tells that it has no answers.
                pass
            except AeroDaaSError as error:
                refusals[str(error)] += 1
                if refusals[str(error)] == _REFUSALS:
                    self._say(f"the analyses at this side are not asked: {error}")
            self._closed.wait(next(waiting))

    def _connect(self) -> None:
        """Answer by one connection."""
        with self._client.here(self._follower.mission.id) as connection:
            self._connection = connection
            while not self._closed.is_set():
                question, blob = connection.receive(None)
                self._workers.submit(self._answer, connection, question, blob)

    def _answer(self, connection: WireConnection, question: dict[str, Any], blob: bytes) -> None:
        answer, data = self._server.answer(question, blob)
        with contextlib.suppress(AeroDaaSError):
            connection.send(answer, data)
