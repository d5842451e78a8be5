"""Which orders make sense in which mode."""

from __future__ import annotations

from aerodaas.messages.vehicle import VehicleMode

__all__ = ["flight_objection"]

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
