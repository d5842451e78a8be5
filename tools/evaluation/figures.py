"""Figures of a detector on annotated pictures, by COCO's own evaluation.

Average precision is pycocotools', with its ten overlaps, 101 recalls, sizes and at most 100 boxes
a picture. What a pilot asks beside it is counted at the score that flies: how much is found, how
often something is seen that is not there, and whether a score means what it says. The latter is
the expected calibration error (Guo et al. 2017, "On calibration of modern neural networks") over
ten bins of the score; a detection is right if it matches an annotation with an IoU of 0.5.
"""

from __future__ import annotations

import contextlib
import io
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from aerodaas.analytics.detection.detector import OnnxDetector
from aerodaas.config.extras import require_extra
from aerodaas.errors import ConfigError
from aerodaas.geometry.frames import Box
from aerodaas.messages.detections import Detection
from aerodaas.messages.frames import Frame, Header
from tools.evaluation.dataset import AnnotatedPicture, Dataset, read_picture, read_size

__all__ = ["LEAST_SCORE", "Bin", "ClassFigures", "Evaluation", "Mistake", "evaluate", "measure"]

LEAST_SCORE = 0.01
"""Least score of the boxes that count for average precision."""
_BINS = 10
_NAN = math.nan
_SIZES = ("all", "small", "medium", "large")
"""Of COCO: below 32 x 32 pixels of the picture, below 96 x 96, and the rest."""


@dataclass(frozen=True)
class ClassFigures:
    """Figures of one class, or of all; NaN where nothing was annotated."""

    label: str
    things: int
    """Annotated objects that count."""
    ap50: float = _NAN
    """Average precision at an IoU of 0.5."""
    ap: float = _NAN
    """Mean average precision at IoU 0.50 to 0.95."""
    ap_small: float = _NAN
    ap_medium: float = _NAN
    ap_large: float = _NAN
    recall: float = _NAN
    """Share of the things that are found at the evaluation's score."""
    precision: float = _NAN
    """Share of the boxes that are right at this score."""
    false_boxes: int = 0
    """Boxes at this score that match nothing."""
    false_per_picture: float = 0.0
    false_alarms: float = _NAN
    """Share of the pictures without the class in which there is a box of it."""
    calibration_error: float = _NAN
    """Expected calibration error, 0 to 1."""


@dataclass(frozen=True)
class Bin:
    """Detections whose scores lie between two values."""

    low: float
    high: float
    boxes: int
    score: float
    """Their mean score."""
    right: float
    """Share that matches an annotation."""


@dataclass(frozen=True)
class Mistake:
    """A box that matches nothing, or a thing that was not found."""

    picture: AnnotatedPicture
    label: str
    box: Box
    score: float | None
    """None for a thing that was not found."""


@dataclass(frozen=True)
class Evaluation:
    """What was measured."""

    pictures: int
    min_score: float
    """Score at which recall, precision and false boxes are counted."""
    classes: tuple[ClassFigures, ...]
    overall: ClassFigures
    """Means over the classes for average precision; sums and shares of all for the rest."""
    reliability: tuple[Bin, ...]
    left_out: tuple[str, ...]
    """Labels of the dataset that the model does not know."""
    mistakes: tuple[Mistake, ...] = field(repr=False, default=())


def evaluate(
    detector: OnnxDetector,
    dataset: Dataset,
    *,
    min_score: float = 0.3,
    progress: Callable[[], None] = lambda: None,
) -> Evaluation:
    """Run an opened `detector` on all pictures, and measure.

    What cannot be measured is refused before the first picture is run; only that a picture is
    damaged shows when it is decoded.

    Args:
        detector: With a `min_score` of at most `LEAST_SCORE`, or average precision is cut short.
        dataset: Of which the labels that the detector knows are evaluated.
        min_score: Score at which recall, precision and false boxes are counted.
        progress: Called after each picture.

    Raises:
        ConfigError: If no label is known to the model, a picture cannot be read, or pycocotools
            is not installed.
    """
    _known_labels(dataset, detector.names)
    for picture in dataset.pictures:
        read_size(picture.path)
    found = []
    for number, picture in enumerate(dataset.pictures):
        frame = Frame(Header(number, 0, "dataset"), read_picture(picture.path))
        found.append(detector.detect([frame])[0].items)
        progress()
    return measure(dataset, found, detector.names, min_score=min_score)


