"""Recent texts of the autopilot: STATUSTEXT, assembled from its pieces."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

__all__ = ["Texts"]

_KEPT = 40
_PIECES = 16
_GRAVE = 4
"""Severity of a warning; smaller is more severe."""


class _Text(NamedTuple):
    at: float
    severity: int
    text: str


class Texts:
    """The newest texts of one vehicle."""

    def __init__(self) -> None:
        self._texts: deque[_Text] = deque(maxlen=_KEPT)
        self._pieces: dict[int, dict[int, str]] = {}

    def add_statustext(
        self, text: str, severity: int, now: float, number: int = 0, piece: int = 0
    ) -> None:
        """Add one STATUSTEXT.

        Args:
            text: Of the message.
            severity: MAV_SEVERITY, 0 the gravest.
            now: Monotonic clock, seconds.
            number: Id of a text in pieces; 0 for a whole one.
            piece: Number of the piece, from 0.
        """
        whole = 50
        if number == 0:
            self.add(text, severity, now)
            return
        pieces = self._pieces.setdefault(number, {})
        pieces[piece] = text
        if len(text) < whole or len(pieces) >= _PIECES:
            del self._pieces[number]
            self.add("".join(pieces[index] for index in sorted(pieces)), severity, now)
        while len(self._pieces) > _PIECES:
            self._pieces.pop(next(iter(self._pieces)))

    def add(self, text: str, severity: int, now: float) -> None:
        """Add a complete text.

        Args:
            text: The text; unprintable letters are left out.
            severity: MAV_SEVERITY, 0 the gravest.
            now: Monotonic clock, seconds.
        """
        text = "".join(letter for letter in text if letter.isprintable()).strip()
        if text:
            self._texts.append(_Text(now, severity, text))

    def recent(self, now: float, seconds: float, severity: int = _GRAVE) -> list[str]:
        """Texts of the last moments, each once, oldest first.

        Args:
            now: Monotonic clock, seconds.
            seconds: Age up to which they count.
            severity: The least grave MAV_SEVERITY that counts.
        """
        fresh = (
            one.text for one in self._texts if now - one.at <= seconds and one.severity <= severity
        )
        return list(dict.fromkeys(fresh))
