"""What happens to a rendered picture before it is learnt from.

A camera's faults are what a renderer lacks: colour casts, blown highlights, blur, noise and
compression. Pictures are also cut, scaled, mirrored and patched together.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from aerodaas.analytics.people.joints import MIRRORED
from tools.training.dataset import Sample

__all__ = ["augmented", "placed", "spoiled"]

Picture = NDArray[np.uint8]

_GREY = 114
_GRAIN_SIDE = 1024
"""Pixels: pictures are smaller."""

_LEAST_SIDE, _LEAST_SHARE = 3.0, 0.3
"""A box cut at the picture's edge stays if this many pixels and this share of it remain."""


def augmented(
    draw: Callable[[], Sample], size: tuple[int, int], rng: np.random.Generator, mosaics: float
) -> Sample:
    """Make one picture of `size` (height, width) of those that `draw` gives.

    With a probability of `mosaics` it is patched together of four.
    """
    height, width = size
    if rng.random() < mosaics:
        middle = rng.uniform((0.3, 0.3), (0.7, 0.7)) * (width, height)
        canvas = np.full((height, width, 3), _GREY, np.uint8)
        u, v = (int(part) for part in middle)
        corners = [(0, 0, u, v), (u, 0, width, v), (0, v, u, height), (u, v, width, height)]
        parts = []
        for left, top, right, bottom in corners:
            part = _warped(draw(), (bottom - top, right - left), rng)
            canvas[top:bottom, left:right] = part.image
            parts.append(_shifted(part, left, top))
        sample = Sample(
            canvas,
            np.concatenate([part.kinds for part in parts]),
            np.concatenate([part.boxes for part in parts]),
            np.concatenate([part.keypoints for part in parts]),
        )
    else:
        sample = _warped(draw(), size, rng)
    return Sample(spoiled(sample.image, rng), sample.kinds, sample.boxes, sample.keypoints)


def placed(
    sample: Sample, matrix: NDArray[np.float64], size: tuple[int, int], *, mirror: bool = False
) -> Sample:
    """The sample under an affine `matrix` (2, 3) without rotation, cut to `size`."""
    height, width = size
    image = cv2.warpAffine(sample.image, matrix, (width, height), borderValue=(_GREY, _GREY, _GREY))
    scale, offset = np.diag(matrix[:, :2]), matrix[:, 2]
    boxes = (sample.boxes.reshape(-1, 2, 2) * scale + offset).reshape(-1, 4)
    boxes = np.concatenate(
        [np.minimum(boxes[:, :2], boxes[:, 2:]), np.maximum(boxes[:, :2], boxes[:, 2:])], axis=1
    )
    cut = np.clip(boxes, 0, (width, height, width, height))
    before = np.prod(boxes[:, 2:] - boxes[:, :2], axis=1)
    sides = cut[:, 2:] - cut[:, :2]
    kept = (sides.min(axis=1) >= _LEAST_SIDE) & (sides.prod(axis=1) >= _LEAST_SHARE * before)
    points = sample.keypoints.copy()
    points[..., :2] = points[..., :2] * scale + offset
    inside = ((points[..., :2] >= 0) & (points[..., :2] < (width, height))).all(axis=-1)
    points[~inside] = 0.0
    if mirror:
        points = points[:, MIRRORED]
    return Sample(
        np.asarray(image, np.uint8),
        sample.kinds[kept],
        cut[kept].astype(np.float32),
        points[kept].astype(np.float32),
    )


def _warped(sample: Sample, size: tuple[int, int], rng: np.random.Generator) -> Sample:
    """Scale, stretch, mirror and shift a sample into `size`."""
    height, width = size
    rows, columns = sample.image.shape[:2]
    fit = min(width / columns, height / rows)
    zoom = fit * np.exp(rng.uniform(np.log(0.75), np.log(2.0)))
    stretch = np.exp(rng.normal(0.0, 0.07))
    mirror = bool(rng.integers(2))
    across, down = zoom * stretch * (-1 if mirror else 1), zoom / stretch
    # The middle of the cut lies anywhere that keeps most of the picture in sight.
    slack = np.maximum(0.0, np.array([abs(across) * columns - width, down * rows - height])) / 2
    slack += 0.06 * np.array([width, height])
    centre = np.array([width, height]) / 2 + rng.uniform(-1, 1, 2) * slack
    offset = centre - np.array([across * columns, down * rows]) / 2
    matrix = np.array([[across, 0.0, offset[0]], [0.0, down, offset[1]]])
    return placed(sample, matrix, size, mirror=mirror)


def _shifted(sample: Sample, left: int, top: int) -> Sample:
    points = sample.keypoints.copy()
    points[..., :2] += np.where(points[..., 2:] > 0, np.array([left, top], np.float32), 0.0)
    shift = np.array([left, top, left, top], np.float32)
    return Sample(sample.image, sample.kinds, sample.boxes + shift, points)