def measure(
    dataset: Dataset,
    found: Sequence[Sequence[Detection]],
    names: Sequence[str],
    *,
    min_score: float = 0.3,
) -> Evaluation:
    """Measure the detections of each picture, made by a model with classes of these `names`.

    Raises:
        ConfigError: If no label of the dataset is among `names`, or pycocotools is not installed.
    """
    labels = _known_labels(dataset, names)
    matching = _Matching(dataset, found, labels)
    outcomes = [matching.outcomes(number) for number in range(len(labels))]
    rows = tuple(matching.figures(number, one, min_score) for number, one in enumerate(outcomes))
    every = _Outcomes(
        np.concatenate([one.scores for one in outcomes]),
        np.concatenate([one.right for one in outcomes]),
    )
    return Evaluation(
        pictures=len(dataset.pictures),
        min_score=min_score,
        classes=rows,
        overall=_overall(rows, every, len(dataset.pictures), min_score),
        reliability=tuple(_reliability(every)),
        left_out=tuple(label for label in dataset.labels if label not in names),
        mistakes=tuple(matching.mistakes(min_score)),
    )


def _known_labels(dataset: Dataset, names: Sequence[str]) -> list[str]:
    """The labels to evaluate; raises ConfigError if there is none, or nothing to do it with."""
    require_extra("evaluation", "the evaluation of models")
    labels = [label for label in dataset.labels if label in names]
    if not labels:
        raise ConfigError(
            f"the model knows none of the dataset's labels: it finds {', '.join(names)}; the "
            f"dataset has {', '.join(dataset.labels)}; rename with --rename LABEL=CLASS"
        )
    return labels


class _Outcomes(NamedTuple):
    """Boxes that count, whatever their score."""

    scores: NDArray[np.float64]
    right: NDArray[np.bool_]
    """Whether each matches an annotation with an IoU of 0.5."""

    def figures(self, things: int, pictures: int, min_score: float) -> dict[str, Any]:
        """Figures by their names in `ClassFigures`: of the boxes of `min_score` and more.

        The calibration's is of all boxes.
        """
        right = self.right[self.scores >= min_score]
        false = int((~right).sum())
        return {
            "recall": float(right.sum()) / things if things else _NAN,
            "precision": float(right.mean()) if len(right) else _NAN,
            "false_boxes": false,
            "false_per_picture": false / pictures,
            "calibration_error": _calibration_error(self),
        }


