"""Supported model families, in the order in which they are tried."""

from __future__ import annotations

from aerodaas.analytics.detection.families.base import ModelFamily
from aerodaas.analytics.detection.families.objectness import yolov5, yolox
from aerodaas.analytics.detection.families.rtdetr import rtdetr
from aerodaas.analytics.detection.families.ultralytics import end_to_end, ultralytics

__all__ = ["FAMILIES"]

FAMILIES: tuple[ModelFamily, ...] = (
    yolov5,
    yolox,
    ultralytics,
    rtdetr,
    end_to_end,
)
"""All families; a file belongs to the first that takes it.

RT-DETR, which is told by its numbers, stands before the end-to-end exports, whose shapes
its outputs can have.
"""
