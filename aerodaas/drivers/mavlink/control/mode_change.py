"""Changes of the flight mode: asked for, repeated while they are not shown, and told if refused."""

from __future__ import annotations

import time
from collections.abc import Callable

from aerodaas.drivers.mavlink.autopilots.autopilot import Autopilot
from aerodaas.drivers.mavlink.control.departure import Departure
from aerodaas.drivers.mavlink.microservices.commander import Commander, CommandResult
from aerodaas.drivers.mavlink.state.phase import FlightMode, FlightPhase
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.messages.vehicle import VehicleMode

__all__ = ["ModeChange", "flight_objection"]

_STEERED = {
    *(VehicleMode.HOLDING, VehicleMode.GUIDED, VehicleMode.MISSION),
    VehicleMode.RETURNING,
}
_WHY = {
    VehicleMode.MANUAL: ": a pilot flies it",
    VehicleMode.FAILSAFE: ": its own protection flies it",
    VehicleMode.GROUNDED: " on the ground; take off first",
}


def flight_objection(mode: VehicleMode, *, climbing: bool, landing: bool) -> str:
    """Why a vehicle in `mode` is given no order of flight; empty if it is.

    Args:
        mode: The vehicle's mode.
        climbing: Whether it is given one also while it takes off.
        landing: Whether it is given one also while it lands.

    Returns:
        A text to be read after "cannot …".
    """
    if mode in _WHY:
        return _WHY[mode]
    allowed = mode in _STEERED
    allowed |= climbing and mode is VehicleMode.TAKING_OFF
    allowed |= landing and mode is VehicleMode.LANDING
    return "" if allowed else f" while it is {mode.value.replace('_', ' ')}"


def _ignore(_: str) -> None:
    return


class ModeChange:
    """Asks one vehicle for its modes; called under the driver's lock."""

    def __init__(
        self,
        autopilot: Autopilot,
        commander: Commander,
        departure: Departure,
        phase: FlightPhase,
        *,
        words: Callable[[], list[str]],
        tell: Callable[[str], None],
    ) -> None:
        """Refusals go to `tell`, with the autopilot's own `words` of the last seconds."""
        self._autopilot = autopilot
        self._commander = commander
        self._departure = departure
        self._phase = phase
        self._words = words
        self._tell = tell

    def ask(self, wish: FlightMode, refused: Callable[[str], None] = _ignore) -> None:
        """Ask for a mode, unless that is under way or done.

        While the vehicle's mode is not known, nothing is asked: somebody else may have chosen one.

        Args:
            wish: The mode.
            refused: Called with the reason of a no.
        """
        phase, now = self._phase, time.monotonic()
        if not self._commander.in_touch(now):
            return
        under_way = self._commander.under_way(mavlink.MAV_CMD_DO_SET_MODE)
        asked = under_way is not None and under_way.mode is wish
        if phase.wish is wish and (asked or phase.shown is wish):
            return
        if self._departure.climbs and wish is not FlightMode.GUIDED:
            self._departure.let_go()
        phase.ask(wish, now)
        order = self._autopilot.ask_mode(wish)

        def done(outcome: CommandResult) -> None:
            if not (outcome.accepted or outcome.replaced) and phase.wish is wish:
                text = f"{order.what}: {outcome.text} {'; '.join(self._words())}".rstrip()
                self._tell(text)
                refused(text)

        self._commander.give(
            order, done, still=lambda: phase.wish is wish and not phase.seen, now=now
        )
