"""Cuts around rendered people, as a detector's boxes would give them, for learning keypoints."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from aerodaas.analytics.people.joints import GREY, MARGIN, MIRRORED
from tools.training.augment import spoiled
from tools.training.dataset import Pictures
from tools.training.surroundings import surrounded

__all__ = ["CUT", "Cut", "People"]

CUT = 128
"""Side of a cut in pixels."""
_TALL = 40.0
"""Pixels of a person to learn postures from, at least."""

_MOST = 6
"""Keypoints, more than which must be in the picture."""

_TURNED = 0.15
"""Share of the cuts turned by any angle: those who lie are rare, and lie any way."""

_SURROUNDED = 0.5
"""Share of the cuts with pieces of other pictures beside the person."""

_COVERED = 0.35
"""Share of the cuts in which something hides a part."""


_ARMLESS = 0.5
"""Share of the boxes that leave out the arms, as those of a detector do."""

_ARMS = slice(7, 11)
"""Elbows and wrists."""

_FLESH = 0.08
"""From joints to the outline, in longer sides of the box."""


@dataclass(frozen=True)
class Cut:
    """One square cut."""

    image: NDArray[np.uint8]
    """(CUT, CUT, 3), BGR."""
    keypoints: NDArray[np.float32]
    """(17, 3): u, v, and 0 (outside the picture), 1 (hidden) or 2 (visible)."""
    size: float
    """Longer side of the person's box, in pixels of the cut."""


class People:
    """All people of some size in rendered pictures, the pictures held decoded in memory."""

    def __init__(self, pictures: Pictures) -> None:
        """Gather them."""
        self._images: list[NDArray[np.uint8]] = []
        self._rows: list[tuple[int, NDArray[np.float32], NDArray[np.float32]]] = []
        for index in range(len(pictures)):
            sample = pictures[index]
            sides = (sample.boxes[:, 2:] - sample.boxes[:, :2]).max(axis=1, initial=0.0)
            joints = (sample.keypoints[..., 2] > 0).sum(axis=1)
            chosen = np.flatnonzero((sides >= _TALL) & (joints > _MOST))
            if len(chosen):
                self._images.append(sample.image)
            self._rows += [
                (len(self._images) - 1, sample.boxes[one], sample.keypoints[one]) for one in chosen
            ]

    def __len__(self) -> int:
        """Count the people."""
        return len(self._rows)

    def __getitem__(
        self, index: int
    ) -> tuple[NDArray[np.uint8], NDArray[np.float32], NDArray[np.float32]]:
        """Picture, box (4,) and keypoints (17, 3) of one, in the picture's pixels."""
        number, box, points = self._rows[index]
        return self._images[number], box, points

    def cut(self, index: int, rng: np.random.Generator | None = None) -> Cut:
        """Cut out one; with `rng`, as a detector and a cheap camera might give it."""
        picture, box, points = self[index]
        if rng is not None and rng.random() < _ARMLESS:
            box = _without_arms(box, points)
        matrix, mirror, side = _matrix(box, rng)
        grey = (GREY, GREY, GREY)
        image = np.asarray(cv2.warpAffine(picture, matrix, (CUT, CUT), borderValue=grey), np.uint8)
        found = points.copy()
        found[:, :2] = points[:, :2] @ matrix[:, :2].T + matrix[:, 2]
        found[((found[:, :2] < 0) | (found[:, :2] >= CUT)).any(axis=1)] = 0.0
        found[points[:, 2] == 0] = 0.0
        if mirror:
            found = found[MIRRORED]
        longest = float((self[index][1][2:] - self[index][1][:2]).max())
        size = longest * CUT / side
        if rng is not None:
            if rng.random() < _SURROUNDED:
                other = self._images[int(rng.integers(len(self._images)))]
                image = surrounded(image, found, size, other, rng)
            if rng.random() < _COVERED:
                image, found = _covered(image, found, rng)
            image = spoiled(image, rng)
        return Cut(image, found.astype(np.float32), size)


def _without_arms(box: NDArray[np.float32], points: NDArray[np.float32]) -> NDArray[np.float32]:
    """The part of the box around head, trunk and legs."""
    others = np.delete(points, np.r_[_ARMS], axis=0)
    places = others[others[:, 2] > 0, :2]
    if len(places) < 2:  # noqa: PLR2004 - of no extent
        return box
    room = _FLESH * (box[2:] - box[:2]).max()
    low = np.maximum(box[:2], places.min(axis=0) - room)
    high = np.minimum(box[2:], places.max(axis=0) + room)
    return np.concatenate([low, high]).astype(np.float32)


def _matrix(
    box: NDArray[np.float32], rng: np.random.Generator | None
) -> tuple[NDArray[np.float64], bool, float]:
    """Picture to cut (2, 3), whether that mirrors, and the cut's side in the picture's pixels."""
    sides = (box[2:] - box[:2]).astype(float)
    longest = float(sides.max())
    middle = (box[:2] + box[2:]).astype(float) / 2
    side, angle, mirror = MARGIN * longest, 0.0, False
    if rng is not None:
        # Most boxes are about right; some miss the feet, or an arm.
        side *= float(np.exp(rng.normal(-0.02, 0.13)))
        middle = middle + rng.normal(0.0, 0.05, 2) * longest
        turned = rng.random() < _TURNED
        angle = rng.uniform(-1.9, 1.9) if turned else rng.normal(0.0, 0.16)
        mirror = bool(rng.integers(2))
    zoom = CUT / side
    turn = zoom * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    if mirror:
        turn[0] *= -1
    offset = CUT / 2 - turn @ middle
    return np.hstack([turn, offset[:, None]]), mirror, side


def _covered(
    image: NDArray[np.uint8], points: NDArray[np.float32], rng: np.random.Generator
) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
    """Hide a part of the cut behind a piece of another place of it, or below its lower edge."""
    image, points = image.copy(), points.copy()
    if rng.random() < 0.4:  # noqa: PLR2004 - a picture's edge
        row = int(rng.uniform(0.45, 0.9) * CUT)
        image[row:] = GREY
        points[points[:, 1] >= row] = 0.0
        return image, points
    width, height = (rng.uniform(0.1, 0.45, 2) * CUT).astype(int)
    left, top = (rng.random(2) * (CUT - width, CUT - height)).astype(int)
    from_u, from_v = (rng.random(2) * (CUT - width, CUT - height)).astype(int)
    patch = image[from_v : from_v + height, from_u : from_u + width].copy()
    if rng.random() < 0.5:  # noqa: PLR2004 - half
        patch[:] = rng.integers(0, 256, 3)
    image[top : top + height, left : left + width] = patch
    inside = ((points[:, :2] >= (left, top)) & (points[:, :2] < (left + width, top + height))).all(
        axis=1
    )
    points[:, 2] = np.where(inside, np.minimum(points[:, 2], 1.0), points[:, 2])
    return image, points
