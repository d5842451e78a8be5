"""PX4's events, which it sends instead of STATUSTEXT.

An event's number is a hash of its name (`events::ID` of PX4: 24 bits of 32-bit FNV-1a below the
component's number). The full texts are in a file on the autopilot of the same version; the operator
gets our texts, and none for other events.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from aerodaas.drivers.mavlink.microservices.event_words import CAUSES, CHECKS, COMMANDER

__all__ = ["EventReader", "EventText", "event_number"]


def event_number(name: str) -> int:
    """The number of the autopilot's event called `name`."""
    digest = 0x811C9DC5
    for letter in name.encode():
        digest = (digest ^ letter) * 0x01000193 & 0xFFFFFFFF
    return 1 << 24 | digest & 0xFFFFFF


_CHECKS = {event_number(f"check_{name}"): words for name, words in CHECKS.items()}
_TEXTS = {
    **_CHECKS,
    **{event_number(f"commander_{name}"): words for name, words in COMMANDER.items()},
}
_CAUSE_AT = {
    event_number("commander_failsafe_enter"): 5,
    event_number("commander_failsafe_enter_hold"): 7,
    event_number("commander_failsafe_enter_warn"): 4,
}
"""Where among an event's arguments the cause of a failsafe stands."""
_OF_THE_MODE = frozenset(
    CHECKS[name]
    for name in (
        "modes_cannot_takeoff",
        "modes_manual_control",
        "modes_mission",
        "modes_offboard_signal",
    )
)
_BEGIN = event_number("commander_arming_check_summary")
_END = event_number("commander_health_summary")
_HARMLESS = 5
"""Log level of a notice; larger ones are information, or for the protocol only."""


class EventText(NamedTuple):
    """Text of an event, and its severity as in STATUSTEXT."""

    text: str
    severity: int


class EventReader:
    """Decoder of events, which collects those of each report of the arming checks."""

    def __init__(self) -> None:
        self.objections: tuple[str, ...] = ()
        """Complaints of the latest complete report of the arming checks."""
        self._since: dict[str, float] = {}
        """Second at which each of them was first reported."""
        self._report: list[str] | None = None
        self._latest: int | None = None

    @property
    def objections_to_hold(self) -> tuple[str, ...]:
        """Objections without those of the present mode's own requirements, which hold lacks."""
        return tuple(text for text in self.objections if text not in _OF_THE_MODE)

    def new_objections(self, now: float, seconds: float) -> list[str]:
        """Objections of the last moments, also in flight: its failsafes act for them.

        What a mode lacks is among them only where there is nothing else.

        Args:
            now: Monotonic clock, seconds.
            seconds: Age up to which they count.
        """
        new = [text for text in self.objections if now - self._since[text] <= seconds]
        return [text for text in new if text not in _OF_THE_MODE] or new

    def decode(
        self,
        number: int,
        log_levels: int,
        sequence: int,
        arguments: Sequence[int] = (),
        now: float = 0.0,
    ) -> EventText | None:
        """Decode one event; None for a repetition and for one of no interest.

        Args:
            number: The event's number.
            log_levels: External log level in the lower four bits.
            sequence: Number of this sending; the same one again is a repetition.
            arguments: The event's own arguments, as bytes.
            now: Arrival in seconds.
        """
        if sequence == self._latest:
            return None
        self._latest = sequence
        if number == _BEGIN:
            self._report = []
            return None
        if number == _END:
            if self._report is not None:
                self.objections = tuple(dict.fromkeys(self._report))
                self._since = {text: self._since.get(text, now) for text in self.objections}
            self._report = None
            return None
        severity = log_levels & 0x0F
        if severity >= _HARMLESS:
            return None
        text = _TEXTS.get(number)
        if number in _CAUSE_AT and len(arguments) > _CAUSE_AT[number]:
            text = CAUSES.get(arguments[_CAUSE_AT[number]], text)
        if self._report is not None:
            # Failed checks matter before a take-off; in flight the health monitor reports them.
            self._report.append(text or f"a check that is not known here (event {number:#010x})")
            return None
        # A check outside a report belongs to one whose beginning was lost.
        return None if text is None or number in _CHECKS else EventText(text, severity)
