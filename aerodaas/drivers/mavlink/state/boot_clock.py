"""The autopilot's clock since its start, by exchanges of TIMESYNC."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from aerodaas.clock import NANOSECONDS
from aerodaas.drivers.mavlink.wire.dialect import mavlink

__all__ = ["BootClock"]

_OFTEN, _SELDOM = 1.0, 2.0
"""Seconds from one exchange to the next: at first and while answers are missing, and later on."""
_AGAIN = 0.25
"""Seconds from one request to the next while a vehicle that answered before leaves them unanswered:
so many in a few seconds that a poor link does not look like one that is lost."""
_FIRST = 10
"""Exchanges of the former kind: enough that one of them is likely to be swift."""
_LONGEST = 1.0
"""Seconds of a round trip from which nothing is learnt that its own stamps do not tell."""
_LATEST = 365 * 86_400 * NANOSECONDS
"""Nanoseconds that no autopilot runs for; one that tells the date here tells more."""
_DRIFT = 1e-4
"""Seconds a second by which two clocks may part: twice what common crystals may."""
_SYSTEMS = 256
"""Ids of systems, in as many nanoseconds of a request's stamp."""
_GRAIN = 1e-3
"""Seconds by which an autopilot may stamp coarsely."""


@dataclass(frozen=True)
class _Sample:
    """One exchange."""

    zero: float
    """The second of our clock at which the autopilot's read zero."""
    half: float
    """Half of the round trip, by which it may be wrong, in seconds."""
    at: float
    """The second of our clock when it ended."""

    def error(self, now: float) -> float:
        """Seconds by which it may be wrong at `now`."""
        return self.half + _DRIFT * max(0.0, now - self.at)

    def agrees(self, older: _Sample) -> bool:
        """Whether both can be true of one clock."""
        return abs(self.zero - older.zero) <= self.half + older.error(self.at) + _GRAIN


class BootClock:
    """Tells what the autopilot's clock reads at a second of ours, by the swiftest exchange.

    Only the answer to our latest request counts, once, if it is swift and tells of a clock that
    runs since a start. Where it contradicts what is known, it is believed when a second one says
    the same: the autopilot may have started anew.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        """Know nothing; `clock` is ours, in monotonic seconds.

        It is read as a request leaves and an answer is looked at, so that waiting in between only
        makes a round trip longer: the turn of the link's thread may have begun before either.
        """
        self._clock = clock
        self._due = 0.0
        self._asked = self._system = 0
        self._pending: int | None = None
        self._answered = False
        self._unanswered_since: float | None = None
        """When the first request after the last answer left."""
        self._best: _Sample | None = None
        self._doubt: _Sample | None = None

    def request(self, system: int) -> Any | None:  # noqa: ANN401 - pymavlink has no types
        """A request to be sent now; None if it is too early. `system` is the vehicle's id."""
        now = self._clock()
        if self._asked and now < self._due:
            return None
        self._asked += 1
        self._due = now + self._pause()
        self._unanswered_since = now if self._unanswered_since is None else self._unanswered_since
        # Every vehicle on a wire answers: its own number tells whose answer it is.
        self._system = system
        self._pending = (int(now * NANOSECONDS) // _SYSTEMS - 1) * _SYSTEMS + system
        return mavlink.MAVLink_timesync_message(0, self._pending)

    def _pause(self) -> float:
        """Seconds from this request to the next one."""
        if self._unanswered_since is not None:
            return _AGAIN if self._answered else _OFTEN
        return _SELDOM if self._asked >= _FIRST else _OFTEN

    def on_timesync(self, message: Any) -> None:  # noqa: ANN401
        """Process a TIMESYNC of the autopilot; its own requests are none of our answers."""
        now = self._clock()
        if message.tc1 > 0 and (message.ts1 - self._system) % _SYSTEMS == 0:
            self._answered, self._unanswered_since = True, None
        if message.ts1 != self._pending or not 0 < message.tc1 < _LATEST:
            return
        asked, self._pending = message.ts1 / NANOSECONDS, None
        half = (now - asked) / 2
        if not 0.0 <= half <= _LONGEST / 2:
            return
        sample = _Sample(asked + half - message.tc1 / NANOSECONDS, half, now)
        best = self._best
        if best is None or sample.agrees(best):
            if best is None or half <= best.error(now):
                self._best = sample
            self._doubt = None
        elif self._doubt is not None and sample.agrees(self._doubt):
            self._best, self._doubt = sample, None
        else:
            self._doubt, self._due = sample, now + _OFTEN

    @property
    def unanswered(self) -> float:
        """Seconds for which a vehicle that answered before has left all requests unanswered."""
        if not self._answered or self._unanswered_since is None:
            return 0.0
        return self._clock() - self._unanswered_since

    def reading(self, at: float) -> tuple[float, float] | None:
        """Reading of the vehicle's clock at our second `at`, and its error bound, both in seconds.

        None before the first exchange.
        """
        if self._best is None:
            return None
        return at - self._best.zero, self._best.error(at)
