"""BodyPoseEmergencyAnalytics: a raised hand lands the drone, a fall alerts people."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar, TypeAlias

import numpy as np
from typing_extensions import Self

from aerodaas.analytics.base import Analytics, Context
from aerodaas.analytics.detection.tracking import Tracker
from aerodaas.analytics.people.arms import raised_arm
from aerodaas.analytics.people.debounce import Debounce
from aerodaas.analytics.people.downfall import Downfall
from aerodaas.analytics.people.gestures import GESTURE_MODEL, GestureClassifier
from aerodaas.analytics.people.joints import POINTS
from aerodaas.analytics.people.lying import lies
from aerodaas.config.model import RuntimeEnvConfig
from aerodaas.dataflow.graph import AeroStreamData, Trigger
from aerodaas.dataflow.interfaces import ICompute, IEnvironment
from aerodaas.types.clock import seconds
from aerodaas.types.data import Alert, Detection, Detections, Frame
from aerodaas.types.errors import ConfigError, GraphError

__all__ = ["BodyPoseEmergencyAnalytics", "fallen", "hand_raised"]

_TEXTS = {
    "fallen": "The person has fallen.",
    "hand_raised": "The person raises a hand.",
}
_SURER = 2
"""More frames, in twice the time, that a raised hand takes: a missed fall is worse than a false
alert, but a landing nobody asked for is worse than one that comes half a second later."""
_VEST_AGE = 1.0
"""Seconds for which the boxes of vests tell who wears one."""
_SAME_BODY = 0.6
"""Two boxes of which the smaller lies in the other by more than this share are of one body."""
_MOST_PEOPLE = 100
"""A pose model's own limit is far above what can be told apart in a picture."""


def hand_raised(result: object) -> bool:
    """Tell whether a raised hand is confirmed, as a condition for `trigger`."""
    return isinstance(result, Detections) and bool(result.labelled("hand_raised"))


def fallen(result: object) -> bool:
    """Tell whether a fall is confirmed, as a condition for `trigger`."""
    return isinstance(result, Detections) and bool(result.labelled("fallen"))


