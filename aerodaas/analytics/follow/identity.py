"""Whether the track that is followed is still the same person, after others came between.

Two people in vests look alike to a detector, and where one hides the other, boxes and motion do
not tell who comes out on which side. So how the followed one and the other looked before is kept
from the moment when their boxes touch, and compared once they are apart again. If that does not
tell, nobody is believed to be the followed one.
"""

from __future__ import annotations

import enum
from collections import Counter
from collections.abc import Iterable, Sequence

from aerodaas.analytics.detection.tracking import Track, touches
from aerodaas.clock import seconds
from aerodaas.messages.appearance import unlikeness

__all__ = ["Certainty", "TargetIdentity"]

_TOGETHER = 2
"""Number of frames that showed a track beside the followed one that make it another person's,
rather than a second one of the same."""
_LOOKS = 3
"""Number of appearances that are compared, at least."""
_MARGIN = 2.0
"""How much more an appearance must be like that of one person than like that of another."""
_ALIKE = 6.0
"""Unlikeness of two people below which looks do not tell them apart."""
_OTHER, _STRANGER = 13.0, 10.0
"""Unlikeness from which on somebody is not the followed one, beside others who are known and where
nobody else is."""
_RECENT = 0.5
"""Seconds since its last detection for which a track's box counts as touched."""
_PATIENCE = 1.5
"""Seconds after the last touch until which the comparison must have told."""


class Certainty(enum.Enum):
    """How sure it is that the followed track is the same person."""

    CERTAIN = enum.auto()
    CONTESTED = enum.auto()
    """Another box touched the followed one's, and they have not been compared since."""
    UNCERTAIN = enum.auto()
    """The comparison did not tell."""


class TargetIdentity:
    """Remembers how the followed person and those who came close look."""

    def __init__(self) -> None:
        """Start without anybody."""
        self.certainty = Certainty.CERTAIN
        self._looks: tuple[bytes, ...] = ()
        """Of the followed person, before the first touch."""
        self._together: Counter[int] = Counter()
        """Number of frames that showed a track beside the followed one, by its id."""
        self._rivals: dict[int, tuple[bytes, ...]] = {}
        """Of those who touched, before they did, by the id of their track."""
        self._began = self._touched = 0
        """Mission times of the first and the last touch, nanoseconds."""

    def reset(self) -> None:
        """Forget everybody, as another target will be chosen."""
        self.certainty = Certainty.CERTAIN
        self._looks = ()
        self._together.clear()
        self._rivals.clear()

    def watch(self, target: Track | None, others: Sequence[Track], stamp: int) -> None:
        """Update the identity by the tracks after a frame.

        Args:
            target: Track of the followed person; None while there is none.
            others: All other tracks.
            stamp: Mission time of the frame, nanoseconds.
        """
        if target is None:
            return
        touched = False
        for one in others:
            touching = touches(target.filter.box, one.filter.box)
            touched |= touching and max(one.age, target.age) <= _RECENT
            if not touching and one.age == target.age == 0.0:
                self._together[one.id] += 1
        around = [one for one in others if self._together[one.id] >= _TOGETHER]
        # Who touches may have got a new track by their sudden move.
        if around and touched:
            self._touched = stamp
            if self.certainty is Certainty.CERTAIN:
                self.certainty, self._began = Certainty.CONTESTED, stamp
                self._rivals.clear()
            # A track that began later may be the followed person's, found again.
            for one in around:
                if one.born < self._began:
                    self._rivals.setdefault(one.id, one.looks.since())
        elif self.certainty is Certainty.CERTAIN and len(target.looks):
            self._looks = target.looks.since()

    def compare(self, tracks: Iterable[Track]) -> dict[Track, bool | None]:
        """Tell by their looks since the touch which of the tracks in sight is the followed person.

        None where that is unsure. Each is compared with how those who touched looked before, and
        with the others in sight.
        """
        fresh = {one: looks for one in tracks if len(looks := one.looks.since(self._touched))}
        unlike = {track: unlikeness(self._looks, looks) for track, looks in fresh.items()}
        found: dict[Track, bool | None] = {}
        for track, looks in fresh.items():
            beside = [off for one, off in unlike.items() if one is not track and off is not None]
            lead = self._lead(looks, unlike[track], beside) if len(looks) >= _LOOKS else None
            found[track] = None if lead is None or abs(lead) < _MARGIN else lead > 0.0
        return found

    def may_be_mine(self, track: int | None, looks: Sequence[bytes]) -> bool:
        """Whether a box may show the followed person while theirs is not seen.

        Args:
            track: Id of the box's track; None without one.
            looks: Appearances of the track, or else the box's own.
        """
        if self.certainty is Certainty.CERTAIN:
            # Where nobody came close, the place tells more than looks, as of who has fallen.
            return self._together[track or 0] < _TOGETHER
        lead = self._lead(looks, unlikeness(self._looks, looks))
        if lead is None:
            return not self._looks
        return lead > 0.0

    def settle(self, target: Track) -> None:
        """Believe that `target` is the followed person."""
        self.certainty = Certainty.CERTAIN
        self._looks = target.looks.since(self._touched) or self._looks
        # This track was the other one's, if they changed over while they touched.
        del self._together[target.id]

    def doubt(self, stamp: int) -> bool:
        """Give up the comparison if it has not told in time; returns whether it did just now.

        Where the detector's results have no appearances, the track is believed all the same.
        """
        late = seconds(stamp - self._touched) > _PATIENCE
        if self.certainty is not Certainty.CONTESTED or not late:
            return False
        self.certainty = Certainty.UNCERTAIN if self._looks else Certainty.CERTAIN
        return True

    def _lead(
        self, looks: Sequence[bytes], mine: float | None, beside: Sequence[float] = ()
    ) -> float | None:
        """How much more these looks are like the followed person's than like anybody else's.

        `mine` is how unlike the followed person they are, `beside` the same of others in sight.
        None if looks cannot be compared, or somebody looks like the followed person.
        """
        if mine is None:
            return None
        known = [one for one in self._rivals.values() if len(one) >= _LOOKS]
        if len(known) < len(self._rivals) and not beside:
            return None
        least = _OTHER if known or beside else _STRANGER
        for rival in known:
            theirs, apart = unlikeness(rival, looks), unlikeness(self._looks, rival)
            if theirs is None or apart is None or apart < _ALIKE:
                return None
            least = min(least, theirs)
        return min([least, *beside]) - mine
