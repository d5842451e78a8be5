"""Train, export and measure the detector, and write its card: what the command does."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import torch

from aerodaas.analytics.models import DETECTOR, DETECTOR_CLASSES
from tools.training.card import Card, write_card
from tools.training.data_parallel import in_processes
from tools.training.dataset import Pictures, Sample
from tools.training.evaluate import SMALLEST, milliseconds, rankings, sightings, thresholds
from tools.training.export import Parts, export_detector, heads_of, network_in, network_of
from tools.training.features import Examples, cache_features
from tools.training.fusion import NOMINAL_SCORE
from tools.training.heads_train import HeadsRecipe, train_heads
from tools.training.loop import Progress
from tools.training.metrics import Ranking
from tools.training.rendering import HELD_OUT, render_world
from tools.training.train import Recipe, train
from tools.training.yolox import SIZE, FeatureExtractor

__all__ = ["Places", "cached", "make_detector", "spent", "trained", "trained_heads"]

_FALSE_PER_PICTURE = 0.04
"""Boxes of each class beside everything, in rendered pictures, that the threshold allows."""

_SIZES = (16.0, 32.0)
"""Pixels between small, medium and large vests: COCO's limits, of pictures twice as wide."""

_PLAIN_WORLDS = 12
_UNCALIBRATED = 0.03
"""Two that must agree score low before they are calibrated."""


@dataclass(frozen=True)
class Places:
    """Where things lie."""

    work: Path
    """Pictures and checkpoints."""
    out: Path
    """Models and their cards."""
    photographs: Path | None = None
    labels: Path | None = None
    """JSON, {file: [left, top, right, bottom]} of the vest in each photograph."""
    frozen: Path = DETECTOR
    """The file with the frozen part: Megvii's YOLOX-nano, or a detector made of it."""
    network: Path | None = None
    """A detector whose network is taken over; by default one is trained."""

    def run(self, name: str) -> Path:
        """Folder of the checkpoints of the model called `name`."""
        return self.work / name


def trained(places: Places, recipe: Recipe) -> Iterator[Progress]:
    """Train the detector, unless it has been for that many steps already."""
    yield from in_processes(recipe.processes, partial(_course, places, recipe))


def _course(places: Places, recipe: Recipe) -> Iterator[Progress]:
    return train(Pictures(places.work / "train"), recipe, places.run("detector"))


def cached(places: Places, examples: int) -> Iterator[int]:
    """Cache the frozen part's features of so many examples; yields how many there are."""
    extract = FeatureExtractor(onnx.load(str(places.frozen)))
    yield from cache_features(Pictures(places.work / "train"), extract, _features(places), examples)


def _features(places: Places) -> Path:
    return places.work / "features"


def trained_heads(places: Places, recipe: HeadsRecipe) -> Iterator[Progress]:
    """Train the heads on cached features, unless they have been for that many steps already."""
    yield from train_heads(Examples(_features(places)), recipe, places.run("heads"))


