"""The neural networks shipped with the project, each beside its model card.

They are trained by `tools.training` on rendered images alone, the detector on the features of
YOLOX-nano, which learnt from photographs and whose notice is in `NOTICE.md`. `detector.md` and
`pose.md` describe the training and the accuracy. The detector takes up to 384 x 256 pixels and
has the layout of Ultralytics exports, so that `OnnxDetector` and other tools load it; the pose
model takes crops around people, which `PoseAnalytics` makes.
"""

from __future__ import annotations

from pathlib import Path

__all__ = ["DETECTOR", "DETECTOR_CLASSES", "POSE"]

_HERE = Path(__file__).parent

DETECTOR = _HERE / "detector.onnx"
"""Object detector of `DETECTOR_CLASSES`."""

DETECTOR_CLASSES = ("vest", "person", "car", "tower")
"""Class names of the detector, in the order of its outputs."""

POSE = _HERE / "pose.onnx"
"""Pose model: the 17 keypoints of COCO, in COCO's order, of a person in a 128 x 128 pixel crop."""
