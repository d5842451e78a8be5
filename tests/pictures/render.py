"""Renders the pictures of this folder and writes where what is: `python tests/pictures/render.py`.

Worlds, looks and lenses are those of training, of seeds that were neither trained on nor measured
with. `labels.json` is {file: {class: [[left, top, right, bottom], ...]}}, in pixels.
"""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np

from aerodaas.analytics.models import DETECTOR_CLASSES
from tools.training.labelling import Label, LabellingRenderer
from tools.training.looks import VariousLooks
from tools.training.rendering import HELD_OUT
from tools.training.scenes import draw_camera, draw_view, draw_world

HERE = Path(__file__).parent
PICTURES = 16
_SEED = HELD_OUT + 900
_VEST = DETECTOR_CLASSES.index("vest")
_NARROWEST, _LOWEST = 24, 40
"""Pixels of the vest that each picture holds."""


def main() -> None:
    """One picture of each world that shows one vest well."""
    told: dict[str, dict[str, list[list[int]]]] = {}
    for seed in range(_SEED, _SEED + 20 * PICTURES):
        if len(told) == PICTURES:
            break
        found = _picture(seed)
        if found is None:
            continue
        image, labels = found
        name = f"world_{seed - _SEED:03}.jpg"
        cv2.imwrite(str(HERE / name), image, [cv2.IMWRITE_JPEG_QUALITY, 75])
        boxes: dict[str, list[list[int]]] = {}
        for label in labels:
            box = label.box.round().astype(int).tolist()
            boxes.setdefault(DETECTOR_CLASSES[label.kind], []).append(box)
        told[name] = boxes
    rows = [f'  "{name}": {json.dumps(boxes)}' for name, boxes in told.items()]
    (HERE / "labels.json").write_text("{\n" + ",\n".join(rows) + "\n}\n")


def _picture(seed: int) -> tuple[np.ndarray, list[Label]] | None:
    rng = np.random.default_rng([seed, 1])
    world, camera = draw_world(seed), draw_camera(rng)
    renderer = LabellingRenderer(world, camera, VariousLooks())
    try:
        for step in range(20):
            view = draw_view(world, camera, float(step), rng)
            image = renderer.render(view.time, view.pose)
            labels = renderer.labels(view.time, view.pose)
            vests = [label.box for label in labels if label.kind == _VEST]
            if len(vests) == 1:
                width, height = vests[0][2:] - vests[0][:2]
                if width >= _NARROWEST and height >= _LOWEST:
                    return np.asarray(image, np.uint8), labels
        return None
    finally:
        renderer.close()


if __name__ == "__main__":
    main()
