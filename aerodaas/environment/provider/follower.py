"""MissionFollower: keeps up with a mission at a provider, across lost connections."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable

from aerodaas.environment.provider.client import ProviderClient
from aerodaas.environment.provider.exchange import pauses
from aerodaas.environment.provider.wire import LiveConnection
from aerodaas.errors import AeroDaaSError, ConfigError
from aerodaas.protocol.schemas import MissionOut

__all__ = ["MissionFollower"]


class MissionFollower:
    """Follower of one mission, in a thread of its own, until it is over or closed.

    While it is connected the provider hears of the user.
    """

    def __init__(
        self,
        client: ProviderClient,
        mission: MissionOut,
        say: Callable[[str], None] = lambda _: None,
        rate: float = 5.0,
        on_state: Callable[[MissionOut], None] = lambda _: None,
    ) -> None:
        """Follow a mission.

        Args:
            client: Connection to its provider.
            mission: Its state so far.
            say: Called in the thread with a line for each lost and found connection.
            rate: Most states a second.
            on_state: Called in the thread with each new state.
        """
        self._client = client
        self._say = say
        self._rate = rate
        self._on_state = on_state
        self._mission = mission
        self._changes = 0
        self._changed = threading.Condition()
        self._closed = threading.Event()
        self._connection: LiveConnection | None = None
        self._failed: AeroDaaSError | None = None
        self._thread = threading.Thread(target=self._follow, name="provider", daemon=True)

    def start(self) -> None:
        """Begin to follow."""
        self._thread.start()

    def close(self) -> None:
        """Follow no more; the mission goes on."""
        self._closed.set()
        connection = self._connection
        if connection is not None:
            with contextlib.suppress(AeroDaaSError, OSError):
                connection.close()

    @property
    def mission(self) -> MissionOut:
        """The newest known state."""
        return self._mission

    @property
    def changes(self) -> int:
        """How many states have arrived."""
        return self._changes

    def await_change(self, seen: int, timeout: float) -> MissionOut:
        """Wait for a state that is newer than those seen.

        Args:
            seen: Number of states that the caller has seen, a former value of `changes`.
            timeout: Seconds to wait at most.

        Returns:
            The newest state, also after the timeout.

        Raises:
            ConfigError: If the provider refuses to tell any more.
        """
        with self._changed:
            self._changed.wait_for(
                lambda: self._changes > seen or self._failed is not None, timeout
            )
            if self._failed is not None:
                raise self._failed
            return self._mission

    def _follow(self) -> None:
        waiting, lost = pauses(), False
        while not self._closed.is_set() and not self._mission.phase.over:
            seen = self._changes
            try:
                self._listen(lost=lost)
                self._update(self._client.mission(self._mission.id))
            except ConfigError as error:
                with self._changed:
                    self._failed = error
                    self._changed.notify_all()
                return
            except AeroDaaSError as error:
                if self._changes > seen:
                    waiting, lost = pauses(), False
                if not lost and not self._closed.is_set():
                    self._say(f"the connection is lost, the mission goes on without it: {error}")
                lost = True
            if not self._mission.phase.over:
                self._closed.wait(next(waiting))

    def _listen(self, *, lost: bool) -> None:
        """Take what one connection brings."""
        with self._client.live(self._mission.id, self._rate) as live:
            self._connection = live
            for message in live:
                if self._closed.is_set():
                    return
                if isinstance(message, MissionOut):
                    if lost:
                        self._say("the connection to the provider is back")
                        lost = False
                    self._update(message)

    def _update(self, mission: MissionOut) -> None:
        with self._changed:
            self._mission = mission
            self._changes += 1
            self._changed.notify_all()
        self._on_state(mission)

    def await_end(self, timeout: float) -> bool:
        """Wait until the mission is over, `timeout` seconds at most; whether it is."""
        until = time.monotonic() + timeout
        while not self._mission.phase.over:
            left = until - time.monotonic()
            if left <= 0.0:
                return False
            self.await_change(self._changes, left)
        return True
