"""FollowAnalytics: velocity commands that keep a drone at its target, from a detector's boxes."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np
from shapely import Point, Polygon

from aerodaas.analytics.base import Context, NavigableAnalytics
from aerodaas.analytics.boxes import BoxAnalytics
from aerodaas.analytics.detection.suppression import one_for_each
from aerodaas.analytics.detection.tracking import Tracker
from aerodaas.analytics.follow.identity import Certainty, TargetIdentity
from aerodaas.analytics.follow.observation import observation
from aerodaas.analytics.people.debounce import Debounce
from aerodaas.clock import seconds
from aerodaas.config.checked import Positive
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.errors import ConfigError
from aerodaas.following.follow_controller import LYING, FollowController, FollowPhase
from aerodaas.following.follow_settings import FollowGains, FollowLimits, LostPolicy, TargetChoice
from aerodaas.following.target import (
    RelativeTarget,
    TargetMotion,
    TargetSize,
    ends_in_picture,
    place_of,
    sight,
)
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.readings import Alert
from aerodaas.messages.waypoints import (
    DEFAULT_PRIORITY,
    FollowedTarget,
    NavigationType,
    TargetState,
)

__all__ = ["FollowAnalytics"]

_log = logging.getLogger(__name__)
_REACH, _REACH_SHARE = 0.3, 0.2
"""Allowed offset of a box from the target's expected position: metres, plus a fraction of the
distance. The possible motion of the target since its last detection is added."""
_SURER = 0.2
"""Margin by which another track's score must exceed that of a doubtful target."""
_ALOFT = (1.0, 0.6)
"""Height in metres, or fraction of the following height, above which all near people are seen:
from the ground, the chest of a person 3 m away is above the image, but that of a more distant
passer-by is not."""
_BLINK = 0.5
"""Seconds for which a detector may miss a target before another one is chosen."""
_BLOCKED = (3, 10)
"""Frames with an obstacle, of the last 10, that raise an alert."""
_NOBODY = 0
"""No track has this id."""
_PERSON, _PERSON_SIZE = "person", TargetSize(1.7, 0.55, widest=0.9)
"""Label and size of a bystander."""
_WORN = 0.8
"""Share of a box, such as a vest's or a body's, within another person's box from which on both show
the same body. Somebody else in front would hide the vest, so that it would not be detected."""
_OVERLAPS = 0.4
"""The same share from which on both may show the same body: a detector that sees half a body puts
loose boxes around it. Somebody else who comes in front is seen before that."""
_AS_FAR = 0.6
"""Least height of such a box in parts of the height that it has at the distance of the other; a
smaller one is behind, not worn."""
_SAME_BODY = 0.8
"""Distance in metres between the target's expected position and that of a person's box, at most,
for the two to be the same body."""
_WIDTH_MEMORY = 0.1
"""Weight of the newest measurement in the mean of the target's width, as arms swing."""


