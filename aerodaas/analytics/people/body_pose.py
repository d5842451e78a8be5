"""BodyPoseEmergencyAnalytics: a raised hand lands the drone, a fall raises an alert."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar, TypeAlias

import numpy as np
from numpy.typing import NDArray
from typing_extensions import Self

from aerodaas.analytics.base import Analytics, Context, ResourceUse
from aerodaas.analytics.detection.tracking import Tracker
from aerodaas.analytics.people.debounce import Debounce
from aerodaas.analytics.people.falls import FallDetector
from aerodaas.analytics.people.gestures import GESTURE_MODEL, GestureClassifier
from aerodaas.analytics.people.joints import ARMS, FACE, HIPS, POINTS, SHOULDERS, visible
from aerodaas.analytics.people.lying import lies
from aerodaas.clock import seconds
from aerodaas.config.checked import Count, Fraction, NotNegative
from aerodaas.config.model import RuntimeEnvConfig
from aerodaas.dataflow.graph import AeroStreamData, Trigger
from aerodaas.dataflow.interfaces import ICompute, IEnvironment
from aerodaas.errors import ConfigError, GraphError
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.frames import Frame
from aerodaas.messages.readings import Alert

__all__ = ["BodyPoseEmergencyAnalytics", "fallen", "hand_raised", "raised_arm"]

_LONGEST = 0.85
"""Greatest length of an upper arm or forearm as a fraction of the trunk, shoulders to hips: they
measure 0.6 and 0.55 of it (Winter, Biomechanics and Motor Control of Human Movement, 2009, by body
height)."""

_SHORTEST = 0.7
"""Least length of a whole arm as a fraction of the trunk: an apparently shorter one points at the
lens, or is a false detection, such as a tree's crown beside the head."""
_FACE_UP, _ELBOW_UP = 0.4, 0.4
"""Height above the shoulders, as a fraction of the trunk, of the face if it is not seen, and of the
elbow of a raised arm whose wrist is not seen."""

Array = NDArray[np.float64]


def raised_arm(keypoints: NDArray[np.floating], min_confidence: float) -> bool:
    """Whether a wrist is above the face, on an arm of human length.

    If the wrist is not seen, the elbow decides. Without hips, the length of the arm is not checked.

    Args:
        keypoints: Keypoints of a body, (17, 3): u and v in pixels, and confidence.
        min_confidence: Confidence below which keypoints count as not seen, 0 to 1.
    """
    points = keypoints[:, :2].astype(np.float64)
    seen = visible(keypoints, min_confidence)
    if not seen[SHOULDERS].any():
        return False
    shoulders = points[SHOULDERS][seen[SHOULDERS]].mean(axis=0)
    trunk = math.inf
    if seen[HIPS].any():
        trunk = float(np.hypot(*(points[HIPS][seen[HIPS]].mean(axis=0) - shoulders)))
    face = points[FACE][seen[FACE], 1]
    top = float(face.mean()) if len(face) else shoulders[1] - _FACE_UP * trunk
    return any(_is_up(points[list(arm)], seen[list(arm)], trunk, top) for arm in ARMS)


def _is_up(arm: Array, seen: NDArray[np.bool_], trunk: float, top: float) -> bool:
    lengths = np.linalg.norm(np.diff(arm, axis=0), axis=1)
    if not seen[:2].all() or lengths[0] > _LONGEST * trunk:
        return False
    if not seen[2]:
        return bool(arm[0, 1] - arm[1, 1] >= _ELBOW_UP * trunk)
    if math.isfinite(trunk) and lengths.sum() < _SHORTEST * trunk:
        return False
    return bool(lengths[1] <= _LONGEST * trunk and arm[2, 1] < top)


_TEXTS = {
    "fallen": "The person has fallen.",
    "hand_raised": "The person raises a hand.",
}
_SURER = 2
"""Additional frames, in twice the time, that confirm a raised hand: a missed fall is worse than a
false alert, but an unintended landing is worse than one that comes half a second later."""
_VEST_AGE = 1.0
"""Seconds for which the boxes of vests identify the wearer."""
_SAME_BODY = 0.6
"""Share of the smaller of two boxes inside the other, above which both are of one body."""
_ASIDE, _ASIDE_TIME = 0.25, 2.0
"""Heights by which, and seconds for which, another person must be nearer to the middle to be taken
for the monitored one from then on."""
_MOST_PEOPLE = 100
"""Greatest number of people; a pose model's own limit is far above the number distinguishable."""


def hand_raised(result: object) -> bool:
    """Whether a raised hand is confirmed; a condition for `trigger`."""
    return isinstance(result, Detections) and bool(result.labelled("hand_raised"))


def fallen(result: object) -> bool:
    """Whether a fall is confirmed; a condition for `trigger`."""
    return isinstance(result, Detections) and bool(result.labelled("fallen"))


