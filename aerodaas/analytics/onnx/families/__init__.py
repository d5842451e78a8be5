"""The kinds of models that are recognised, in the order in which they are tried."""

from __future__ import annotations

from aerodaas.analytics.onnx.families.base import ModelFamily
from aerodaas.analytics.onnx.families.end2end import end_to_end
from aerodaas.analytics.onnx.families.ultralytics import ultralytics
from aerodaas.analytics.onnx.families.yolov5 import yolov5
from aerodaas.analytics.onnx.families.yolox import yolox

__all__ = ["FAMILIES"]

FAMILIES: tuple[ModelFamily, ...] = (yolov5, yolox, ultralytics, end_to_end)
"""The strictest first: those that must fit the grid of the input's size exactly."""
