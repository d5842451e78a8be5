"""Trial run of a model: what no detector gives is refused before it flies.

A file says little of its outputs' meaning. Two pictures of coloured patches, prepared as frames
are, show whether its scores and boxes can be those of a detector: an export without its sigmoid,
with boxes in fractions of the picture, quantised until all scores are zero, or of a pose,
segmentation or oriented-box model whose metadata was stripped, runs without any error and finds
nothing, or everything.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from aerodaas.analytics.detection.families.base import Candidates, Decoder, Preprocessing
from aerodaas.analytics.detection.letterbox import Letterbox
from aerodaas.analytics.detection.model_file import ModelFile, PixelType

__all__ = ["Trial", "preprocessing_for", "try_out"]

_PICTURES = 2
_FRAME = (720, 1280)
_PATCHES = (9, 16)
_ROUNDING = 1e-3
"""How far beyond 0 and 1 a score may lie: half precision and quantisation round."""
_FRACTION = 2.0
"""Boxes all of whose corners lie within so many pixels of the origin are fractions, not pixels."""
_SURE = 0.5
"""A detector is this sure of less than half its boxes where there is nothing."""
_SEEN, _COMMON = 0.1, 0.1
"""Patches of colour hold nothing: no detector gives a tenth of its boxes scores of 0.1 and more."""
_CELLS = 100
"""Boxes a picture from which on a share of them tells anything."""
_STRIPPED = {
    51: "a pose model's 17 keypoints",
    32: "a segmentation model's mask coefficients",
    1: "an oriented-box model's angle",
}
"""Numbers a box that exports for other tasks have after the scores."""


@dataclass(frozen=True)
class Trial:
    """Output of a model for the trial pictures."""

    boxes: int
    """Boxes a picture, before any threshold."""
    scores: tuple[float, float] | None
    """Lowest and highest score; None if there was no box."""
    corners: tuple[float, float] | None
    """Lowest and highest coordinate of boxes that score above zero, in pixels of the input."""
    invalid: int
    """Outputs that were not finite, or of a class that there is not."""
    doubts: tuple[str, ...] = ()
    """What may be wrong, though it may also be right."""


def preprocessing_for(model: ModelFile, decoder: Decoder) -> Preprocessing:
    """The decoder's preprocessing; an input of bytes is not scaled.

    Args:
        model: The model.
        decoder: Its decoder.
    """
    style = decoder.preprocessing
    return replace(style, scale=1.0) if model.dtype is np.uint8 else style


def try_out(model: ModelFile, decoder: Decoder, style: Preprocessing) -> Trial:
    """Run `model` on the trial pictures and examine what `decoder` makes of it.

    Args:
        model: The model.
        decoder: Its decoder.
        style: How pictures become the network's input, by `preprocessing_for`.

    Raises:
        ModelError: If its scores or boxes cannot be those of a detector.
    """
    found: list[Candidates] = []
    for seed in range(_PICTURES):
        outputs = model.run(_pixels(seed, model.size, style, model.dtype))
        found.append(_decoded(model, decoder, outputs))
    scores = np.concatenate([one.scores for one in found])
    boxes = np.concatenate([one.boxes for one in found])
    invalid = sum(one.invalid for one in found)
    if not len(scores):
        return _nothing(model, decoder, invalid)
    spread = float(scores.min()), float(scores.max())
    _check_scores(model, decoder, scores, spread)
    seen = boxes[scores > 0]
    corners = (float(seen.min()), float(seen.max())) if len(seen) else None
    if corners is not None and max(-corners[0], corners[1]) <= _FRACTION:
        problem = f"gives boxes from {corners[0]:.2g} to {corners[1]:.2g}, which are no pixels"
        raise model.refusal(
            problem,
            "export it with boxes in pixels of its input, or multiply them in a ModelFamily of "
            "your own in families=",
        )
    doubts = () if corners else ("no box scores above zero; a model with NMS may find nothing",)
    return Trial(len(scores) // _PICTURES, spread, corners, invalid, doubts)


def _decoded(
    model: ModelFile, decoder: Decoder, outputs: tuple[NDArray[np.float32], ...]
) -> Candidates:
    try:
        return decoder.decode([output[0] for output in outputs], model.size, -np.inf)
    except (ValueError, IndexError, OverflowError) as error:
        problem = f"gives outputs of other shapes than it declares ({error})"
        raise model.refusal(problem) from None


def _nothing(model: ModelFile, decoder: Decoder, invalid: int) -> Trial:
    if decoder.overlapping:
        problem = "gives no finite number for a trial picture"
        raise model.refusal(problem, "export it in float32 instead of float16, or quantise it anew")
    return Trial(0, None, None, invalid, ("no box on the trial pictures, which hold nothing",))


def _check_scores(
    model: ModelFile, decoder: Decoder, scores: NDArray[np.float32], spread: tuple[float, float]
) -> None:
    lowest, highest = spread
    if lowest < -_ROUNDING or highest > 1 + _ROUNDING:
        problem = f"gives scores from {lowest:.2g} to {highest:.2g} instead of 0 to 1"
        remedy = f"export it with its sigmoid{_stripped(model, decoder)}"
        raise model.refusal(problem, remedy)
    many = len(scores) >= _CELLS * _PICTURES
    if many and float(np.median(scores)) >= _SURE:
        problem = f"scores most of its boxes above {_SURE} in pictures that hold nothing"
        remedy = (
            "its scores may be logits of another kind, or its last class 'no object': export it "
            "with scores from 0 to 1 for each class, or pass a ModelFamily of your own in families="
        )
        raise model.refusal(problem, remedy)
    if not decoder.overlapping:
        return
    if highest == 0.0:
        problem = "gives a score of zero to each of its boxes, whatever the picture"
        remedy = (
            "if it was quantised, keep its output layers in floating point: boxes and scores that "
            "share one scale leave nothing of the scores"
        )
        raise model.refusal(problem, remedy)
    share = float((scores >= _SEEN).mean())
    if many and share > _COMMON:
        problem = f"scores {share:.0%} of its boxes above {_SEEN} in pictures that hold nothing"
        remedy = f"export it for detection alone{_stripped(model, decoder)}"
        raise model.refusal(problem, remedy)


def _stripped(model: ModelFile, decoder: Decoder) -> str:
    """Further explanation where a file names no classes, for its classes may be none."""
    if model.names is not None:
        return ""
    kinds = [what for more, what in _STRIPPED.items() if decoder.classes > more]
    return (
        f"; it names no classes, so that some of its {decoder.classes} may be {', '.join(kinds)}: "
        "keep the metadata of the export"
        if kinds
        else ""
    )


def _pixels(
    seed: int, size: tuple[int, int], style: Preprocessing, dtype: type[PixelType]
) -> NDArray[np.generic]:
    """An input of one picture of blurred patches, each of a colour drawn by `seed`."""
    rng = np.random.default_rng(seed)
    patches = rng.integers(0, 256, (*_PATCHES, 3), dtype=np.uint8)
    picture = np.asarray(cv2.resize(patches, _FRAME[::-1]), np.uint8)
    letterbox = Letterbox(_FRAME, size, style)
    pixels = letterbox.buffer(1, dtype)
    letterbox.write(picture, pixels[0])
    return pixels