class BodyPoseEmergencyAnalytics(Analytics[Detections]):
    """Watches one person's body: a raised hand lands the drone, a fall alerts people.

    Analyse a pose model's stream, or the camera's: then a `PoseAnalytics` runs as an analysis of
    its own, called `body_pose`, which an analytics scheduler may schedule. A gesture counts once
    `needed` of the last `of` frames show it for `hold` seconds. The landing is a `trigger` of the
    robot whose camera it is; set others with the conditions `hand_raised` and
    `fallen` of this module::

        pose = BodyPoseEmergencyAnalytics(lands=False).deploy(edge)
        pose.analyse(camera)
        pose.trigger(drone.pause_mission, when=hand_raised)

    One person's gestures count, and nobody else's. If a stream of boxes of vests is analysed,
    too, it is the one whose box holds the middle of a vest. Otherwise it is the one nearest to
    the middle of the picture, where a follower keeps its target; distance is counted in heights
    of the person, so that a passer-by far behind does not win; and it stays that one until it is
    out of sight for a second.

    Results are the people found. The one who counts has the track and the label of the confirmed
    gesture, `hand_raised` or `fallen`, or else `upright`, `other` or `person`; all others stay
    `person`.
    """

    Detector: TypeAlias = Analytics[Detections]
    accepts: ClassVar[tuple[type, ...]] = (Detections, Frame)
    produces: ClassVar[type] = Detections

    def __init__(
        self,
        environment: IEnvironment | None = None,
        *,
        needed: int = 4,
        of: int = 6,
        hold: float = 0.5,
        lands: bool = True,
        vest_labels: Sequence[str] = ("vest", "hazard vest"),
        min_probability: float = 0.6,
        min_confidence: float = 0.35,
        gestures: str | Path = GESTURE_MODEL,
        detector: Detector | None = None,
    ) -> None:
        """Confirm a fall that `needed` of the last `of` frames show for `hold` seconds.

        A raised hand takes two frames more, for twice as long: it lands the drone.
        `lands=False` leaves the drone in the air. A gesture of less than `min_probability` is
        none; keypoints of less than `min_confidence` count as missing (both 0 to 1). `gestures`
        is a classifier of your own, `detector` a pose model for camera streams. The paper's
        listings may pass the environment; the analysed stream knows its own. Raises ConfigError
        and ModelError for settings that cannot work.
        """
        del environment
        if not 0.0 <= min_probability <= 1.0:
            raise ConfigError(f"min_probability must lie between 0 and 1, not {min_probability}")
        self.lands = lands
        self.vest_labels = tuple(vest_labels)
        self.min_probability = min_probability
        self.detector = detector
        self.classifier = GestureClassifier(gestures, min_confidence=min_confidence)
        self.tracker = Tracker(max_age=1.0, min_hits=1)
        self.person: int | None = None
        """Track of the person who counts."""
        self.unusable = 0
        """Bodies so far whose keypoints could not be used."""
        self._downfall = Downfall(min_confidence)
        self._events = {
            "fallen": Debounce(needed, of, hold),
            "hand_raised": Debounce(needed + _SURER, of + _SURER, 2 * hold),
        }
        self._vests: Detections | None = None
        self._streams = 0
        self._poses: str | None = None
        """Stream of the pose model that runs for this analysis alone."""
        self._told = False

    def _prepare_for(self, item: type) -> None:
        if issubclass(item, Frame):
            name = type(self).__name__
            raise GraphError(f"{name} watches a stream of frames, or the poses found in a frame")

    def _analyse_stream(self, data: AeroStreamData[Any]) -> AeroStreamData[Detections]:
        """Watch a stream of frames or of bodies; called again, one of vests, too.

        Raises GraphError for boxes of a model without keypoints alone.
        """
        if issubclass(data.item, Frame):
            data = self._poses_in(data)
        if not self._streams:
            _require_keypoints(data.graph.nodes[data.name].work, type(self).__name__)
        stream = super()._analyse_stream(data)
        self._streams += 1
        if self.lands and self.node is not None and self.node.robot is not None:
            landing = Trigger(self.node.robot, "end_mission", hand_raised)
            if landing not in self.node.triggers:
                self.node.triggers.append(landing)
        return stream

    def deploy(
        self, compute: ICompute, runtime_env: RuntimeEnvConfig | Mapping[str, Any] | None = None
    ) -> Self:
        """Run on `compute`, the pose model that it runs itself included; returns itself."""
        super().deploy(compute, runtime_env)
        if self._poses is not None and self.node is not None and self._graph is not None:
            self._graph.nodes[self._poses].compute = self.node.compute
        return self

    def _poses_in(self, camera: AeroStreamData[Frame]) -> AeroStreamData[Detections]:
        """Run a pose model on `camera`: an analysis of its own, so that it can be scheduled."""
        # onnxruntime takes its time to load.
        from aerodaas.analytics.people.pose import PoseAnalytics  # noqa: PLC0415

        detector = self.detector or PoseAnalytics()
        detector.name = detector.name or "body_pose"
        stream = detector.beside(self).analyse(camera)
        self._poses, self.detector = stream.name, None
        return stream

    def open(self) -> None:
        """Load the classifier."""
        self.classifier.open()

    def close(self) -> None:
        """Release the classifier."""
        self.classifier.close()

    def process(self, item: Detections, context: Context) -> Detections | None:
        """Watch one frame; None for boxes of vests, which only say who counts."""
        if item.labelled(*self.vest_labels):
            self._vests = item
        bodies = any(one.keypoints is not None for one in item)
        if bodies or (not item.items and self._streams <= 1):
            return self._watch(item, context)
        if self._streams <= 1:
            self._explain(item, context)
        return None

    def _watch(self, found: Detections, context: Context) -> Detections:
        stamp = found.header.stamp
        people = self._people(found)
        chosen = self._choose(people)
        gesture = self._gesture(chosen, found)
        upright = gesture is not None and gesture[0] == "upright"
        down = self._downfall.shows(chosen, people, upright=upright)
        if down:
            gesture = "fallen", self.min_probability
        for name, event in self._events.items():
            event.update(stamp, gesture is not None and gesture[0] == name)
            if event.began:
                context.alert(Alert(found.header, name, _TEXTS[name]))
        if chosen is None:
            return self._with_missing(people) if down else people
        label, score = gesture or ("person", chosen.score)
        active = [name for name, event in self._events.items() if event.active]
        if active and label not in active:
            label = active[0]
        elif label in _TEXTS and not active:
            label = "person"
        mine = replace(chosen, label=label, score=score)
        return replace(people, items=tuple(mine if one is chosen else one for one in people))

    def _with_missing(self, people: Detections) -> Detections:
        """Add one who fell out of the picture, where last seen, once that is confirmed."""
        last = self._downfall.last
        if last is None or not self._events["fallen"].active:
            return people
        return replace(people, items=(*people.items, replace(last, label="fallen")))

    def _people(self, found: Detections) -> Detections:
        """Return those whose body can be looked at, with their tracks."""
        usable = [one for one in found if _is_usable(one)]
        self.unusable += len(found) - len(usable)
        middle = found.width / 2
        usable.sort(key=lambda one: _off_centre(one, middle))
        items = (replace(one, label="person") for one in _once(usable[:_MOST_PEOPLE]))
        return self.tracker.update(replace(found, items=tuple(items)))

    def _choose(self, people: Detections) -> Detection | None:
        vests = self._vests
        if vests is not None:
            if abs(seconds(people.header.stamp - vests.header.stamp)) > _VEST_AGE:
                return None
            return _wearer(people, vests, self.vest_labels)
        mine = next((one for one in people if one.track_id == self.person), None)
        known = self.tracker.find(self.person)
        if mine is None and known is not None:
            # A body that is found in another extent, without its legs, is the same body.
            last = known.detection
            mine = max(people, key=lambda one: _shared(one, last), default=None)
            mine = mine if mine is not None and _shared(mine, last) > _SAME_BODY else None
            self.person = self.person if mine is None else mine.track_id
        if mine is not None or known is not None:
            return mine
        middle = people.width / 2
        nearest = min(people, key=lambda one: _off_centre(one, middle), default=None)
        self.person = None if nearest is None else nearest.track_id
        return nearest

    def _gesture(self, chosen: Detection | None, found: Detections) -> tuple[str, float] | None:
        if chosen is None or chosen.keypoints is None:
            return None
        least = self.classifier.min_confidence
        (told,) = self.classifier.classify([chosen.keypoints])
        if lies(chosen.keypoints, found, least):
            return "fallen", max(self.min_probability, told[1] if told is not None else 0.0)
        if told is None or told[1] < self.min_probability:
            return None
        if told[0] == "hand_raised" and not raised_arm(chosen.keypoints, least):
            return None
        return told

    def _explain(self, item: Detections, context: Context) -> None:
        if self._told:
            return
        self._told = True
        text = (
            f"{item.header.source}: the boxes hold no keypoints, so that no gesture is seen; "
            "analyse a pose model's stream, or the camera's"
        )
        context.alert(Alert(item.header, "no_keypoints", text))


