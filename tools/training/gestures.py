"""Trains the gesture classifier on bodies of the simulator's skeleton, seen from all sides.

``python -m tools.training gestures``: draws bodies, projects their keypoints into a drone's
camera, adds a pose model's faults (noise, missing points, sides taken for each other), normalises
them, fits a support vector machine and writes it as ONNX beside its model card. The same seed
gives the same file. It needs ``pip install 'aerodaas[training]'``.
"""

from __future__ import annotations

import importlib.util
import math
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import onnxruntime as ort
import typer
from numpy.typing import NDArray

from aerodaas.analytics.people.gestures import GESTURE_MODEL, GESTURES, normalised
from aerodaas.analytics.people.joints import POINTS
from aerodaas.geometry.frames import CameraModel, enu_to_body
from tools.training.bodies import keypoints_of, sample_body

__all__ = ["main", "sample_keypoints", "train"]

Array = NDArray[np.float64]
_MIRRORED = [0, 2, 1, 4, 3, 6, 5, 8, 7, 10, 9, 12, 11, 14, 13, 16, 15]
"""Keypoints by number with left and right exchanged."""
_MIN_CONFIDENCE = 0.35
_OPSET = 15
_OPSET_ML = 3
_HELD_OUT = 1_000_003
"""Added to the seed for the bodies that the figures are of."""


def sample_keypoints(rng: np.random.Generator, gesture: str) -> NDArray[np.float32]:
    """Draw a body's keypoints (17, 3: u, v, confidence) as a pose model would find them."""
    while True:
        points = keypoints_of(sample_body(rng, gesture))
        turn = rng.uniform(-math.pi, math.pi)
        camera = CameraModel.from_fov(640, 360, rng.uniform(1.0, 1.6), pitch=rng.uniform(-0.1, 0.6))
        eye = np.array([-rng.uniform(1.3, 12.0), 0.0, rng.uniform(0.8, 4.0)])
        side = rng.normal(0, 0.15) * eye[0]
        turned = np.array([enu_to_body(point, turn) for point in points])
        placed = turned + np.array([0.0, side, 0.0]) - eye
        pixels = np.array([camera.project(point) for point in placed])
        found = np.full((POINTS, 3), np.nan)
        inside = (
            (pixels[:, 2] > 0)
            & (np.abs(pixels[:, 0] - camera.cx) < camera.cx)
            & (np.abs(pixels[:, 1] - camera.cy) < camera.cy)
        )
        if inside.sum() < 6:  # noqa: PLR2004 - fewer tell nothing
            continue
        extent = np.ptp(pixels[inside, :2], axis=0).max()
        noise = rng.normal(0, rng.uniform(0.005, 0.035) * extent, (POINTS, 2))
        found[:, :2] = pixels[:, :2] + noise
        if rng.random() < 0.08:  # noqa: PLR2004 - from behind, sides are taken for each other
            found = found[_MIRRORED]
        kept = inside & (rng.random(POINTS) >= rng.uniform(0, 0.25))
        found[:, 2] = np.where(kept, rng.uniform(0.4, 1.0, POINTS), 0.1)
        return np.nan_to_num(found.astype(np.float32))


def draw(seed: int, count: int) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """Draw `count` bodies of each gesture; returns features and numbers of the gestures."""
    rng = np.random.default_rng(seed)
    classes = np.repeat(np.arange(len(GESTURES)), count)
    points = np.stack([sample_keypoints(rng, GESTURES[number]) for number in classes])
    features, useful = normalised(points, _MIN_CONFIDENCE)
    return features[useful], classes[useful]


