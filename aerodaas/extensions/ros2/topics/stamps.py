"""Ages of messages by their time stamps, whose clock need not be ours."""

from __future__ import annotations

from typing import Literal

from aerodaas.clock import NANOSECONDS

__all__ = ["MessageClock", "StampSource"]

StampSource = Literal["auto", "message", "arrival"]
"""Where a measurement's time comes from: its message's stamp, its arrival, or what
`MessageClock` finds."""

_AGREES = NANOSECONDS
"""Most nanoseconds between the stamp of a first message and its arrival for the sender's clock to
be taken for one that is kept together with ours."""
_RESTARTED = 5 * NANOSECONDS
"""Nanoseconds by which a stamp must go back for the sender to have begun anew."""


class MessageClock:
    """Tells how old messages of one topic were as they arrived, and which come twice or too late.

    A sender on a machine whose clock is kept together with ours (NTP, PTP, the same machine) stamps
    with our time; a simulation stamps with its own, which may run slower. By the first message
    `auto` tells one from the other, and keeps to that: a queue that grows on the way must not look
    like another clock.
    """

    def __init__(self, source: StampSource = "auto") -> None:
        """Take ages by `source`."""
        self._source = source
        self._agrees: bool | None = None if source == "auto" else source == "message"
        self._last = 0

    @property
    def shared(self) -> bool:
        """Whether the sender's clock counts as kept together with ours."""
        return bool(self._agrees)

    def age(self, stamp: int, arrival: int) -> int | None:
        """Nanoseconds from the measurement to its arrival.

        Args:
            stamp: The message's stamp, nanoseconds; zero where its sender sets none.
            arrival: Our own clock at its arrival, nanoseconds since the Unix epoch.

        Returns:
            Zero where only the arrival is known; None for a message that is no newer than one
            before it.
        """
        if stamp <= 0:
            return 0
        if stamp <= self._last:
            if stamp > self._last - _RESTARTED:
                return None
            # A simulation that was reset, or a sender that was started again.
            self._agrees = None if self._source == "auto" else self._agrees
        self._last = stamp
        if self._agrees is None:
            self._agrees = abs(arrival - stamp) <= _AGREES
        return max(0, arrival - stamp) if self._agrees else 0