def _require_keypoints(work: object, owner: str) -> None:
    decoder = getattr(work, "decoder", None)
    if decoder is not None and getattr(decoder, "keypoints", None) is None:
        path = getattr(work, "path", "the model")
        raise GraphError(
            f"{owner} needs bodies with keypoints, but {path} gives boxes only; "
            "use a pose model, or analyse the camera's stream"
        )


def _is_usable(one: Detection) -> bool:
    points = one.keypoints
    return (
        points is not None
        and points.shape == (POINTS, 3)
        and all(map(math.isfinite, one.box))
        and one.area > 0
    )


def _once(people: Sequence[Detection]) -> list[Detection]:
    """Each body once, by the box with the most of its points: pose models box parts of it, too."""
    best = sorted(people, key=lambda one: -_support(one))
    kept: list[Detection] = []
    for one in best:
        if all(_shared(one, other) <= _SAME_BODY for other in kept):
            kept.append(one)
    return kept


def _support(one: Detection) -> float:
    points = one.keypoints
    return 0.0 if points is None else float(np.nan_to_num(points[:, 2], posinf=0.0).sum())


def _shared(one: Detection, other: Detection) -> float:
    """Part of the smaller box that lies in the other."""
    width = min(one.box[2], other.box[2]) - max(one.box[0], other.box[0])
    height = min(one.box[3], other.box[3]) - max(one.box[1], other.box[1])
    return max(0.0, width) * max(0.0, height) / max(min(one.area, other.area), 1e-9)


def _off_centre(one: Detection, middle: float) -> float:
    """Distance from the middle of the picture in heights of the person."""
    return abs(one.centre[0] - middle) / max(one.box[3] - one.box[1], 1.0)


def _wearer(people: Detections, vests: Detections, labels: Sequence[str]) -> Detection | None:
    """The person around the best vest; of several, the one whose box fits it closest."""
    scale_u, scale_v = people.width / vests.width, people.height / vests.height
    for vest in vests.labelled(*labels):
        u, v = vest.centre[0] * scale_u, vest.centre[1] * scale_v
        around = [
            one for one in people if one.box[0] <= u <= one.box[2] and one.box[1] <= v <= one.box[3]
        ]
        if around:
            return min(around, key=lambda one: one.area)
    return None
