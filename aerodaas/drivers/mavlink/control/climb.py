"""One take-off: mode, arming and climb, each after the other was done, none of them twice.

Acknowledgements get lost: an order counts as done when the vehicle shows that it is.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from aerodaas.drivers.mavlink.microservices.commander import (
    Commander,
    CommandResult,
    PendingCommand,
)
from aerodaas.drivers.mavlink.wire.dialect import mavlink

__all__ = ["Climb"]

_PATIENCE = 20.0
"""Seconds from the first order within which it must be armed and climbing."""
_NEAR = 0.2
"""Metres below the height asked for at which it is reached; a tenth of it where that is more."""
_CALM = 0.3
"""m/s."""
_DOUBT = 3.0
"""Seconds in which a refusal of an order that was sent twice may mean that it was done before."""


class _Refusal(NamedTuple):
    order: PendingCommand
    text: str
    until: float


class Climb:
    """Commands of one take-off; `failed` gets the reason of a failure, at most once."""

    def __init__(
        self,
        commander: Commander,
        orders: Sequence[PendingCommand],
        goal: float,
        *,
        height: float,
        armed: Callable[[], bool],
        shows: Callable[[PendingCommand], bool],
        climbs: Callable[[float], None],
        failed: Callable[[str], None],
        now: float,
    ) -> None:
        """Climb `height` metres to `goal`, metres up.

        `shows` tells whether the vehicle is seen to have done an order; `climbs` is called before
        the last order.
        """
        self.goal = goal
        self.may_start = False
        """Whether something has been sent that starts motors."""
        self._near = max(_NEAR, 0.1 * height)
        self._commander = commander
        self._orders = list(orders)
        self._armed = armed
        self._shows = shows
        self._climbs = climbs
        self._failed = failed
        self._started = self._now = now
        self._doubt: _Refusal | None = None
        self._over = False
        self._next()

    @property
    def ordered(self) -> bool:
        """True once the last order is given."""
        return not self._orders

    def turn(self, now: float, up: float, rise: float) -> bool:
        """Look how far it is: `up` metres, rising at `rise` m/s; True once it is done."""
        self._now = now
        self._settle_doubt(now)
        if self._over:
            return True
        if not self._armed():
            if now - self._started > _PATIENCE:
                self.fail("it did not start its motors")
            return False
        self._over = self.goal - up < self._near and abs(rise) < _CALM
        return self._over

    def cancel(self) -> None:
        """Give no further order, and repeat none."""
        self._over = True
        self._orders.clear()
        for number in (
            mavlink.MAV_CMD_DO_SET_MODE,
            mavlink.MAV_CMD_COMPONENT_ARM_DISARM,
            mavlink.MAV_CMD_NAV_TAKEOFF,
        ):
            self._commander.withdraw(number)

    def fail(self, text: str) -> None:
        """It comes to nothing."""
        if not self._over:
            self.cancel()
            self._failed(text)

    def _next(self) -> None:
        if self._over or not self._orders:
            return
        order = self._orders.pop(0)
        self.may_start |= order.number == mavlink.MAV_CMD_COMPONENT_ARM_DISARM
        if not self._orders:
            self._climbs(self._now)
        self._commander.give(
            order,
            lambda outcome: self._done(order, outcome),
            still=lambda: not (self._over or self._shows(order)),
            now=self._now,
        )

    def _done(self, order: PendingCommand, outcome: CommandResult) -> None:
        if self._over or outcome.replaced:
            return
        if outcome.accepted or self._shows(order):
            self._next()
            return
        text = f"{order.what}: {outcome.text}"
        if outcome.tries > 1:
            self._doubt = _Refusal(order, text, self._now + _DOUBT)
        else:
            self.fail(text)

    def _settle_doubt(self, now: float) -> None:
        doubt = self._doubt
        if doubt is None:
            return
        if self._shows(doubt.order):
            self._doubt = None
            self._next()
        elif now > doubt.until:
            self.fail(doubt.text)
