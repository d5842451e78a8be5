"""Train, export and measure the detector, and write its card: what the command does."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np
import torch

from aerodaas.analytics.models import DETECTOR
from tools.training.card import Card, write_card
from tools.training.data_parallel import in_processes
from tools.training.dataset import Pictures, Sample
from tools.training.evaluate import SMALLEST, milliseconds, rankings, sightings, thresholds
from tools.training.export import NOMINAL_SCORE, SIZE, export_detector
from tools.training.loop import Progress
from tools.training.metrics import Ranking
from tools.training.rendering import HELD_OUT, render_world
from tools.training.train import Recipe, train
from tools.training.yolox import released_weights

__all__ = ["Places", "make_detector", "spent", "trained"]

_FALSE_PER_PICTURE = 0.02
"""Boxes of each class beside everything, in rendered pictures, that the threshold allows."""

_HIGHEST = 0.95

_SIZES = (16.0, 32.0)
"""Pixels between small, medium and large vests: COCO's limits, of pictures twice as wide."""

_PLAIN_WORLDS = 12
_UNCALIBRATED = [NOMINAL_SCORE] * 4


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
    yolox: Path = DETECTOR
    """Megvii's YOLOX-nano, or a detector made of it: the frozen part."""

    def run(self, name: str) -> Path:
        """Folder of the checkpoints of the model called `name`."""
        return self.work / name


def trained(places: Places, recipe: Recipe) -> Iterator[Progress]:
    """Train the detector, unless it has been for that many steps already."""
    yield from in_processes(recipe.processes, partial(_course, places, recipe))


def _course(places: Places, recipe: Recipe) -> Iterator[Progress]:
    frozen = released_weights(places.yolox)
    return train(Pictures(places.work / "train"), frozen, recipe, places.run("detector"))


def make_detector(places: Places, recipe: Recipe) -> Card:
    """Export the detector and write its card."""
    calibration, test = _held_out(places)
    path = places.out / "detector.onnx"
    weights = places.run("detector") / "weights.pt"
    frozen = released_weights(places.yolox)
    kept = (recipe.start, recipe.kept) if recipe.start is not None and recipe.kept else None
    export_detector(frozen, weights, path, _UNCALIBRATED, kept)
    chosen = thresholds(path, calibration, _FALSE_PER_PICTURE)
    limits = [min(score, _HIGHEST) for score in chosen.values()]
    export_detector(frozen, weights, path, limits, kept)
    card = Card(
        "Detector",
        "Finds hazard vests, people, cars and lattice towers. Ultralytics layout, detect: "
        f"1 x 8 x 4032 for {SIZE[1]} x {SIZE[0]} pixels; sides may be any multiples of 32. Scores "
        f"of what is learnt from renders are shifted, class by class, so that {NOMINAL_SCORE} "
        "leaves two boxes in a hundred rendered pictures beside everything.",
        _recipe_rows(places, recipe),
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


def _held_out(places: Places) -> tuple[list[Sample], list[Sample]]:
    """Pictures to choose thresholds by, and pictures to measure with: other worlds each."""
    pictures = Pictures(places.work / "held-out")
    samples = [pictures[index] for index in range(len(pictures))]
    third = len(samples) // 3
    return samples[:third], samples[third:]


def _precision(ranking: Ranking) -> str:
    return f"{ranking.average_precision:.3f} ({ranking.things} things)"


def _recipe_rows(places: Places, recipe: Recipe) -> dict[str, str]:
    kept = torch.load(places.run("detector") / "training.pt", weights_only=True, map_location="cpu")
    return {
        "Pictures": f"{len(Pictures(places.work / 'train'))}, rendered; no photograph but for the "
        "frozen part, which learnt from COCO",
        "Seed": str(recipe.seed),
        "Steps": f"{kept['step']} of {recipe.batch} pictures",
        "Time": spent(kept["seconds"]),
    }


def spent(seconds: float) -> str:
    """What a training took, and on what."""
    threads = torch.get_num_threads()
    where = "a GPU" if torch.cuda.is_available() else f"a CPU, {threads} thread(s)"
    return f"{seconds / 60:.0f} min on {where}"


def _finish(card: Card, path: Path) -> None:
    card.figures["Time per 1280 x 720 frame, one core"] = f"{milliseconds(path):.1f} ms"
    card.figures["File"] = f"{path.stat().st_size / 1e6:.1f} MB"
    write_card(card, path.with_suffix(".md"))
