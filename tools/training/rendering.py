"""Renders the pictures to train on, and those held out."""

from __future__ import annotations

import multiprocessing
from collections.abc import Iterator
from contextlib import ExitStack
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from aerodaas.simulation.scene.scene import ObjectAppearance
from tools.training.backdrops import backdrop, compose
from tools.training.clutter import add_clutter
from tools.training.dataset import Sample, save_shard
from tools.training.labelling import LabellingRenderer
from tools.training.looks import VariousLooks
from tools.training.scenes import draw_camera, draw_view, draw_world

__all__ = ["HELD_OUT", "VIEWS", "render_shards", "render_world"]

VIEWS = 20
"""Pictures of one world."""

HELD_OUT = 1_000_000
"""First seed of the worlds that are never trained on."""

_WORLDS_PER_SHARD = 10

_SHARE = 0.65
"""Of the rendered width, what is kept: a little more than the detector's input."""

_NOTHING = 0.06
"""Share of pictures of nothing that is looked for."""

_AS_FLOWN = 3
"""One world in so many is left as the simulator shows it in flight."""


def render_world(
    seed: int,
    views: int = VIEWS,
    *,
    plain: bool = False,
    appearance: ObjectAppearance | None = None,
) -> Iterator[Sample]:
    """Pictures of the world of this seed, 416 pixels wide; `plain` leaves them as rendered."""
    rng = np.random.default_rng([seed, 1])
    world, camera = draw_world(seed), draw_camera(rng)
    renderer = LabellingRenderer(world, camera, appearance or VariousLooks())
    for _ in range(rng.integers(0, 16)):
        x, y = rng.uniform(-14, 14, 2).tolist()
        add_clutter(renderer.scene, renderer.palette, (x, y), rng)
    for step in range(views):
        view = draw_view(world, camera, float(step), rng)
        picture = renderer.render(view.time, view.pose)
        labels = renderer.labels(view.time, view.pose)
        if not plain and rng.random() < _NOTHING:
            picture, labels = backdrop(picture.shape[:2], rng), []
        elif not plain:
            picture = compose(picture, renderer.numbers() > 0, rng)
        size = (round(_SHARE * camera.width), round(_SHARE * camera.height))
        small = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
        yield Sample.of(np.asarray(small, np.uint8), labels, _SHARE)
    renderer.close()


def _world(seed: int) -> Iterator[Sample]:
    if seed % _AS_FLOWN:
        return render_world(seed)
    return render_world(seed, plain=True, appearance=ObjectAppearance())


def render_shards(folder: Path, first: int, worlds: int, processes: int = 1) -> Iterator[int]:
    """Render `worlds` worlds from seed `first` on into `folder`; yields the worlds done so far.

    Shards that lie there already are not rendered again.
    """
    folder.mkdir(parents=True, exist_ok=True)
    end = first + worlds
    shards = [
        range(start, min(start + _WORLDS_PER_SHARD, end))
        for start in range(first, end, _WORLDS_PER_SHARD)
    ]
    work, done = partial(_render_shard, folder), 0
    with ExitStack() as stack:
        results: Iterator[int] = map(work, shards)
        if processes > 1:
            fresh = multiprocessing.get_context("spawn")  # a renderer does not outlive a fork
            results = stack.enter_context(fresh.Pool(processes)).imap_unordered(work, shards)
        for count in results:
            done += count
            yield done


def _render_shard(folder: Path, seeds: range) -> int:
    path = folder / f"{seeds.start:08d}.npz"
    if not path.exists():
        samples = [sample for seed in seeds for sample in _world(seed)]
        partial_path = path.with_suffix(".partial.npz")
        save_shard(partial_path, samples)
        partial_path.rename(path)
    return len(seeds)