class BodyPoseEmergencyAnalytics(Analytics[Detections]):
    """Monitors one person's gestures: a raised hand lands the drone, a fall raises an alert.

    Analyse a pose model's stream, or the camera's: then a `PoseAnalytics` runs as a separate
    analysis called `body_pose`, which an analytics scheduler may schedule. A gesture is confirmed
    once `needed` of the last `of` frames show it for `hold` seconds. The landing is a `trigger`
    on the robot that carries the camera; set others with the conditions `hand_raised` and
    `fallen` of this module::

        pose = BodyPoseEmergencyAnalytics(lands=False).deploy(edge)
        pose.analyse(camera)
        pose.trigger(drone.pause_mission, when=hand_raised)

    Only one person's gestures count. If a stream of boxes of vests is analysed, too, it is the
    person whose box contains the centre of a vest. Otherwise it is the person nearest to the
    middle of the image, where a follower keeps its target, until that person is out of sight for
    a second, or another one is clearly nearer to the middle for two, unless the person has fallen
    or raises a hand; the distance is measured in heights of the person, so that a passer-by far
    behind is not chosen.

    Results are the detected people. The monitored person has the label of the confirmed gesture,
    `hand_raised` or `fallen`, or else `upright`, `other` or `person`; all others have `person`.
    """

    Detector: TypeAlias = Analytics[Detections]
    accepts: ClassVar[tuple[type, ...]] = (Detections, Frame)
    produces: ClassVar[type] = Detections
    resources: ClassVar[Mapping[str, ResourceUse]] = {"gestures": "model"}

    def __init__(
        self,
        environment: IEnvironment | None = None,
        *,
        needed: Count = 4,
        of: Count = 6,
        hold: NotNegative = 0.5,
        lands: bool = True,
        vest_labels: Sequence[str] = ("vest", "hazard vest"),
        min_probability: Fraction = 0.6,
        min_confidence: Fraction = 0.35,
        gestures: str | Path = GESTURE_MODEL,
        detector: Detector | None = None,
    ) -> None:
        """Configure the confirmation of gestures.

        Args:
            environment: Ignored; accepted because the paper's listings pass it.
            needed: Frames of the last `of` that must show a fall; a raised hand, which lands the
                drone, needs two more.
            of: Frames that are considered.
            hold: Seconds for which a fall must be shown; twice as long for a raised hand.
            lands: Whether a raised hand lands the drone.
            vest_labels: Labels of the boxes of vests.
            min_probability: Least probability of a gesture, 0 to 1.
            min_confidence: Confidence below which keypoints count as missing, 0 to 1.
            gestures: ONNX file of the gesture classifier; by default the shipped one.
            detector: Pose model for camera streams; by default `PoseAnalytics()`.

        Raises:
            ConfigError: If a setting is out of range.
            ModelError: If the classifier cannot be read, or `min_confidence` is out of range.
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
        """Track id of the monitored person."""
        self._aside: int | None = None
        """Stamp since which another person is nearer to the middle, nanoseconds."""
        self._falls = FallDetector(min_confidence)
        self._events = {
            "fallen": Debounce(needed, of, hold),
            "hand_raised": Debounce(needed + _SURER, of + _SURER, 2 * hold),
        }
        self._vests: Detections | None = None
        self._streams = 0
        self._poses: str | None = None
        """Stream of the pose model that was started for this analysis."""
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
        """Run on `compute`, together with its own pose model; otherwise as `Analytics.deploy`.

        Args:
            compute: Edge or cloud node, or endpoint; or `env.here`.
            runtime_env: The analysis' own runtime environment; None for the node's.
        """
        super().deploy(compute, runtime_env)
        if self._poses is not None and self.node is not None and self._graph is not None:
            self._graph.nodes[self._poses].compute = self.node.compute
        return self

    def _poses_in(self, camera: AeroStreamData[Frame]) -> AeroStreamData[Detections]:
        """Run a pose model on `camera`, as a separate analysis that can be scheduled."""
        # onnxruntime is slow to import.
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
        """Analyse one frame.

        Args:
            item: Bodies with keypoints, or boxes of vests, which only identify the wearer.
            context: Services of its node.

        Returns:
            The result, or None for boxes of vests.
        """
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
        down = self._falls.shows(chosen, people)
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
        """Add a person who fell out of the image, as last detected, once the fall is confirmed."""
        last = self._falls.last
        if last is None or not self._events["fallen"].active:
            return people
        return replace(people, items=(*people.items, replace(last, label="fallen")))

    def _people(self, found: Detections) -> Detections:
        """Return the people with usable keypoints, with their tracks."""
        usable = [one for one in found if _is_usable(one)]
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
            # A box of a different extent, such as without the legs, is of the same body.
            last = known.detection
            mine = max(people, key=lambda one: _shared(one, last), default=None)
            mine = mine if mine is not None and _shared(mine, last) > _SAME_BODY else None
            self.person = self.person if mine is None else mine.track_id
        middle = people.width / 2
        nearest = min(people, key=lambda one: _off_centre(one, middle), default=None)
        if (mine is not None or known is not None) and not self._is_aside(mine, nearest, people):
            return mine
        self._aside = None
        self.person = None if nearest is None else nearest.track_id
        return nearest

    def _is_aside(
        self, mine: Detection | None, nearest: Detection | None, people: Detections
    ) -> bool:
        """Whether `nearest` has for long been nearer to the middle than the monitored person."""
        if mine is None or nearest is None or any(one.active for one in self._events.values()):
            self._aside = None
            return False
        middle, stamp = people.width / 2, people.header.stamp
        if _off_centre(nearest, middle) + _ASIDE >= _off_centre(mine, middle):
            self._aside = None
            return False
        if self._aside is None or stamp < self._aside:
            self._aside = stamp
        return seconds(stamp - self._aside) >= _ASIDE_TIME

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
    """Keep for each body the box with the most keypoints; pose models also box parts of bodies."""
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
    """Horizontal distance from the middle of the image in heights of the person."""
    return abs(one.centre[0] - middle) / max(one.box[3] - one.box[1], 1.0)


def _wearer(people: Detections, vests: Detections, labels: Sequence[str]) -> Detection | None:
    """The person around the best vest; of several, the one with the smallest box."""
    scale_u, scale_v = people.width / vests.width, people.height / vests.height
    for vest in vests.labelled(*labels):
        u, v = vest.centre[0] * scale_u, vest.centre[1] * scale_v
        around = [
            one for one in people if one.box[0] <= u <= one.box[2] and one.box[1] <= v <= one.box[3]
        ]
        if around:
            return min(around, key=lambda one: one.area)
    return None
