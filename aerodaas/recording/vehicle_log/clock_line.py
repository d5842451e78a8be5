"""The autopilot's clock as a line over the mission's: offset, drift, and the error."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerodaas.errors import RecordingError
from aerodaas.recording.vehicle_log.log import Floats

__all__ = ["ClockLine", "fit_clock_line", "starts_of"]

_MOST = 400
"""Pairs of which a line is made: of all pairs among them, a slope each."""
_SHORTEST = 10.0
"""Seconds below which two clocks' drift cannot be told from the stamps' own errors."""
_STRAIGHT, _STRAIGHT_SHARE = 1.0, 0.75
"""Seconds beside a line within which a pair lies on it, and the share of pairs that have to."""
_BACK = 1.0
"""Seconds by which a clock reads less than before only after a restart."""
_SURE = 95
"""Percent of the pairs within the error."""


@dataclass(frozen=True, slots=True)
class ClockLine:
    """Autopilot's seconds = `offset` + `rate` * mission seconds."""

    offset: float
    """What the autopilot's clock read at second 0 of the mission."""
    rate: float
    """Seconds of the autopilot's clock in one of the mission's."""
    error: float
    """Seconds by which a moment may be wrong: within them are 95 % of the pairs on the line; with
    TIMESYNC's own error."""
    synchronised: bool
    """Whether the pairs come from TIMESYNC. If not, the link's delay comes on top of the error."""

    @property
    def drift(self) -> float:
        """Parts per million by which the autopilot's clock is fast."""
        return 1e6 * (self.rate - 1.0)

    def mission_time(self, autopilot: Floats) -> Floats:
        """Mission seconds of seconds of the autopilot's clock."""
        return (autopilot - self.offset) / self.rate

    def __str__(self) -> str:
        delay = "" if self.synchronised else ", and late by the link's delay (it told no TIMESYNC)"
        return (
            f"clocks {self.offset:+.3f} s apart, drifting by {self.drift:+.0f} ppm, "
            f"within {1e3 * self.error:.0f} ms{delay}"
        )


def starts_of(pairs: Floats) -> list[Floats]:
    """The pairs of each start of the autopilot, in order: its clock begins anew with each."""
    back = np.flatnonzero(np.diff(pairs[:, 1]) < -_BACK) + 1
    return np.split(pairs, back)


def fit_clock_line(pairs: Floats) -> ClockLine:
    """Lay a line through pairs by Theil and Sen: the median of all slopes, then of all offsets.

    Up to a quarter of the pairs may be anywhere (Theil 1950, Sen 1968).

    Args:
        pairs: Mission seconds, autopilot's seconds and error (NaN: not by TIMESYNC) of one start of
            the autopilot, shape (N, 3), N at least 1. Pairs by TIMESYNC are preferred.

    Raises:
        RecordingError: If the pairs are on no line.
    """
    known = np.isfinite(pairs[:, 2])
    synchronised = bool(known.any())
    if synchronised:
        pairs = pairs[known]
        pairs = pairs[pairs[:, 2] <= 2.0 * np.median(pairs[:, 2])]
    pairs = pairs[np.linspace(0, len(pairs) - 1, min(_MOST, len(pairs))).astype(int)]
    mission, autopilot = pairs[:, 0], pairs[:, 1]
    span = float(np.ptp(mission))
    rate = 1.0
    if span >= _SHORTEST:
        apart = mission[:, None] - mission[None, :]
        far = apart > span / 4.0
        rate = float(np.median((autopilot[:, None] - autopilot[None, :])[far] / apart[far]))
    offset = float(np.median(autopilot - rate * mission))
    beside = np.abs(autopilot - offset - rate * mission)
    near = beside[beside <= _STRAIGHT]
    if rate <= 0.0 or len(near) < _STRAIGHT_SHARE * len(beside):
        raise RecordingError(
            "the autopilot's clock in the recording runs on no line "
            f"({np.median(beside):.1f} s beside it): no log can be laid over it"
        )
    own = float(np.median(pairs[:, 2])) if synchronised else 0.0
    return ClockLine(offset, rate, float(np.percentile(near, _SURE)) + own, synchronised)
