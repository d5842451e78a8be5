"""The edge that several flights share: whose analysis is next, by the tenants' weights.

Each flight has processes of its own; what they share is the machine. A flight with an analytics
scheduler asks for a turn before its dispatcher starts a task on the edge, and gives it back after
it. Turns are given by start-time fair queueing over tenants.
"""

from __future__ import annotations

import contextlib
import itertools
import json
import socket
import threading
import time
from dataclasses import dataclass
from pathlib import Path

from aerodaas.clock import NANOSECONDS
from aerodaas.errors import ConfigError
from aerodaas.schedulers.analytics.fair_queue import FairQueue
from aerodaas.unix_server import UnixServer, fits_a_socket

__all__ = ["EdgeArbiter"]

_LONGEST = 5 * NANOSECONDS
"""A turn that is kept so long is over: its flight hangs, and is asked no more."""
_LONGEST_HEAD = 1000
_LOOK_SECONDS = 0.5
_MOST_FLIGHTS = 1000
"""Most connections at once; each flight has one."""


@dataclass
class _Flight:
    """One flight's connection."""

    socket: socket.socket
    tenant: str
    weight: float
    asked: int | None = None
    """Place in the order of asking; None while it asks for nothing."""
    since: int | None = None
    """When it was given its turn, nanoseconds; None without one."""
    counted: int = 0
    """Nanoseconds that this turn was counted for."""


class EdgeArbiter:
    """Gives turns on the edge, in a thread of its own; without it, flights run as they like.

    A flight tells its tenant and weight in a line of JSON; then it asks by `a`, is given its turn
    by `g`, and gives it back by `r`.
    """

    def __init__(self, path: Path, slots: int) -> None:
        """Listen at the socket `path`, for at most `slots` turns at once.

        Raises ConfigError for a path that is too long for a socket.
        """
        if not fits_a_socket(path):
            raise ConfigError(f"{path} is too long a path for a socket: use a shorter --state")
        self._slots = slots
        self._lock = threading.Lock()
        self._queue = FairQueue()
        self._newest: dict[str, int] = {}
        """Nanoseconds of each tenant's newest turn, which the next one is expected to take."""
        self._numbers = itertools.count()
        self._flights: list[_Flight] = []
        self._server = UnixServer(path, self._serve, name="edge", most=_MOST_FLIGHTS)

    def start(self) -> None:
        """Start giving turns."""
        self._server.start()

    def close(self) -> None:
        """Give no more turns; flights run as they like."""
        self._server.close()

    def _serve(self, connection: socket.socket) -> None:
        # Also the pace at which a turn that is kept too long is noticed by those who wait.
        connection.settimeout(_LOOK_SECONDS)
        flight = self._met(connection)
        if flight is None:
            return
        with self._lock:
            self._flights.append(flight)
        try:
            while not self._server.closed.is_set() and self._heard(flight):
                pass
        finally:
            with self._lock:
                self._end(flight)
                self._flights.remove(flight)
                self._give(time.monotonic_ns())

    @staticmethod
    def _met(connection: socket.socket) -> _Flight | None:
        """Flight of a connection by its first line; None without one."""
        try:
            with connection.makefile("rb", buffering=0) as lines:
                told = json.loads(lines.readline(_LONGEST_HEAD))
            return _Flight(connection, str(told["tenant"]), float(told["weight"]))
        except (OSError, ValueError, KeyError, TypeError):
            return None

    def _heard(self, flight: _Flight) -> bool:
        """Do what a flight asks for; returns whether it is still there."""
        try:
            said = flight.socket.recv(64)
        except TimeoutError:
            said = b"?"
        except OSError:
            said = b""
        with self._lock:
            for word in said:
                if word == ord("a") and flight.asked is None and flight.since is None:
                    flight.asked = next(self._numbers)
                elif word == ord("r"):
                    self._end(flight)
            self._give(time.monotonic_ns())
        return bool(said)

    def _give(self, now: int) -> None:
        """Give turns as far as there are slots; with the lock held."""
        for flight in self._flights:
            if flight.since is not None and now - flight.since > _LONGEST:
                self._end(flight)
        while waiting := [one for one in self._flights if one.asked is not None]:
            if sum(one.since is not None for one in self._flights) >= self._slots:
                return
            flight = min(waiting, key=lambda one: (self._queue.tag(one.tenant), one.asked))
            flight.asked, flight.since = None, now
            flight.counted = self._newest.get(flight.tenant, 0)
            self._queue.serve(flight.tenant, flight.counted / flight.weight)
            # One that has gone is noticed by its own thread.
            with contextlib.suppress(OSError):
                flight.socket.send(b"g")

    def _end(self, flight: _Flight) -> None:
        """Count what a turn has taken; with the lock held."""
        flight.asked = None
        if flight.since is None:
            return
        taken, flight.since = time.monotonic_ns() - flight.since, None
        self._newest[flight.tenant] = taken
        self._queue.correct(flight.tenant, (taken - flight.counted) / flight.weight)