def spoiled(image: Picture, rng: np.random.Generator) -> Picture:
    """The picture as a cheap camera and a thin link would have brought it."""
    result = _blurred(image, rng)
    result = _toned(result, rng)
    if rng.random() < 0.5:  # noqa: PLR2004 - half
        result = _noisy(result, rng)
    if rng.random() < 0.5:  # noqa: PLR2004 - half
        quality = [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(12, 80))]
        file = cv2.imencode(".jpg", result, quality)[1]
        result = np.asarray(cv2.imdecode(file, cv2.IMREAD_COLOR), np.uint8)
    return result


def _blurred(image: Picture, rng: np.random.Generator) -> Picture:
    choice = rng.random()
    if choice < 0.15:  # noqa: PLR2004 - out of focus
        return np.asarray(cv2.GaussianBlur(image, (0, 0), rng.uniform(0.4, 1.4)), np.uint8)
    if choice < 0.25:  # noqa: PLR2004 - the camera moves
        length = int(rng.integers(3, 8))
        kernel = np.zeros((length, length), np.float32)
        angle = rng.uniform(0, np.pi)
        reach = np.array([np.cos(angle), np.sin(angle)]) * length / 2
        start, end = length / 2 - reach, length / 2 + reach
        first, last = (int(start[0]), int(start[1])), (int(end[0]), int(end[1]))
        cv2.line(kernel, first, last, 1.0)
        return np.asarray(cv2.filter2D(image, -1, kernel / max(kernel.sum(), 1.0)), np.uint8)
    if choice < 0.4:  # noqa: PLR2004 - few pixels
        height, width = image.shape[:2]
        share = rng.uniform(0.4, 0.9)
        small = cv2.resize(image, None, fx=share, fy=share, interpolation=cv2.INTER_AREA)
        return np.asarray(cv2.resize(small, (width, height)), np.uint8)
    if choice < 0.5:  # noqa: PLR2004 - sharpened by the camera
        soft = cv2.GaussianBlur(image, (0, 0), 1.0)
        return np.asarray(cv2.addWeighted(image, 1.8, soft, -0.8, 0), np.uint8)
    return image


def _toned(image: Picture, rng: np.random.Generator) -> Picture:
    """Change the tones: gamma, gain and offset of each channel, saturation, hue."""
    result = image
    if rng.random() < 0.7:  # noqa: PLR2004 - most
        hsv = cv2.cvtColor(image, cv2.COLOR_BGR2HSV)
        steps = np.arange(256)
        hue = ((np.arange(256) + rng.uniform(-7, 7)) % 180).astype(np.uint8)
        saturation = np.clip(steps * rng.uniform(0.25, 1.5), 0, 255).astype(np.uint8)
        table = np.stack([hue, saturation, steps.astype(np.uint8)], axis=-1)[None]
        result = np.asarray(cv2.cvtColor(cv2.LUT(hsv, table), cv2.COLOR_HSV2BGR), np.uint8)
    tones = np.linspace(0, 1, 256)[:, None]
    gamma = np.exp(rng.normal(0.0, 0.22))
    cast = np.exp(rng.normal(0.0, 0.14, 3))
    gain, haze = np.exp(rng.normal(0.05, 0.25)), max(0.0, rng.normal(-0.03, 0.07))
    curve = haze + (1 - haze) * gain * cast * tones**gamma
    if rng.random() < 0.3:  # noqa: PLR2004 - highlights and shadows rolled off
        curve = curve + rng.uniform(0, 0.12) * np.sin(2 * np.pi * (curve - 0.5))
    table = np.clip(curve * 255, 0, 255).astype(np.uint8)[None]
    return np.asarray(cv2.LUT(result, table), np.uint8)


@cache
def _grain() -> NDArray[np.float32]:
    """Noise to cut pieces from: to draw it for each picture would take longer than all else."""
    shape = (_GRAIN_SIDE, _GRAIN_SIDE, 3)
    return np.random.default_rng(0).standard_normal(shape, dtype=np.float32)


def _noisy(image: Picture, rng: np.random.Generator) -> Picture:
    height, width = image.shape[:2]
    coarse = 1 + int(rng.integers(2))
    rows, columns = height // coarse, width // coarse
    top, left = rng.integers((_GRAIN_SIDE - rows, _GRAIN_SIDE - columns)).tolist()
    grain = _grain()[top : top + rows, left : left + columns]
    if rng.integers(2):
        grain = np.repeat(grain[..., :1], 3, axis=2)
    if coarse > 1:
        grain = np.asarray(cv2.resize(grain, (width, height)), np.float32)
    added = grain * np.float32(rng.uniform(1, 12))
    return np.asarray(cv2.add(image, added, dtype=cv2.CV_8U), np.uint8)
