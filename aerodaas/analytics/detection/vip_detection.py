"""VipDetectionAnalytics: finds the hazard vest of the person to be assisted."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from aerodaas.analytics.detection.detector import OnnxDetector
from aerodaas.analytics.models import DETECTOR

__all__ = ["VipDetectionAnalytics"]


class VipDetectionAnalytics(OnnxDetector):
    """An `OnnxDetector` that looks for hazard vests, by default with the model that ships."""

    def __init__(
        self,
        model: str | Path | None = None,
        *,
        classes: Sequence[str] | None = None,
        min_score: float = 0.3,
        iou: float = 0.45,
        providers: Sequence[str] | None = None,
        threads: int | None = None,
    ) -> None:
        """Load `model`, or the one that ships; raises ModelError.

        `classes` are the names to keep: by default `vest` of the shipped model, and every class
        of a model of your own. Of two boxes that overlap by more than `iou` the better one stays:
        less than other detectors allow, for people seldom stand chest before chest.
        """
        wanted = ["vest"] if model is None and classes is None else classes
        super().__init__(
            DETECTOR if model is None else model,
            classes=wanted,
            min_score=min_score,
            iou=iou,
            providers=providers,
            threads=threads,
        )
