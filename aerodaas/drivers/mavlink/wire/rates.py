"""Requests of the required messages, repeated until they arrive: at first, and after a restart."""

from __future__ import annotations

import math
from collections.abc import Mapping

from aerodaas.drivers.mavlink.autopilots.autopilot import Autopilot
from aerodaas.drivers.mavlink.microservices.commander import Commander, CommandResult
from aerodaas.drivers.mavlink.state.telemetry import Telemetry
from aerodaas.drivers.mavlink.wire.dialect import mavlink

__all__ = ["RateKeeper"]

_OVERDUE = 3.0
"""Seconds without a message after which it is asked for again."""
_PAUSE = 5.0
"""Seconds between two requests for the same message."""
_OCCASIONAL = frozenset({mavlink.MAVLINK_MSG_ID_FENCE_STATUS})
"""Messages that do not come while the vehicle has nothing to tell by them."""


class RateKeeper:
    """Requester of one message after the other; an autopilot accepts one such command at a time."""

    def __init__(
        self, autopilot: Autopilot, commander: Commander, more: Mapping[int, float] | None = None
    ) -> None:
        """Keep the rates that `autopilot` needs, and `more` (Hz by message)."""
        self._autopilot = autopilot
        self._commander = commander
        self._rates = {**autopilot.rates, **(more or {})}
        self._asked_at = dict.fromkeys(self._rates, -math.inf)
        self._settled: set[int] = set()
        self._reboots = 0
        self._waiting = False

    def step(self, telemetry: Telemetry, now: float) -> None:
        """Request the next missing message; called by the link's thread.

        Args:
            telemetry: What the vehicle has told so far.
            now: Monotonic clock, seconds.
        """
        if telemetry.reboots != self._reboots:
            self._reboots = telemetry.reboots
            self._asked_at = dict.fromkeys(self._asked_at, -math.inf)
            self._settled.clear()
        if self._waiting:
            return
        for message, rate in self._rates.items():
            name = mavlink.mavlink_map[message].msgname
            first = self._asked_at[message] == -math.inf
            missing = first or now - telemetry.seen.get(name, -math.inf) > _OVERDUE + 2.0 / rate
            due = now - self._asked_at[message] > _PAUSE
            if missing and due and message not in self._settled:
                self._asked_at[message] = now
                self._ask(message, rate, now)
                return

    def _ask(self, message: int, rate: float, now: float) -> None:
        self._waiting = True

        def done(outcome: CommandResult) -> None:
            self._waiting = False
            answered = outcome.text != "no answer"
            if answered and (not outcome.accepted or message in _OCCASIONAL):
                self._settled.add(message)

        self._commander.give(self._autopilot.interval(message, rate), done, now=now)
