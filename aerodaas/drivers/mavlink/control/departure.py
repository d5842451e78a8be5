"""Take-off from its command to its end: done, refused, or withdrawn."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from aerodaas.drivers.mavlink.control.climb import Climb
from aerodaas.drivers.mavlink.microservices.commander import (
    Commander,
    CommandResult,
    PendingCommand,
)
from aerodaas.drivers.mavlink.state.phase import FlightMode, FlightPhase
from aerodaas.drivers.mavlink.state.telemetry import Telemetry
from aerodaas.drivers.mavlink.wire.dialect import mavlink

__all__ = ["Departure", "TakeoffCancellation"]

_CALM = 2
"""HEARTBEATs in a row with standing motors after which it is over."""
_SETTLED = 1.5
"""Seconds after the last order or start of motors before which it is not."""


class TakeoffCancellation:
    """Stops the motors of a vehicle that may be starting them, or lands it if it flies already.

    An order to arm may be carried out later than the order to stop: packets overtake each other,
    and an acknowledgement does not say which of two orders it means. So the HEARTBEATs of some
    time after the last order decide.

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


_TAKING_OFF = frozenset({FlightMode.TAKE_OFF, FlightMode.HOLD, FlightMode.GUIDED})
"""Modes that a vehicle may report while a take-off is withdrawn."""


class Departure:
    """Take-offs of one vehicle, one at a time; called under the driver's lock."""

    def __init__(
        self,
        commander: Commander,
        telemetry: Telemetry,
        phase: FlightPhase,
        *,
        disarm: PendingCommand,
        hold: PendingCommand,
        flies: Callable[[], bool],
        words: Callable[[], list[str]],
        land: Callable[[], None],
        short: float = 0.0,
    ) -> None:
        """`flies` returns whether it has left the ground; `land` lands a flying vehicle.

        `words` returns the autopilot's own texts about its refusal. `short` is how many metres
        below the commanded height it may end a take-off by a hold; 0: it never does.
        """
        self.refusal = ""
        """Reason why the latest take-off failed."""
        self._commander = commander
        self._telemetry = telemetry
        self._phase = phase
        self._disarm = disarm
        self._hold = hold
        self._flies = flies
        self._words = words
        self._land = land
        self._short = short
        self._top = math.inf
        """Height of the latest take-off, metres up in the autopilot's frame."""
        self._climb: Climb | None = None
        self._cancellation: TakeoffCancellation | None = None

    @property
    def goal(self) -> float | None:
        """Target height in metres in the autopilot's frame, once the whole climb is commanded."""
        return self._climb.goal if self._climb is not None and self._climb.ordered else None

    @property
    def climbed(self) -> bool:
        """Whether it is so high that the autopilot may have ended the take-off by a hold."""
        return self._top - self._telemetry.up < self._short

    @property
    def climbs(self) -> bool:
        """Whether a take-off is under way."""
        return self._climb is not None

    @property
    def withdrawing(self) -> bool:
        """Whether one was withdrawn, and motors might still start or turn."""
        return self._cancellation is not None

    def begin(self, orders: Sequence[PendingCommand], height: float, now: float) -> None:
        """Climb by `orders`.

        Args:
            orders: Arming and take-off, each given after the previous one's end.
            height: Height to climb, metres.
            now: Monotonic clock, seconds.
        """
        assert self._telemetry.position is not None  # noqa: S101 - checked before
        self._phase.rest()
        self._top = height - float(self._telemetry.position[2])
        self._climb = Climb(
            self._commander,
            orders,
            self._top,
            height=height,
            armed=lambda: self._phase.armed,
            shows=self._shows,
            asks=self._phase.ask,
            failed=self._failed,
            now=now,
        )

    def call_off(self, now: float) -> None:
        """Withdraw the take-off: cancel it before it begins; land a flying vehicle."""
        climb, self._climb = self._climb, None
        if climb is None:
            return
        climb.cancel()
        if climb.may_start:
            self.withdraw(now)
        else:
            self._phase.rest()

    def withdraw(self, now: float) -> None:
        """Stop motors that turn, or may yet start, on the ground; land a flying vehicle."""
        self._phase.ask(FlightMode.LAND, now, meanwhile=_TAKING_OFF)
        if not self._flies():
            # In the mode of a take-off, a late order to arm would make it fly.
            self._commander.give(self._hold, now=now)
        self._cancellation = TakeoffCancellation(
            self._commander, self._disarm, self._land, now, flies=self._flies()
        )

    def restart(self) -> None:
        """Handle a restart of the autopilot."""
        if self._climb is not None:
            self._climb.fail("the autopilot started anew")

    def let_go(self) -> None:
        """Stop all commands, as another pilot flies."""
        if self._climb is not None:
            self._climb.cancel()
        self._climb = self._cancellation = None
        self._commander.withdraw_steering()

    def observe(self, now: float, *, was_armed: bool) -> None:
        """Handle a HEARTBEAT, after the phase's update by it.

        Args:
            now: Monotonic clock, seconds.
            was_armed: Whether the vehicle was armed before this HEARTBEAT.
        """
        phase = self._phase
        if was_armed and not phase.armed and self._climb is not None:
            self._climb.fail("it stopped its motors again")
        if phase.taken is not None:
            if self._climb is not None and not phase.armed:
                self.refusal = f"its mode is {phase.shown.value!r} now, not by us"
            self.let_go()
            if not phase.armed:
                phase.rest()
        if self._cancellation is not None:
            self._cancellation.observe(now, armed=phase.armed)
            if self._cancellation.over:
                self._cancellation = None
                phase.rest()

    def update(self, now: float) -> None:
        """Update the climb; called 20 times a second."""
        position, velocity = self._telemetry.position, self._telemetry.velocity
        if self._climb is None or position is None:
            return
        if self._climb.update(now, -float(position[2]), -float(velocity[2])):
            self._climb = None

    def _shows(self, order: PendingCommand) -> bool:
        if order.number == mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
            return self._phase.armed
        if order.number == mavlink.MAV_CMD_NAV_TAKEOFF:
            return self._phase.armed and self._flies()
        return self._phase.shown is order.mode

    def _failed(self, text: str) -> None:
        self.refusal = "; ".join([text, *self._words()])
        now = self._telemetry.heard_at
        self.call_off(now)