def train(seed: int, count: int) -> tuple[bytes, dict[str, Any]]:
    """Fit on `count` bodies of each gesture; returns the ONNX file and the figures of its card.

    The figures are of a quarter as many bodies of another seed.
    """
    from sklearn.svm import SVC  # noqa: PLC0415 - only for training

    features, classes = draw(seed, count)
    settings: dict[str, Any] = {"C": 10.0, "gamma": 0.08, "probability": True, "cache_size": 500}
    machine = SVC(**settings, random_state=seed)
    machine.fit(features, classes)
    held_features, held_classes = draw(seed + _HELD_OUT, count // 4)
    content = _as_onnx(machine)
    guesses = _run(content, held_features)
    best = guesses.argmax(axis=1)
    confusion = np.zeros((len(GESTURES), len(GESTURES)), int)
    np.add.at(confusion, (held_classes, best), 1)
    certain = guesses.max(axis=1) >= 0.6  # noqa: PLR2004 - as the analysis asks
    figures = {
        "seed": seed,
        "trained on": len(classes),
        "held out": len(held_classes),
        "support vectors": len(machine.support_vectors_),
        "accuracy": float((best == held_classes).mean()),
        "told": float(certain.mean()),
        "accuracy of what is told": float((best == held_classes)[certain].mean()),
        "confusion": confusion,
        "bytes": len(content),
    }
    return content, figures


def _as_onnx(machine: Any) -> bytes:  # noqa: ANN401 - scikit-learn has no types
    """Convert the machine, keeping its probabilities as the only output."""
    from onnx import helper  # noqa: PLC0415 - only for training
    from skl2onnx import to_onnx  # noqa: PLC0415
    from skl2onnx.common.data_types import FloatTensorType  # noqa: PLC0415

    inputs: list[tuple[str, Any]] = [("features", FloatTensorType([None, 3 * POINTS]))]
    model: Any = to_onnx(
        machine,
        initial_types=inputs,
        options={"zipmap": False},
        target_opset={"": _OPSET, "ai.onnx.ml": _OPSET_ML},
    )
    label = next(output for output in model.graph.output if "label" in output.name)
    model.graph.output.remove(label)
    helper.set_model_props(model, {"task": "gestures", "names": ",".join(GESTURES)})
    return bytes(model.SerializeToString())


def _run(content: bytes, features: NDArray[np.float32]) -> NDArray[np.float32]:
    session = ort.InferenceSession(content, providers=["CPUExecutionProvider"])
    return np.asarray(session.run(None, {"features": features})[0])


def _card(figures: dict[str, Any]) -> str:
    """The model card, in Markdown."""
    confusion = figures["confusion"]
    shares = 100 * confusion / confusion.sum(axis=1, keepdims=True)
    rows = "\n".join(
        f"| {name} | {' | '.join(f'{share:.1f}' for share in row)} |"
        for name, row in zip(GESTURES, shares, strict=True)
    )
    return f"""# gestures.onnx

Tells from a body's 17 keypoints (COCO's order) whether a hand is raised, the body has fallen, or
it stands or walks: a support vector machine (radial basis functions) over normalised keypoints.

- Input `features`, N x 51: see `aerodaas.analytics.people.gestures.normalised`.
- Output `probabilities`, N x {len(GESTURES)}: {", ".join(GESTURES)}.
- Trained by `python -m tools.training gestures --seed {figures["seed"]}` on
  {figures["trained on"]} bodies of the simulator's skeleton in random postures, seen by cameras
  0.8 to 4 m up and 1.3 to 12 m away, with noise of 0.5 to 3.5 % of the body's extent, up to 25 %
  of the points missing, and all that lie outside the picture. No picture of a person was used.
- {figures["support vectors"]} support vectors, {figures["bytes"] / 1024:.0f} KiB.
- `other` is sitting, crouching, bending over, and a hand at the head.

## On {figures["held out"]} held-out bodies of another seed

Accuracy {figures["accuracy"]:.1%}. Of the {figures["told"]:.1%} with a probability of 0.6 and
more, which is what the analysis goes by, {figures["accuracy of what is told"]:.1%} are right.

Percent of the bodies in each row that are taken for each column:

| | {" | ".join(GESTURES)} |
|---|{"---|" * len(GESTURES)}
{rows}

It sees one frame at a time: a body that lies with its length along the line of sight looks much
like one that sits, and a follower two metres behind a person has the feet out of the picture.
`BodyPoseEmergencyAnalytics` therefore wants several frames that agree.
"""


def main(
    seed: Annotated[int, typer.Option(help="Seed of the bodies.")] = 7,
    bodies: Annotated[int, typer.Option(help="Bodies of each gesture.", min=100)] = 3000,
    out: Annotated[Path, typer.Option(help="File of the model; its card lies beside.")] = (
        GESTURE_MODEL
    ),
) -> None:
    """Train the classifier of gestures, write it, and print its card."""
    missing = [name for name in ("sklearn", "skl2onnx") if importlib.util.find_spec(name) is None]
    if missing:
        typer.echo("training needs scikit-learn and skl2onnx: pip install 'aerodaas[training]'")
        raise typer.Exit(1)
    content, figures = train(seed, bodies)
    card = _card(figures)
    out.write_bytes(content)
    out.with_suffix(".md").write_text(card, encoding="utf-8")
    typer.echo(card)
