"""Train, export and measure the keypoint network, and write its card."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import torch

from tools.training.card import Card, write_card
from tools.training.data_parallel import in_processes
from tools.training.dataset import Pictures
from tools.training.loop import Progress
from tools.training.pipeline import Places, spent
from tools.training.pose_cuts import CUT, People
from tools.training.pose_evaluate import PARTS, milliseconds_per_person, placing
from tools.training.pose_export import export_pose
from tools.training.pose_train import PoseRecipe, train_pose

__all__ = ["make_pose", "trained_pose"]


def trained_pose(places: Places, recipe: PoseRecipe) -> Iterator[Progress]:
    """Train the network, unless it has been for that many steps already."""
    yield from in_processes(recipe.processes, partial(_course, places, recipe))


def _course(places: Places, recipe: PoseRecipe) -> Iterator[Progress]:
    return train_pose(People(Pictures(places.work / "train")), recipe, places.run("pose"))


def make_pose(places: Places, recipe: PoseRecipe) -> Card:
    """Export the network and write its card."""
    path = places.out / "pose.onnx"
    folder = places.run("pose")
    export_pose(folder / "weights.pt", path)
    kept = torch.load(folder / "training.pt", weights_only=True, map_location="cpu")
    card = Card(
        "Pose",
        "Finds the 17 keypoints of COCO of the person in the middle of a square cut: "
        f"N x 3 x {CUT} x {CUT} (RGB, 0 to 1) to N x 17 x 3 (u and v in pixels of the cut, and the "
        "confidence that the joint is seen and its place is right). `PoseAnalytics` cuts.",
        {
            "People": f"{len(People(Pictures(places.work / 'train')))} in rendered pictures, each "
            "40 pixels long or more; no photograph",
            "Seed": str(recipe.seed),
            "Steps": f"{kept['step']} of {recipe.batch} cuts",
            "Time": spent(kept["seconds"]),
        },
        _figures(places),
    )
    write_card(card, path.with_suffix(".md"))
    return card


def _figures(places: Places) -> dict[str, str]:
    path = places.out / "pose.onnx"
    people = People(Pictures(places.work / "held-out"))
    exact, moved = placing(path, people), placing(path, people, moved=True)
    one, each = milliseconds_per_person(path)
    result = {
        "Held-out people": f"{len(people)}, in worlds not trained on",
        "OKS, mean": f"{exact.likeness.mean():.3f}; in boxes moved by 5 % and scaled by 10 %: "
        f"{moved.likeness.mean():.3f}",
        "OKS above 0.5": f"{(exact.likeness > 0.5).mean():.1%} of the people",  # noqa: PLR2004
    }
    for name, part in PARTS.items():
        share, error = exact.trusted(part)
        result[f"PCK@0.2 (and @0.1), {name}"] = (
            f"{exact.correct(part, 0.2):.3f} ({exact.correct(part, 0.1):.3f}); "
            f"trusted: {share:.0%}, median error of these {error:.3f}"
        )
    result["Time per person, one core"] = f"{one:.1f} ms; of five in a frame {each:.1f} ms each"
    result["File"] = f"{path.stat().st_size / 1e6:.1f} MB"
    return result
