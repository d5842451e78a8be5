"""The networks that ship with the project, each beside its model card.

They are trained by `aerodaas.training` on rendered pictures alone; `detector.md` and `pose.md`
tell how, and how well they do. Both take 320 x 320 pixels and are laid out as Ultralytics
exports are, so that `OnnxDetector` and other tools read them.
"""

from __future__ import annotations

from pathlib import Path

__all__ = ["DETECTOR", "DETECTOR_CLASSES", "POSE"]

_HERE = Path(__file__).parent

DETECTOR = _HERE / "detector.onnx"
"""Finds `DETECTOR_CLASSES`."""

DETECTOR_CLASSES = ("vest", "person", "car", "tower")
"""Class names of the detector, in the order of its outputs."""

POSE = _HERE / "pose.onnx"
"""Finds `person` with the 17 keypoints of COCO, in COCO's order."""
