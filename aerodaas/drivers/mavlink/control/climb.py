"""Sequence of one take-off: mode, arming and climb, each after the previous one, none twice.

Acknowledgements get lost: an order counts as executed when the vehicle's state shows it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from aerodaas.drivers.mavlink.microservices.commander import (
    Commander,
    CommandResult,
    PendingCommand,
)
from aerodaas.drivers.mavlink.state.frames import LocalFrame
from aerodaas.drivers.mavlink.state.phase import FlightMode, FlightPhase
from aerodaas.drivers.mavlink.state.telemetry import Telemetry
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.geometry.frames import Vector
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.vehicle import PositionSetpoint

__all__ = ["Climb", "ClimbCompletion"]

_PATIENCE = 20.0
"""Seconds from the first order within which it must be armed and climbing."""
_NEAR = 0.2
"""Tolerance of the height in metres; a tenth of the height if that is more."""
_CALM = 0.3
"""m/s."""
_OVER = 1.0
"""Metres above the height from which on it is not waited for: ArduPilot counts from its home, which
may lie higher than the vehicle stands."""
_DOUBT = 3.0
"""Seconds in which the refusal of an order sent twice may mean that the first was executed."""


class _Refusal(NamedTuple):
    order: PendingCommand
    text: str
    until: float


class Climb:
    """Sequencer of one take-off; `failed` is called with the reason of a failure, at most once."""

    def __init__(
        self,
        commander: Commander,
        orders: Sequence[PendingCommand],
        goal: float,
        *,
        height: float,
        armed: Callable[[], bool],
        shows: Callable[[PendingCommand], bool],
        asks: Callable[[FlightMode, float], None],
        failed: Callable[[str], None],
        now: float,
    ) -> None:
        """Climb `height` metres to `goal`, metres up.

        `shows` returns whether the vehicle's state shows that an order was executed; `asks` is
        called with each mode before its order is sent.
        """
        self.goal = goal
        self.may_start = False
        """Whether an order that starts motors has been sent."""
        self._near = max(_NEAR, 0.1 * height)
        self._commander = commander
        self._orders = list(orders)
        self._armed = armed
        self._shows = shows
        self._asks = asks
        self._failed = failed
        self._started = self._now = now
        self._doubt: _Refusal | None = None
        self._over = False
        self._next()

    @property
    def ordered(self) -> bool:
        """True once the last order is given."""
        return not self._orders

    def update(self, now: float, up: float, rise: float) -> bool:
        """Update with the vehicle's height; True when done.

        Args:
            now: Monotonic clock, seconds.
            up: Height in the autopilot's frame, metres.
            rise: Climb rate, m/s.
        """
        self._now = now
        self._settle_doubt(now)
        if self._over:
            return True
        if not self._armed():
            if now - self._started > _PATIENCE:
                self.fail("it did not start its motors")
            return False
        short = self.goal - up
        self._over = short < -_OVER or (short < self._near and abs(rise) < _CALM)
        return self._over

    def cancel(self) -> None:
        """Send no further order, and repeat none."""
        self._over = True
        self._orders.clear()
        self._commander.withdraw_steering()

    def fail(self, text: str) -> None:
        """End with a failure."""
        if not self._over:
            self.cancel()
            self._failed(text)

    def _next(self) -> None:
        if self._over or not self._orders:
            return
        order = self._orders.pop(0)
        self.may_start |= order.number == mavlink.MAV_CMD_COMPONENT_ARM_DISARM
        if order.mode is not None:
            self._asks(order.mode, self._now)
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


class ClimbCompletion:
    """Setpoints from where an autopilot's take-off has ended up to the commanded height."""

    def __init__(self, telemetry: Telemetry, phase: FlightPhase) -> None:
        """Judge by these."""
        self._telemetry = telemetry
        self._phase = phase
        self._place: Vector | None = None

    def begin(self) -> None:
        """Forget the place of an earlier take-off."""
        self._place = None

    def setpoint(
        self,
        goal: float,
        frame: LocalFrame,
        odometry: Callable[[], Odometry],
        climb: float,
        *,
        near: bool,
    ) -> PositionSetpoint | None:
        """The setpoint that completes a climb to `goal`; None if none is due.

        PX4 reports hold before it takes off, too. Once commanded to follow setpoints, it gets them,
        whatever it shows: without, it would leave that mode by its own protection.

        Args:
            goal: Metres up in the autopilot's frame.
            frame: The autopilot's frame.
            odometry: Where the vehicle is.
            climb: Climb rate, m/s.
            near: Whether it flies so high that the autopilot may have ended its take-off.
        """
        phase = self._phase
        done = phase.seen and phase.shown in {FlightMode.HOLD, FlightMode.GUIDED}
        if not ((done and near) or phase.wish is FlightMode.GUIDED):
            return None
        if self._place is None:
            self._place = odometry().position
        top = frame.position(np.array([0.0, 0.0, -goal]))[2]
        return PositionSetpoint(np.array([*self._place[:2], top]), None, climb)
