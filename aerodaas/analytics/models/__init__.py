"""The networks that ship with the project, each beside its model card.

They are trained by `tools.training` on rendered pictures alone; `detector.md` and `pose.md`
tell how, and how well they do. The detector takes 320 x 320 pixels and is laid out as Ultralytics
exports are, so that `OnnxDetector` and other tools read it; the pose model takes cuts around
people, which `PoseAnalytics` makes.
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
"""Finds the 17 keypoints of COCO, in COCO's order, of the person in a cut of 128 x 128 pixels."""