def make_detector(places: Places, recipe: Recipe, heads_recipe: HeadsRecipe) -> Card:
    """Export the detector and write its card."""
    calibration, test = (_samples(places.work / name) for name in ("calibration", "held-out"))
    path = places.out / "detector.onnx"
    own = places.run("detector") / "weights.pt"
    parts = Parts(
        network_of(own) if places.network is None else network_in(places.network),
        heads_of(places.run("heads") / "weights.pt"),
        onnx.load(str(places.frozen)),
    )
    export_detector(parts, path, dict.fromkeys(DETECTOR_CLASSES, _UNCALIBRATED), released=False)
    chosen = thresholds(path, calibration, _FALSE_PER_PICTURE)
    export_detector(parts, path, {name: _uncalibrated(score) for name, score in chosen.items()})
    card = Card(
        "Detector",
        "Finds hazard vests, people, cars and lattice towers. Ultralytics layout, detect: "
        f"1 x 8 x 3801 for {SIZE[1]} x {SIZE[0]} pixels. Scores of what is learnt from renders are "
        f"shifted, class by class, so that {NOMINAL_SCORE} leaves four boxes in a hundred rendered "
        "pictures beside everything.",
        {**_network_rows(places, recipe), **_heads_rows(places, heads_recipe)},
    )
    card.figures["Held-out pictures"] = f"{len(test)}, of other worlds; things of 8 pixels and more"
    plain = rankings(path, _plain())
    for label, ranking in rankings(path, test).items():
        card.figures[f"mAP50, {label}"] = _precision(ranking)
        card.figures[f"mAP50, {label}, as the simulator shows it"] = _precision(plain[label])
    for least, below in pairwise((SMALLEST, *_SIZES, np.inf)):
        vests = rankings(path, test, least, below)["vest"]
        sizes = f"{least:.0f} pixels and more" if below == np.inf else f"{least:.0f} to {below:.0f}"
        card.figures[f"mAP50, vest, {sizes}"] = _precision(vests)
    if places.photographs is not None and places.labels is not None:
        seen = sightings(path, places.photographs, places.labels, NOMINAL_SCORE)
        card.figures["Photographs with the vest found"] = f"{seen.found} of {seen.pictures}"
        card.figures["Boxes beside it in all of them"] = str(seen.false)
        card.figures["Boxes on a vest already found"] = str(seen.doubled)
    _finish(card, path)
    return card


def _plain() -> list[Sample]:
    """Pictures as the simulator gives them, of worlds of their own."""
    seeds = range(HELD_OUT + 1000, HELD_OUT + 1000 + _PLAIN_WORLDS)
    return [sample for seed in seeds for sample in render_world(seed, 10, plain=True)]


def _samples(folder: Path) -> list[Sample]:
    pictures = Pictures(folder)
    return [pictures[index] for index in range(len(pictures))]


def _precision(ranking: Ranking) -> str:
    return f"{ranking.average_precision:.3f} ({ranking.things} things)"


def _uncalibrated(score: float) -> float:
    """What `score` was before it was shifted with the threshold `_UNCALIBRATED`."""
    odds = score / (1 - score) * (1 - NOMINAL_SCORE) / NOMINAL_SCORE
    odds *= _UNCALIBRATED / (1 - _UNCALIBRATED)
    return odds / (1 + odds)


def _network_rows(places: Places, recipe: Recipe) -> dict[str, str]:
    if places.network is not None:
        return {"Network": f"taken over from {places.network.name}"}
    kept = _kept(places.run("detector"))
    halved = min(recipe.halved, kept["step"])
    return {
        "Pictures": f"{len(Pictures(places.work / 'train'))}, rendered; no photograph",
        "Seed": str(recipe.seed),
        "Steps": f"{kept['step']} of {recipe.batch} pictures, {halved} of them on halved ones",
        "Time": spent(kept["seconds"]),
    }


def _heads_rows(places: Places, recipe: HeadsRecipe) -> dict[str, str]:
    kept = _kept(places.run("heads"))
    examples, pictures = len(Examples(_features(places))), len(Pictures(places.work / "train"))
    return {
        "Heads, frozen below": "backbone and neck of YOLOX-nano (Megvii, Apache-2.0)",
        "Heads, examples": f"{examples}, augmented, of {pictures} rendered pictures",
        "Heads, seed": str(recipe.seed),
        "Heads, steps": f"{kept['step']} of {recipe.batch} examples",
        "Heads, time": spent(kept["seconds"]),
    }


def _kept(folder: Path) -> dict[str, Any]:
    kept: dict[str, Any] = torch.load(folder / "training.pt", weights_only=True, map_location="cpu")
    return kept


def spent(seconds: float) -> str:
    """What a training took, and on what."""
    threads = torch.get_num_threads()
    where = "a GPU" if torch.cuda.is_available() else f"a CPU, {threads} thread(s)"
    return f"{seconds / 60:.0f} min on {where}"


def _finish(card: Card, path: Path) -> None:
    card.figures["Time per 1280 x 720 frame, one core"] = f"{milliseconds(path):.1f} ms"
    card.figures["File"] = f"{path.stat().st_size / 1e6:.1f} MB"
    write_card(card, path.with_suffix(".md"))
