"""End of a lease, cancellation and silence of a user, kept by the flight's own process."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from aerodaas.clock import WallOffset
from aerodaas.protocol.schemas import SilencePolicy
from aerodaas.service.flights.order import FlightOrder

__all__ = ["LeaseWatch"]

_PERIOD = 0.2
"""Wall seconds between two looks at the clocks."""


class LeaseWatch:
    """Brings the drones home when their lease ends, their mission is cancelled or its user silent.

    It runs beside the drones, so that neither needs the service. Time is monotonic from the order
    on: a clock that is set neither prolongs a lease nor ends it.
    """

    def __init__(
        self,
        order: FlightOrder,
        come_home: Callable[[str], None],
        cancelled: Callable[[], str] = lambda: "",
    ) -> None:
        """Watch over a flight.

        Args:
            order: Of the flight.
            come_home: Called once, with the reason, in another thread.
            cancelled: Tells why the mission is cancelled; empty while it is not.
        """
        self._come_home = come_home
        self._cancelled = cancelled
        self._silence = order.silence
        self._patience = order.silence_seconds
        self._lock = threading.Lock()
        self._heard = time.monotonic()
        self._ends = (order.offset or WallOffset.read()).monotonic(order.ends)
        self._over = threading.Event()
        self.reason = ""
        """Why the drones were called home; empty while the lease is good."""

    def start(self) -> None:
        """Start watching; what is due already is told before this returns."""
        if reason := self._due():
            self.end(reason)
            return
        threading.Thread(target=self._watch, name="lease", daemon=True).start()

    def stop(self) -> None:
        """Stop watching."""
        self._over.set()

    def hear(self) -> None:
        """Note that the user has been heard of."""
        with self._lock:
            self._heard = time.monotonic()

    def extend(self, ends: float) -> bool:
        """Move the end of the lease to `ends`, Unix seconds; False once it is over."""
        with self._lock:
            if self.reason:
                return False
            self._ends = WallOffset.read().monotonic(ends)
            return True

    def end(self, reason: str) -> None:
        """End the lease now: it was revoked, or the mission cancelled."""
        with self._lock:
            if self.reason:
                return
            self.reason = reason
        self._come_home(reason)

    def _watch(self) -> None:
        while not self._over.wait(_PERIOD):
            if reason := self._due():
                self.end(reason)
                return

    def _due(self) -> str:
        if cancelled := self._cancelled():
            return cancelled
        with self._lock:
            now = time.monotonic()
            if now >= self._ends:
                return "the lease has ended"
            if self._silence is SilencePolicy.RETURN and now - self._heard > self._patience:
                return f"nothing was heard of the user for {self._patience:g} s"
            return ""
