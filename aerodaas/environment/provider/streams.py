"""WireReader: a stream of a provider's mission, read over the wire."""

from __future__ import annotations

import threading
import time
import warnings
from collections import deque
from collections.abc import Callable
from typing import Any

from aerodaas.analytics.wire_items import unpack
from aerodaas.environment.provider.client import ProviderClient
from aerodaas.environment.provider.exchange import pauses
from aerodaas.environment.provider.follower import MissionFollower
from aerodaas.environment.provider.wire import ReceivedItem
from aerodaas.errors import AeroDaaSError, ConfigError, MissionError, failure_line
from aerodaas.messages.serialization.schema import MessageError

__all__ = ["WireReader"]

_WAITING = 256
"""Most items that wait for a slow reader; the oldest ones go first."""
_RATE = 1.0
"""Hz of the mission's state on this connection, which is of no use to a stream."""
_LOOK_SECONDS = 0.2
_LAST_SECONDS = 2.0
"""Seconds after the mission's end in which its last items may still arrive."""


class WireReader:
    """Reader of one stream until the mission is over; reconnects, and buffers the newest few."""

    def __init__(
        self,
        client: ProviderClient,
        follower: MissionFollower,
        stream: str,
        revealed: Callable[[object], object] = lambda item: item,
    ) -> None:
        """Read a stream of a mission.

        Args:
            client: The provider.
            follower: Keeps up with the mission.
            stream: Name of the stream.
            revealed: Returns the application's own object for what stands for it on the wire, and
                anything else as it is; raises MessageError.
        """
        self._client = client
        self._follower = follower
        self._stream = stream
        self._revealed = revealed
        self._arrived = threading.Condition()
        self._waiting: deque[Any] = deque(maxlen=_WAITING)
        self._newest: Any = None
        self._failed: AeroDaaSError | None = None
        self._ended = False
        threading.Thread(target=self._read, name=f"wire {stream}", daemon=True).start()

    def next(self, timeout: float | None) -> Any:  # noqa: ANN401 - the stream's item
        """Return the next item, waiting up to `timeout` seconds (None: for ever).

        Raises TimeoutError when none came, StopIteration once the mission has ended, ConfigError
        if the provider refuses the stream, MissionError if it can be read no more.
        """
        until = time.monotonic() + (float("inf") if timeout is None else timeout)
        with self._arrived:
            while not self._waiting:
                if self._failed is not None:
                    raise self._failed
                if self._ended:
                    raise StopIteration
                left = until - time.monotonic()
                if left <= 0.0 and self._follower.mission.phase.over:
                    raise StopIteration
                if left <= 0.0:
                    raise TimeoutError(f"nothing arrived within {timeout} s")
                self._arrived.wait(min(_LOOK_SECONDS, left))
            return self._waiting.popleft()

    def newest(self, timeout: float | None) -> Any:  # noqa: ANN401 - the stream's item
        """Return the newest item, again if there is none newer; raises like `next` without one."""
        with self._arrived:
            if self._newest is not None:
                self._waiting.clear()
                return self._newest
        return self.next(timeout)

    def _read(self) -> None:
        waiting, until = pauses(), float("inf")
        try:
            while time.monotonic() < until:
                try:
                    self._listen()
                except ConfigError as error:
                    self._failed = error
                    return
                except AeroDaaSError:
                    # The follower meets and tells the same.
                    time.sleep(next(waiting))
                except Exception as error:
                    # Not the mission's end, for which its reader would take it.
                    self._failed = MissionError(f"{self._stream}: {failure_line(error)}")
                    raise
                else:
                    return
                if self._follower.mission.phase.over:
                    until = min(until, time.monotonic() + _LAST_SECONDS)
        finally:
            with self._arrived:
                self._ended = True
                self._arrived.notify_all()

    def _listen(self) -> None:
        """Take what one connection brings until the mission is over."""
        with self._client.live(self._follower.mission.id, _RATE, self._stream) as live:
            for message in live:
                if isinstance(message, ReceivedItem):
                    self._accept(message)

    def _accept(self, message: ReceivedItem) -> None:
        item, wrong = None, message.left_out
        if not wrong:
            try:
                item = self._revealed(unpack(message.content, message.blob))
            except MessageError as error:
                wrong = str(error)
        if wrong:
            warnings.warn(f"{self._stream}: an item is left out: {wrong}", stacklevel=2)
            return
        if item is None:
            return
        with self._arrived:
            self._waiting.append(item)
            self._newest = item
            self._arrived.notify_all()
