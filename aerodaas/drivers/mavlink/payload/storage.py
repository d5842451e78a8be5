"""How much room a camera's card has, by STORAGE_INFORMATION."""

from __future__ import annotations

import math
from dataclasses import dataclass

from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.drivers.mavlink.wire.link import Message

__all__ = ["CardState", "card_state"]

_FULL = 64.0
"""MiB: room for a handful of pictures."""
_TROUBLES = {
    mavlink.STORAGE_STATUS_EMPTY: "it has no card",
    mavlink.STORAGE_STATUS_UNFORMATTED: "its card is not formatted",
}


@dataclass(frozen=True)
class CardState:
    """State of a camera's memory card, as the camera tells it."""

    free: float | None
    """MiB; None where it is not told."""
    trouble: str = ""
    """Why it keeps no pictures, or soon will not; empty if it does."""


def card_state(message: Message) -> CardState:
    """Read a STORAGE_INFORMATION, whatever it holds."""
    status, free = int(message.status), float(message.available_capacity)
    known = status == mavlink.STORAGE_STATUS_READY and math.isfinite(free) and free >= 0.0
    room = free if known else None
    if room is not None and room < _FULL:
        return CardState(room, f"its card is full: {room:.0f} MiB are left")
    return CardState(room, _TROUBLES.get(status, ""))
