"""Withdrawal of a take-off: it ends when the motors certainly stand.

An order to arm that was sent may be carried out later than the order to stop: packets overtake
each other, and an acknowledgement does not say which of two orders it means. So the HEARTBEATs of
some time after the last order decide.
"""

from __future__ import annotations

from collections.abc import Callable

from aerodaas.drivers.mavlink.microservices.commander import (
    Commander,
    CommandResult,
    PendingCommand,
)

__all__ = ["TakeoffCancellation"]

_CALM = 2
"""HEARTBEATs in a row with standing motors after which it is over."""
_SETTLED = 1.5
"""Seconds after the last order or start of motors before which it is not."""


class TakeoffCancellation:
    """Stops the motors of a vehicle that may be starting them, or lands it if it flies already.

    Its methods are called in the link's thread or under the driver's lock.
    """

    def __init__(
        self,
        commander: Commander,
        disarm: PendingCommand,
        land: Callable[[], None],
        now: float,
        *,
        flies: bool,
    ) -> None:
        """Send `disarm` at once; `land` is called if it `flies`, or refuses, because then it does.

        `land` is called with each HEARTBEAT of a vehicle that flies, and must bear that.
        """
        self.over = False
        """Whether the motors stand, and no pending order could start them."""
        self._commander = commander
        self._disarm = disarm
        self._land = land
        self._flies = flies
        self._calm = 0
        self._last_order = now
        self._go_on(now)

    def observe(self, now: float, *, armed: bool) -> None:
        """Update by a HEARTBEAT.

        Args:
            now: Monotonic clock, seconds.
            armed: Whether the vehicle is armed by it.
        """
        waits = self._commander.under_way(self._disarm.number) is not None
        if armed:
            self._last_order, self._calm = now, 0
            if not waits:
                self._go_on(now)
        elif not waits:
            self._calm += 1
        self.over = self._calm >= _CALM and now - self._last_order > _SETTLED

    def _go_on(self, now: float) -> None:
        if self._flies:
            self._land()
            return
        self._last_order = now
        self._commander.give(self._disarm, self._done, now=now)

    def _done(self, outcome: CommandResult) -> None:
        if outcome.accepted or outcome.replaced or outcome.text == "no answer":
            return
        self._flies = True
        self._land()
