"""An emulated Remote ID transmitter, on the vehicle's own wire."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from aerodaas.drivers.mavlink.wire.dialect import mavlink

__all__ = ["EmulatedTransmitter"]

_PERIOD = 1.0
"""Seconds between two words about its status."""
_FRESH = 5.0
"""Seconds for which the operator's position counts."""
_GOOD, _FAIL = (
    mavlink.MAV_ODID_ARM_STATUS_GOOD_TO_ARM,
    mavlink.MAV_ODID_ARM_STATUS_PRE_ARM_FAIL_GENERIC,
)
_TOLD = "OPEN_DRONE_ID_"


class EmulatedTransmitter:
    """It is ready once it knows aircraft and operator; its attributes are what goes wrong."""

    component = mavlink.MAV_COMP_ID_ODID_TXRX_1

    def __init__(self, say: Callable[[Any], None], *, present: bool, uas_id: str = "") -> None:
        """Speak by `say` where it is `present`; `uas_id` is what its maker has written into it."""
        self.present = present
        self.error = ""
        """What it complains about, beside what it misses."""
        self.claims: int | None = None
        """The status that it tells whatever is true; None: the true one."""
        self.heard: list[tuple[float, Any]] = []
        """What it was told, each with its second."""
        self.newest: dict[str, Any] = {}
        """The newest of each kind."""
        self._uas_id = uas_id
        self._say = say
        self._due = -math.inf
        self._placed_at = -math.inf

    def hear(self, message: Any, now: float) -> None:  # noqa: ANN401 - pymavlink has no types
        """Take what is said to it."""
        kind = message.get_type()
        if not kind.startswith(_TOLD) or not self.present:
            return
        self.heard.append((now, message))
        self.newest[kind] = message
        # An update without all that belongs to it says nothing.
        whole = "OPEN_DRONE_ID_SYSTEM" in self.newest
        if kind.startswith("OPEN_DRONE_ID_SYSTEM") and whole and message.operator_latitude:
            self._placed_at = now

    def missing(self, now: float) -> str:
        """What it misses; empty if nothing."""
        if not (self._uas_id or "OPEN_DRONE_ID_BASIC_ID" in self.newest):
            return "missing basic_id message"
        if now - self._placed_at > _FRESH:
            return "missing operator location"
        return ""

    def turn(self, now: float) -> None:
        """Tell its status when it is due."""
        if not self.present or now < self._due:
            return
        self._due = now + _PERIOD
        error = self.error or self.missing(now)
        status = (_FAIL if error else _GOOD) if self.claims is None else self.claims
        self._say(mavlink.MAVLink_open_drone_id_arm_status_message(status, error.encode()))
