"""Train, export, measure, and write the card: what the commands do."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import torch

from aerodaas.training.card import Card, write_card
from aerodaas.training.dataset import Pictures, Sample
from aerodaas.training.evaluate import (
    keypoint_ranking,
    milliseconds,
    rankings,
    sightings,
    thresholds,
)
from aerodaas.training.export import NOMINAL_SCORE, SIZE, export_detector, export_pose
from aerodaas.training.metrics import Ranking
from aerodaas.training.rendering import HELD_OUT, render_world
from aerodaas.training.train import Progress, Recipe, train

__all__ = ["Places", "make_detector", "make_pose", "trained"]

_FALSE_PER_PICTURE = 0.1
"""Boxes of each class beside everything, in rendered pictures, that the threshold allows."""

_HIGHEST = 0.95

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

    def run(self, name: str) -> Path:
        """Folder of the checkpoints of the model called `name`."""
        return self.work / name


def trained(places: Places, recipe: Recipe, name: str) -> Iterator[Progress]:
    """Train the model called `name`, unless it has been for that many steps already."""
    yield from train(Pictures(places.work / "train"), recipe, places.run(name))


def make_detector(places: Places, recipe: Recipe) -> Card:
    """Export the detector and write its card."""
    calibration, test = _held_out(places)
    path = places.out / "detector.onnx"
    weights = places.run("detector") / "weights.pt"
    export_detector(weights, path, _UNCALIBRATED)
    chosen = thresholds(path, calibration, _FALSE_PER_PICTURE)
    export_detector(weights, path, [min(score, _HIGHEST) for score in chosen.values()])
    card = Card(
        "Detector",
        "Finds hazard vests, people, cars and lattice towers. Ultralytics layout, detect: "
        f"1 x 8 x 2100 for {SIZE} x {SIZE} pixels. Scores are shifted, class by class, so that "
        f"{NOMINAL_SCORE} leaves one box in ten rendered pictures beside everything.",
        _recipe_rows(places, recipe, "detector"),
    )
    card.figures["Held-out pictures"] = f"{len(test)}, of other worlds; things of 8 pixels and more"
    plain = rankings(path, _plain())
    for label, ranking in rankings(path, test).items():
        card.figures[f"mAP50, {label}"] = _precision(ranking)
        card.figures[f"mAP50, {label}, as the simulator shows it"] = _precision(plain[label])
    if places.photographs is not None and places.labels is not None:
        seen = sightings(path, places.photographs, places.labels, NOMINAL_SCORE)
        card.figures["Photographs with the vest found"] = f"{seen.found} of {seen.pictures}"
        card.figures["Boxes beside it in all of them"] = str(seen.false)
        card.figures["Boxes on a vest already found"] = str(seen.doubled)
    _finish(card, path)
    return card


def make_pose(places: Places, recipe: Recipe) -> Card:
    """Export the pose model and write its card."""
    calibration, test = _held_out(places)
    path = places.out / "pose.onnx"
    weights = places.run("pose") / "weights.pt"
    export_pose(weights, path, _UNCALIBRATED)
    chosen = thresholds(path, calibration, _FALSE_PER_PICTURE)
    export_pose(weights, path, [min(chosen["person"], _HIGHEST)] * 4)
    card = Card(
        "Pose",
        "Finds people and the 17 keypoints of COCO. Ultralytics layout, pose: 1 x 56 x 2100 for "
        f"{SIZE} x {SIZE} pixels; a keypoint's confidence is that of its being seen. Scores are "
        f"shifted so that {NOMINAL_SCORE} leaves one box in ten renders beside everything.",
        _recipe_rows(places, recipe, "pose"),
    )
    card.figures["Held-out pictures"] = f"{len(test)}, of worlds not trained on"
    card.figures["mAP50 of boxes"] = _precision(rankings(path, test)["person"])
    card.figures["mAP50 of keypoints (OKS)"] = _precision(keypoint_ranking(path, test))
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


def _recipe_rows(places: Places, recipe: Recipe, name: str) -> dict[str, str]:
    kept = torch.load(places.run(name) / "training.pt", weights_only=True, map_location="cpu")
    steps = f"{kept['step']} of {recipe.batch} pictures"
    if recipe.postures:
        steps = f"{steps} cut around people, from the detector's weights on"
    else:
        steps = f"{steps}, {min(recipe.halved, kept['step'])} of them on halved ones"
    threads = torch.get_num_threads()
    where = "a GPU" if torch.cuda.is_available() else f"a CPU, {threads} thread(s)"
    return {
        "Pictures": f"{len(Pictures(places.work / 'train'))}, rendered; no photograph",
        "Seed": str(recipe.seed),
        "Steps": steps,
        "Time": f"{kept['seconds'] / 60:.0f} min on {where}",
    }


def _finish(card: Card, path: Path) -> None:
    card.figures["Time per 1280 x 720 frame, one core"] = f"{milliseconds(path):.1f} ms"
    card.figures["File"] = f"{path.stat().st_size / 1e6:.1f} MB"
    write_card(card, path.with_suffix(".md"))