class _Matching:
    """pycocotools' matches of detections and annotations, by class and picture."""

    def __init__(
        self, dataset: Dataset, found: Sequence[Sequence[Detection]], labels: Sequence[str]
    ) -> None:
        from pycocotools.coco import COCO  # noqa: PLC0415 - an extra
        from pycocotools.cocoeval import COCOeval  # noqa: PLC0415

        self.dataset, self.labels = dataset, labels
        number = {label: index for index, label in enumerate(labels)}
        # Numbers from 1: to pycocotools a match with 0 is none.
        self.things = [
            (index, thing)
            for index, picture in enumerate(dataset.pictures)
            for thing in picture.things
            if thing.label in number
        ]
        self.boxes = [
            (index, item)
            for index, items in enumerate(found)
            for item in items
            if item.label in number
        ]
        images = [{"id": index} for index in range(len(dataset.pictures))]
        categories = [{"id": index, "name": label} for index, label in enumerate(labels)]
        head = {"images": images, "categories": categories}
        annotations = [
            _entry(key, index, number[thing.label], thing.box)
            | {"iscrowd": int(thing.ignored)}
            | ({} if thing.area is None else {"area": thing.area})
            for key, (index, thing) in enumerate(self.things, 1)
        ]
        detections = [
            _entry(key, index, number[item.label], item.box) | {"score": item.score}
            for key, (index, item) in enumerate(self.boxes, 1)
        ]
        # Its stubs ask for typed dictionaries; what it reads is JSON.
        truth: Any = COCO()
        given: Any = COCO()
        truth.dataset = {**head, "annotations": annotations}
        given.dataset = {**head, "annotations": detections}
        with contextlib.redirect_stdout(io.StringIO()):
            truth.createIndex()
            given.createIndex()
            self._run: Any = COCOeval(truth, given, "bbox")
            self._run.evaluate()
            self._run.accumulate()
        self._precision: NDArray[np.float64] = self._run.eval["precision"]

    def average_precision(self, number: int, size: int, overlaps: slice) -> float:
        """Mean of COCO's precision over recalls and overlaps; NaN if there is no such thing."""
        values = self._precision[overlaps, :, number, size, -1]
        return float(values[values > -1].mean()) if (values > -1).any() else _NAN

    def matches(self, number: int) -> Iterator[dict[str, Any]]:
        """COCO's matches of one class, picture by picture, for all sizes."""
        pictures = len(self.dataset.pictures)
        start = number * len(_SIZES) * pictures
        every: list[dict[str, Any] | None] = self._run.evalImgs
        yield from (one for one in every[start : start + pictures] if one is not None)

    def outcomes(self, number: int) -> _Outcomes:
        """The boxes of one class that count, and whether each is right."""
        scores: list[float] = []
        right: list[bool] = []
        for one in self.matches(number):
            for score, match, ignored in zip(
                one["dtScores"], one["dtMatches"][0], one["dtIgnore"][0], strict=True
            ):
                if not ignored:
                    scores.append(score)
                    right.append(match > 0)
        return _Outcomes(np.array(scores, np.float64), np.array(right, np.bool_))

    def figures(self, number: int, outcomes: _Outcomes, min_score: float) -> ClassFigures:
        """The figures of one class."""
        things = sum(int((one["gtIgnore"] == 0).sum()) for one in self.matches(number))
        ap, small, medium, large = (
            self.average_precision(number, size, slice(None)) for size in range(len(_SIZES))
        )
        return ClassFigures(
            self.labels[number],
            things,
            ap50=self.average_precision(number, 0, slice(1)),
            ap=ap,
            ap_small=small,
            ap_medium=medium,
            ap_large=large,
            false_alarms=self._false_alarms(number, min_score),
            **outcomes.figures(things, len(self.dataset.pictures), min_score),
        )

    def _false_alarms(self, number: int, min_score: float) -> float:
        label = self.labels[number]
        holding = {index for index, thing in self.things if thing.label == label}
        seeing = {
            index for index, item in self.boxes if item.label == label and item.score >= min_score
        }
        without = len(self.dataset.pictures) - len(holding)
        return len(seeing - holding) / without if without else _NAN

    def mistakes(self, min_score: float) -> Iterator[Mistake]:
        """Boxes that match nothing, the surest first; then things not found, the largest first."""
        false: list[Mistake] = []
        missed: list[Mistake] = []
        for number, label in enumerate(self.labels):
            for one in self.matches(number):
                picture = self.dataset.pictures[one["image_id"]]
                score = dict(zip(one["dtIds"], one["dtScores"], strict=True))
                for key, match, ignored in zip(
                    one["dtIds"], one["dtMatches"][0], one["dtIgnore"][0], strict=True
                ):
                    if not match and not ignored and score[key] >= min_score:
                        box = self.boxes[key - 1][1].box
                        false.append(Mistake(picture, label, box, score[key]))
                for key, match, ignored in zip(
                    one["gtIds"], one["gtMatches"][0], one["gtIgnore"], strict=True
                ):
                    if not ignored and score.get(int(match), 0.0) < min_score:
                        missed.append(Mistake(picture, label, self.things[key - 1][1].box, None))
        yield from sorted(false, key=lambda one: -(one.score or 0.0))
        yield from sorted(missed, key=lambda one: -_area(one.box))


def _entry(key: int, picture: int, number: int, box: Box) -> dict[str, Any]:
    left, top, right, bottom = box
    return {
        "id": key,
        "image_id": picture,
        "category_id": number,
        "bbox": [left, top, right - left, bottom - top],
        "area": _area(box),
        "iscrowd": 0,
    }


def _area(box: Box) -> float:
    return (box[2] - box[0]) * (box[3] - box[1])


def _overall(
    rows: Sequence[ClassFigures], outcomes: _Outcomes, pictures: int, min_score: float
) -> ClassFigures:
    def mean(name: str) -> float:
        values = [getattr(row, name) for row in rows if not math.isnan(getattr(row, name))]
        return sum(values) / len(values) if values else _NAN

    things = sum(row.things for row in rows)
    return ClassFigures(
        "all",
        things,
        ap50=mean("ap50"),
        ap=mean("ap"),
        ap_small=mean("ap_small"),
        ap_medium=mean("ap_medium"),
        ap_large=mean("ap_large"),
        false_alarms=mean("false_alarms"),
        **outcomes.figures(things, pictures, min_score),
    )


def _reliability(outcomes: _Outcomes) -> Iterator[Bin]:
    scores, right = outcomes
    places = np.minimum((scores * _BINS).astype(int), _BINS - 1)
    for place in range(_BINS):
        inside = places == place
        count = int(inside.sum())
        yield Bin(
            place / _BINS,
            (place + 1) / _BINS,
            count,
            float(scores[inside].mean()) if count else _NAN,
            float(right[inside].mean()) if count else _NAN,
        )


def _calibration_error(outcomes: _Outcomes) -> float:
    bins = [one for one in _reliability(outcomes) if one.boxes]
    apart = sum(one.boxes * abs(one.score - one.right) for one in bins)
    return apart / len(outcomes.scores) if bins else _NAN
