"""One take-off: mode, arming and climb, each after the other was accepted, none of them twice."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from aerodaas.drivers.mavlink.commander import Commander, Order, Outcome
from aerodaas.drivers.mavlink.dialect import mavlink

__all__ = ["Climb"]

_PATIENCE = 15.0
"""Seconds from the first order within which it must be armed and climbing."""
_NEAR = 0.2
"""Metres below the height asked for at which it is reached; a tenth of it where that is more."""
_CALM = 0.3
"""m/s."""


class Climb:
    """The orders of one take-off; `failed` is told why it came to nothing, at most once."""

    def __init__(
        self,
        commander: Commander,
        orders: Sequence[Order],
        goal: float,
        *,
        height: float,
        armed: Callable[[], bool],
        climbs: Callable[[float], None],
        failed: Callable[[str], None],
        now: float,
    ) -> None:
        """Climb `height` metres to `goal`, metres up; `climbs` is called before the last order."""
        self.goal = goal
        self._near = max(_NEAR, 0.1 * height)
        self._commander = commander
        self._orders = list(orders)
        self._armed = armed
        self._climbs = climbs
        self._failed = failed
        self._started = self._now = now
        self._over = False
        self._next()

    @property
    def ordered(self) -> bool:
        """True once the last order is given."""
        return not self._orders

    def turn(self, now: float, up: float, rise: float) -> bool:
        """Look how far it is: `up` metres, rising at `rise` m/s; True once it is done."""
        self._now = now
        if self._over:
            return True
        if not self._armed():
            if now - self._started > _PATIENCE:
                self.fail("it did not start its motors")
            return False
        self._over = self.goal - up < self._near and abs(rise) < _CALM
        return self._over

    def cancel(self) -> None:
        """Give no further order."""
        self._over = True
        self._orders.clear()

    def fail(self, text: str) -> None:
        """It comes to nothing."""
        if not self._over:
            self.cancel()
            self._failed(text)

    def _next(self) -> None:
        if self._over or not self._orders:
            return
        order = self._orders.pop(0)
        arms = order.number == mavlink.MAV_CMD_COMPONENT_ARM_DISARM
        if not self._orders:
            self._climbs(self._now)
        self._commander.give(
            order,
            lambda outcome: self._done(order, outcome),
            still=(lambda: not self._armed()) if arms else (lambda: not self._over),
            now=self._now,
        )

    def _done(self, order: Order, outcome: Outcome) -> None:
        if self._over:
            return
        if outcome.accepted:
            self._next()
        else:
            self.fail(f"{order.what}: {outcome.text}")
