"""Renders the pictures to train on, and those held out."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from aerodaas.simulation.scene.scene import Looks
from tools.training.backdrops import compose
from tools.training.clutter import add_clutter
from tools.training.dataset import Sample, save_shard
from tools.training.labelling import LabellingRenderer
from tools.training.looks import VariousLooks
from tools.training.scenes import draw_camera, draw_view, draw_world

__all__ = ["CALIBRATION", "HELD_OUT", "VIEWS", "render_shards", "render_world"]

VIEWS = 20
"""Pictures of one world."""

HELD_OUT = 1_000_000
"""First seed of the worlds that are never trained on."""

CALIBRATION = HELD_OUT + 2000
"""First seed of the worlds that thresholds are chosen by."""

_WORLDS_PER_SHARD = 10

_AS_FLOWN = 3
"""One world in so many is left as the simulator shows it in flight."""


def render_world(
    seed: int, views: int = VIEWS, *, plain: bool = False, looks: Looks | None = None
) -> Iterator[Sample]:
    """Pictures of the world of this seed, 416 pixels wide; `plain` leaves them as rendered."""
    rng = np.random.default_rng([seed, 1])
    world, camera = draw_world(seed), draw_camera(rng)
    renderer = LabellingRenderer(world, camera, looks or VariousLooks())
    for _ in range(rng.integers(0, 16)):
        x, y = rng.uniform(-14, 14, 2).tolist()
        add_clutter(renderer.scene, renderer.palette, (x, y), rng)
    for step in range(views):
        view = draw_view(world, camera, float(step), rng)
        picture = renderer.render(view.time, view.pose)
        labels = renderer.labels(view.time, view.pose)
        if not plain:
            picture = compose(picture, renderer.numbers() > 0, rng)
        size = (camera.width // 2, camera.height // 2)
        small = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
        yield Sample.of(np.asarray(small, np.uint8), labels, 0.5)
    renderer.close()


def _world(seed: int) -> Iterator[Sample]:
    if seed % _AS_FLOWN:
        return render_world(seed)
    return render_world(seed, plain=True, looks=Looks())


def render_shards(folder: Path, first: int, worlds: int) -> Iterator[int]:
    """Render `worlds` worlds from seed `first` on into `folder`; yields the worlds done so far.

    Shards that lie there already are not rendered again.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for start in range(first, first + worlds, _WORLDS_PER_SHARD):
        seeds = range(start, min(start + _WORLDS_PER_SHARD, first + worlds))
        path = folder / f"{start:08d}.npz"
        if not path.exists():
            samples = [sample for seed in seeds for sample in _world(seed)]
            partial = path.with_suffix(".partial.npz")
            save_shard(partial, samples)
            partial.rename(path)
        yield seeds.stop - first
