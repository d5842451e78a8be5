"""Figures of an exported model, measured as it will be used: through `OnnxDetector`."""

from __future__ import annotations

import json
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from aerodaas.analytics.detection.detector import OnnxDetector
from aerodaas.analytics.detection.vip_detection import VipDetectionAnalytics
from aerodaas.analytics.models import DETECTOR_CLASSES
from aerodaas.messages.detections import Detections
from aerodaas.messages.frames import Frame, Header
from tools.training.dataset import Sample
from tools.training.metrics import Floats, Ranking, overlap, strays

__all__ = ["SMALLEST", "Sightings", "milliseconds", "rankings", "sightings", "thresholds"]

_LEAST = 0.01
"""Score of the weakest detection that counts for average precision."""

SMALLEST = 8.0
"""Pixels: what is narrower or lower in the network's input need not be found."""

_ENOUGH = 0.5
"""IoU of a box with what it has found."""

_TIMED_RUNS = 200


def _opened(model: Path, min_score: float) -> OnnxDetector:
    detector = OnnxDetector(model, min_score=min_score, threads=1)
    detector.open()
    return detector


def _find(detector: OnnxDetector, sample: Sample) -> Detections:
    return detector.detect([Frame(Header(0, 0, "rendered"), sample.image)])[0]


def _boxes(found: Detections, label: str) -> tuple[list[float], Floats]:
    kept = [item for item in found if item.label == label]
    boxes = np.array([item.box for item in kept], dtype=float).reshape(-1, 4)
    return [item.score for item in kept], boxes


def _sized(boxes: Floats, least: float, below: float) -> NDArray[np.bool_]:
    sides = (boxes[:, 2:] - boxes[:, :2]).min(axis=1, initial=np.inf)
    return np.asarray((sides >= least) & (sides < below))


def rankings(
    model: Path, samples: Iterable[Sample], least: float = SMALLEST, below: float = np.inf
) -> dict[str, Ranking]:
    """Rank the detections of each class of a detector over labelled pictures.

    What is narrower or lower than `least` pixels, or neither than `below`, need not be found. Where
    nothing is, a box counts unless another range has it (as COCO measures by size).
    """
    detector = _opened(model, _LEAST)
    lowest = 0.0 if least == SMALLEST else least
    result = {label: Ranking([], []) for label in detector.names}
    for sample in samples:
        found = _find(detector, sample)
        for label, ranking in result.items():
            truth = sample.boxes[sample.kinds == DETECTOR_CLASSES.index(label)].astype(float)
            scores, boxes = _boxes(found, label)
            counts, table = _sized(truth, least, below), overlap(boxes, truth)
            heard = _sized(boxes, lowest, below) | (table >= _ENOUGH).any(axis=1)
            ranking.add(np.array(scores)[heard], table[heard], counts, _ENOUGH)
    return result


def thresholds(model: Path, samples: Sequence[Sample], most_false: float) -> dict[str, float]:
    """Return the lowest score of each class with at most `most_false` stray boxes per picture."""
    detector = _opened(model, _LEAST)
    astray: dict[str, list[float]] = {label: [] for label in detector.names}
    for sample in samples:
        found = _find(detector, sample)
        for label, scores in astray.items():
            truth = sample.boxes[sample.kinds == DETECTOR_CLASSES.index(label)].astype(float)
            given, boxes = _boxes(found, label)
            scores.extend(np.array(given)[strays(boxes, truth)].tolist())
    allowed = int(most_false * len(samples))
    return {
        label: sorted([*scores, *[_LEAST] * (allowed + 1)], reverse=True)[allowed]
        for label, scores in astray.items()
    }


@dataclass(frozen=True)
class Sightings:
    """What a detector made of photographs of one known thing each."""

    pictures: int
    found: int
    """Pictures in which a box's middle lies on the thing."""
    false: int
    """Boxes elsewhere."""
    doubled: int
    """Boxes on a thing that another box has found, too."""


def sightings(model: Path, folder: Path, labels: Path, min_score: float) -> Sightings:
    """Look for vests in photographs; `labels` is JSON, {file: [left, top, right, bottom]}."""
    detector = VipDetectionAnalytics(model, classes=["vest"], min_score=min_score, threads=1)
    detector.open()
    found = false = doubled = 0
    truth = json.loads(labels.read_text(encoding="utf-8"))
    for name, (left, top, right, bottom) in truth.items():
        image = np.asarray(cv2.imread(str(folder / name)), np.uint8)
        middles = [
            ((item.box[0] + item.box[2]) / 2, (item.box[1] + item.box[3]) / 2)
            for item in detector.detect([Frame(Header(0, 0, name), image)])[0]
        ]
        hits = [left <= u <= right and top <= v <= bottom for u, v in middles]
        found += any(hits)
        false += len(hits) - sum(hits)
        doubled += max(0, sum(hits) - 1)
    return Sightings(len(truth), found, false, doubled)


def milliseconds(model: Path) -> float:
    """Median time of one frame of 1280 x 720 pixels, all included, on one core."""
    detector = _opened(model, 0.3)
    noise = np.random.default_rng(0).integers(0, 255, (720, 1280, 3), dtype=np.uint8)
    frame = Frame(Header(0, 0, "noise"), noise)
    times = []
    for _ in range(_TIMED_RUNS):
        begin = time.perf_counter()
        detector.detect([frame])
        times.append(time.perf_counter() - begin)
    return 1000 * float(np.median(times))