class FollowAnalytics(BoxAnalytics[AeroNavigation], NavigableAnalytics):
    """Follows one object of known size at a distance, and stays with that object.

    It locks on to the trusted target with the largest product of box area and score and holds it
    by its track. Before the first target, and after one was given up, it sends no commands, so
    that other navigation goes on. The camera must be calibrated (`horizontal_fov` of the sensor).
    """

    falls: ClassVar[bool] = True
    """Whether the target is a person, who may fall, so that a change of its height is no motion
    along the ground, and may turn round and come at the drone."""
    also: ClassVar[tuple[str, ...]] = (_PERSON,)

    def __init__(
        self,
        labels: Sequence[str] = ("person",),
        distance: Positive = 2.0,
        height: Positive = 1.5,
        *,
        target_height: Positive = 1.7,
        target_width: Positive = 0.55,
        priority: int = DEFAULT_PRIORITY,
        gains: FollowGains | None = None,
        limits: FollowLimits | None = None,
        lost: LostPolicy | None = None,
        motion: TargetMotion | None = None,
        area: Sequence[tuple[float, float]] | None = None,
        choice: TargetChoice | None = None,
        detector: BoxAnalytics.Detector | None = None,
    ) -> None:
        """Follow an object with one of `labels`.

        Args:
            labels: Labels of the boxes to follow.
            distance: Distance to keep along the ground, metres.
            height: Flight height, metres.
            target_height: Height of the object, metres.
            target_width: Width of the object, metres.
            priority: Priority of the velocity commands.
            gains: Controller gains; by default `FollowGains()`.
            limits: Limits of the commands; by default `FollowLimits()`.
            lost: Reaction to a lost target; by default `LostPolicy()`.
            motion: Motion model of the target; by default that of a person.
            area: Corners (metres east, north of home) of the polygon outside which a target is
                given up at once; by default unbounded.
            choice: Conditions for choosing a target; by default `TargetChoice()`.
            detector: Detector for camera streams; by default the shipped one.

        Raises:
            ConfigError: If a length is not positive and finite, or `area` is not a polygon.
        """
        lengths = {
            "distance": distance,
            "height": height,
            "target_height": target_height,
            "target_width": target_width,
        }
        for name, length in lengths.items():
            if not 0.0 < length < math.inf:
                message = f"{type(self).__name__}: {name} must be above 0 m, not {length}"
                raise ConfigError(message)
        super().__init__(labels, detector)
        self.area = None if area is None else _polygon(area)
        self.size = TargetSize(target_height, target_width)
        self.choice = choice or TargetChoice()
        self.controller = FollowController(
            distance,
            height,
            gains=gains,
            limits=limits,
            lost=lost,
            motion=motion,
            priority=priority,
        )
        self.tracker = Tracker(
            max_age=self.controller.lost.slow, min_hits=self.choice.looks, sure=self.choice.sure
        )
        self.target: int | None = None
        """Id of the followed track; `_NOBODY` while none is known to be the followed person's."""
        self._given_up = False
        """Whether a target was given up, so that the next one may be another."""
        self._identity = TargetIdentity()
        self._blocked = Debounce(*_BLOCKED)
        self._alarm = Debounce(1, 1)
        self._aloft = 0
        """Number of frames since the drone was high enough to choose a target."""
        self._up = 0
        """Mission time when it was, nanoseconds."""
        self._width = target_width

    def examine(self, boxes: Detections, context: Context) -> AeroNavigation | None:
        """Return one velocity command, or None without a target."""
        item = boxes
        if item.camera is None:
            self.explain_once(item, context)
            return None
        if self._has_left():
            self._let_go(item, context)
        self._aloft = self._aloft + 1 if self._is_aloft(item) else 0
        if self._aloft <= 1:
            self._up = item.header.stamp
        phase = self.controller.phase
        tracked = self.tracker.update(self._possible(item))
        detection = self._identified(self._target_in(tracked), tracked, context)
        sighting = None if detection is None else self._sight(detection, item)
        others = self._others(tracked, detection)
        bystanders = self._bystanders(item, sighting)
        people = bystanders
        if self.falls:
            people += others if sighting is None else (sighting, *others)
        others += tuple(one for one in bystanders if not one.doubtful)
        command = self.controller.step(
            observation(item, sighting, context, others=others, people=people)
        )
        self._tell_changes(phase, item, context)
        self._tell_what_blocks(item, context)
        self._tell_who_comes(item, context)
        if command is None:
            return None
        command = replace(command, target=self._followed(detection))
        return AeroNavigation(NavigationType.ANALYTICS_DRIVEN, [command])

    def _followed(self, detection: Detection | None) -> FollowedTarget:
        """Target of this frame's command, whose box is `detection`."""
        if self._identity.certainty is Certainty.UNCERTAIN:
            return FollowedTarget(TargetState.UNCERTAIN)
        if detection is None:
            return FollowedTarget(TargetState.UNSEEN)
        sure = self._identity.certainty is Certainty.CERTAIN
        state = TargetState.SURE if sure else TargetState.LIKELY
        left, top, right, bottom = map(float, detection.box)
        return FollowedTarget(state, (left, top, right, bottom), detection.track_id)

    def _possible(self, item: Detections) -> Detections:
        """Remove boxes that cannot be the target, so that no track is matched to them."""
        boxes = [box for box in item if all(map(math.isfinite, box.box))]
        if self.choice.grounded:
            boxes = [box for box in boxes if ends_in_picture(box, item)]
            seen = [(box, sight(box, item, self.size)) for box in boxes]
            boxes = [box for box, found in seen if found is None or not found.afloat]
        if self.choice.shared < 1.0:
            boxes = one_for_each(boxes, self.choice.shared)
        return replace(item, items=tuple(boxes))

    def _target_in(self, tracked: Detections) -> Detection | None:
        """Find the target among the boxes of this frame, or choose a new one."""
        found = tracked.labelled(*self.labels)
        trusted = [item for item in found if item.track_id is not None]
        mine = next((item for item in trusted if item.track_id == self.target), None)
        if mine is None:
            mine = self._found_where_expected(found, tracked)
        if self.target is None and self._aloft < self.choice.looks:
            return None
        lost = mine is None and self._is_lost()
        if lost:
            trusted = [item for item in trusted if self._may_be_mine(item)]
        stamp = tracked.header.stamp
        least = self.choice.score if lost or self.target is None else self._score_to_displace(mine)
        chosen = [
            item
            for item in trusted
            if self._is_sure(item, least, stamp)
            and self._is_inside(item, tracked)
            and (lost or self._shows_enough(item, tracked))
        ]
        if not chosen:
            return mine
        best = max(chosen, key=lambda item: item.area * item.score)
        if self.target is None and self._is_surpassed(best):
            return None
        if mine is not None:
            self.controller.change_target()
        if not lost:
            self._identity.reset()
        self.target = best.track_id
        self._width = self.size.width
        return best

    def _is_surpassed(self, best: Detection) -> bool:
        """Whether this frame only missed a better target than `best`."""
        return any(
            0.0 < track.age <= _BLINK
            and track.detection.label in self.labels
            and track.detection.area * track.score > best.area * best.score
            for track in self.tracker.tracks
        )

    def _may_be_mine(self, item: Detection) -> bool:
        """Whether a box may show the followed person, by its looks."""
        track = self.tracker.find(item.track_id)
        looks = () if track is None else track.looks.since()
        if not looks and item.appearance is not None:
            looks = (item.appearance,)
        return self._identity.may_be_mine(item.track_id, looks)

    def _identified(
        self, mine: Detection | None, tracked: Detections, context: Context
    ) -> Detection | None:
        """Return the box that shows the followed person, or None if it is not known which does."""
        if self.target is None:
            return mine
        identity, stamp = self._identity, tracked.header.stamp
        held = self.tracker.find(self.target)
        # Nobody without a vest is taken for somebody in one; their own body's box touches a vest.
        tracks = [one for one in self.tracker.tracks if one.detection.label in self.labels]
        identity.watch(held, [one for one in tracks if one is not held], stamp)
        if identity.certainty is Certainty.CERTAIN:
            return mine
        shown = {item.track_id: item for item in tracked.labelled(*self.labels)}
        verdicts = identity.compare(one for one in tracks if one.id in shown and one.age == 0.0)
        found = next((track for track, verdict in verdicts.items() if verdict), None)
        if found is not None:
            if found is not held:
                self.controller.change_target()
                self.target = found.id
            identity.settle(found)
            return shown[found.id]
        if identity.doubt(stamp):
            holds = identity.certainty is Certainty.UNCERTAIN
            then = "the drone holds" if holds else "the drone follows the likelier one"
            what = " or ".join(self.labels)
            text = f"Another {what} came close. Which is which is unknown; {then}."
            context.alert(Alert(tracked.header, "target_uncertain", text))
        if identity.certainty is Certainty.UNCERTAIN or (
            held is not None and verdicts.get(held) is False
        ):
            self.target = _NOBODY
        return None if self.target == _NOBODY else mine

    def _is_aloft(self, item: Detections) -> bool:
        """Whether the drone is high enough to see all near people for a first choice."""
        least, part = _ALOFT
        height = math.inf if item.odometry is None else item.odometry.height
        return not height < min(least, part * self.controller.height)

    def _score_to_displace(self, mine: Detection | None) -> float:
        """Least score that displaces the target, detected as `mine`; infinite if none may.

        A target whose score has become doubtful, such as a passer-by in a bright shirt, gives way
        to a much surer one.
        """
        held = self.tracker.find(self.target)
        if mine is None or held is None or held.score >= self.choice.score:
            return math.inf
        return max(self.choice.score, held.score + _SURER)

    def _is_sure(self, item: Detection, least: float, stamp: int) -> bool:
        """Whether a box' track scores `least` at the frame's stamp, or as a first target may."""
        track = self.tracker.find(item.track_id)
        if track is None:
            return False
        first = self.target is None and not self._given_up
        if first and seconds(stamp - max(track.born, self._up)) >= self.choice.patience:
            least = min(least, self.choice.sure)
        return track.score >= least

    def _has_left(self) -> bool:
        place = self.controller.motion.place
        return self.area is not None and place is not None and not self.area.covers(Point(place))

    def _let_go(self, item: Detections, context: Context) -> None:
        self.target = None
        self._identity.reset()
        self.controller.give_up()
        text = f"The {' or '.join(self.labels)} has left the area; following ends."
        context.alert(Alert(item.header, "target_left_area", text))

    def _shows_enough(self, detection: Detection, item: Detections) -> bool:
        """Whether the object's width is measurable, if that is required of a first detection."""
        if not self.choice.whole:
            return True
        sighting = sight(detection, item, self.size)
        return sighting is not None and sighting.width is not None

    def _is_inside(self, detection: Detection, item: Detections) -> bool:
        """Whether the object is inside the area, if there is one."""
        if self.area is None:
            return True
        sighting, odometry = sight(detection, item, self.size), item.odometry
        if sighting is None or odometry is None:
            return False
        place = place_of(sighting, odometry)
        return bool(np.isfinite(place).all() and self.area.covers(Point(*place)))

    def _found_where_expected(
        self, found: Sequence[Detection], item: Detections
    ) -> Detection | None:
        """Find a box at the target's expected ground position, after the loss of its track.

        A pitching drone moves the image by more than a tracker of boxes can predict.
        """
        odometry, controller = item.odometry, self.controller
        expected = None if odometry is None else controller.expected(odometry, item.header.stamp)
        if self.target is None or expected is None:
            return None
        reach = _REACH + _REACH_SHARE * expected.distance
        reach += controller.motion.spread(item.header.stamp)
        best = None
        for detection in found:
            sighting = sight(detection, item, self.size.with_width(self._width))
            if sighting is None:
                continue
            if not self._may_be_mine(detection):
                continue
            off = float(np.linalg.norm(sighting.offset - expected.offset))
            if sighting.bound or expected.bound:
                off = max(0.0, off - LYING)
            if off <= reach:
                best, reach = detection, off
        if best is not None and best.track_id is not None:
            self.target = best.track_id
        return best

    def _is_lost(self) -> bool:
        """Whether the target is lost, so that another may replace it without a complete view."""
        free = (FollowPhase.WAITING, FollowPhase.SEARCHING)
        return self.target is not None and self.controller.phase in free

    def _sight(self, detection: Detection, item: Detections) -> RelativeTarget | None:
        sighting = sight(detection, item, self.size.with_width(self._width))
        if sighting is not None and sighting.width is not None:
            self._width += _WIDTH_MEMORY * (sighting.width - self._width)
        if sighting is not None and not self.falls:
            sighting = replace(sighting, top=None)
        return sighting

    def _others(self, tracked: Detections, target: Detection | None) -> tuple[RelativeTarget, ...]:
        least = self.choice.score
        found = (box for box in tracked.labelled(*self.labels) if box is not target)
        boxes = (box for box in found if box.score >= least)
        seen = (sight(box, tracked, self.size) for box in boxes)
        return tuple(sighting for sighting in seen if sighting is not None)

    def _bystanders(
        self, item: Detections, target: RelativeTarget | None
    ) -> tuple[RelativeTarget, ...]:
        """Locate everybody detected who is not known by the followed labels already.

        A person's box around a box with such a label shows the same body, and so does one where
        the target is expected while that is not detected. One that overlaps it is doubtful.
        """
        if _PERSON in self.labels:
            return ()
        parts = [(one, self.size.height) for one in item.labelled(*self.labels)]
        people = sorted(item.labelled(_PERSON), key=lambda one: -one.score)
        # A detector may find a body several times, with loose boxes around it.
        parts += [
            (one, _PERSON_SIZE.height)
            for one in people
            if any(_worn(part, height, one) >= _WORN for part, height in parts)
        ]
        odometry, expected = item.odometry, target
        if expected is None and odometry is not None:
            expected = self.controller.expected(odometry, item.header.stamp)
        found = []
        for box in people:
            share = max((_worn(part, height, box) for part, height in parts), default=0.0)
            if share >= _WORN:
                continue
            seen = sight(box, item, _PERSON_SIZE)
            if seen is None or (self.falls and _is_near(seen, expected)):
                continue
            found.append(replace(seen, doubtful=share >= _OVERLAPS))
        return tuple(found)

    def _tell_what_blocks(self, item: Detections, context: Context) -> None:
        self._blocked.update(item.header.stamp, self.controller.blocked)
        if self._blocked.began:
            what = " or ".join(self.labels)
            text = f"Something stands in the way to the {what}; while it follows, the drone waits."
            context.alert(Alert(item.header, "way_blocked", text))

    def _tell_who_comes(self, item: Detections, context: Context) -> None:
        self._alarm.update(item.header.stamp, self.controller.guard.alarming)
        if self._alarm.began:
            text = "Somebody comes at the drone; while it follows, it gives way."
            context.alert(Alert(item.header, "person_close", text))

    def _tell_changes(self, before: FollowPhase, item: Detections, context: Context) -> None:
        phase = self.controller.phase
        if phase is before:
            return
        _log.info("following: %s, was %s", phase.value, before.value)
        what = " or ".join(self.labels)
        if before is FollowPhase.WAITING and self._given_up:
            text = f"A {what} is followed again; it may be another one."
            context.alert(Alert(item.header, "target_chosen", text))
        if phase is FollowPhase.SEARCHING:
            context.alert(Alert(item.header, "target_lost", f"The {what} is out of sight."))
        elif phase is FollowPhase.WAITING:
            self.target = None
            self._given_up = True
            self._identity.reset()
            text = f"The {what} was not found again; following ends."
            context.alert(Alert(item.header, "target_given_up", text))


def _worn(part: Detection, height: float, body: Detection) -> float:
    """Share within a body of the box of a part that is `height` metres high, such as a vest.

    0 for a part too small to be this body's.
    """
    low = np.maximum(part.box[:2], body.box[:2])
    high = np.minimum(part.box[2:], body.box[2:])
    common = float(np.clip(high - low, 0.0, None).prod())
    tall, taller = (one.box[3] - one.box[1] for one in (part, body))
    as_far = tall >= _AS_FAR * taller * height / _PERSON_SIZE.height
    return common / part.area if as_far and common > 0.0 else 0.0


def _is_near(seen: RelativeTarget, expected: RelativeTarget | None) -> bool:
    """Whether a person's box may show the target, who if fallen lies within a body's length."""
    if expected is None:
        return False
    reach = _SAME_BODY + (LYING if expected.bound else 0.0)
    return bool(np.linalg.norm(seen.offset - expected.offset) <= reach)


def _polygon(area: Sequence[tuple[float, float]]) -> Polygon:
    corners = 3
    if len(area) < corners or not np.isfinite(np.asarray(area, np.float64)).all():
        raise ConfigError("an area is three or more corners (metres east, metres north)")
    return Polygon(area)
