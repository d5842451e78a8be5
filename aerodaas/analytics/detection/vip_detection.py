"""VipDetectionAnalytics: detection of the hazard vest of the person assisted, and of people."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import ClassVar

from aerodaas.analytics.base import ResourceUse
from aerodaas.analytics.detection.detector import OnnxDetector
from aerodaas.analytics.models import DETECTOR
from aerodaas.config.checked import PositiveFraction

__all__ = ["VipDetectionAnalytics"]


class VipDetectionAnalytics(OnnxDetector):
    """An `OnnxDetector` for hazard vests, by default with the shipped model.

    It finds people, too, as a follower keeps away from everybody.
    """

    resources: ClassVar[Mapping[str, ResourceUse]] = {"model": "model"}

    def __init__(
        self,
        model: str | Path | None = None,
        *,
        classes: Sequence[str] | None = None,
        min_score: PositiveFraction = 0.3,
        iou: PositiveFraction = 0.45,
        providers: Sequence[str] | None = None,
        threads: int | None = None,
    ) -> None:
        """Read the model.

        Args:
            model: ONNX file, or the name of a fetched model; by default the shipped one.
            classes: Class names to keep; by default `vest` and `person` of the shipped model, and
                every class of any other model.
            min_score: Least confidence of a detection, above 0 to 1.
            iou: Overlap of two boxes above which only the better one is kept, above 0 to 1; lower
                than in other detectors, because people rarely stand chest before chest.
            providers: As in `OnnxDetector`.
            threads: As in `OnnxDetector`.

        Raises:
            ModelError: If the file or a setting is unsuitable.
        """
        wanted = ["vest", "person"] if model is None and classes is None else classes
        super().__init__(
            DETECTOR if model is None else model,
            classes=wanted,
            min_score=min_score,
            iou=iou,
            providers=providers,
            threads=threads,
        )
