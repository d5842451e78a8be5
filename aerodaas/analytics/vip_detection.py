"""VipDetectionAnalytics: finds the hazard vest of the person to be assisted."""

from __future__ import annotations

from pathlib import Path

from aerodaas.analytics.onnx.detector import OnnxDetector
from aerodaas.errors import ModelError

__all__ = ["VipDetectionAnalytics"]

_SHIPPED = Path(__file__).parent / "models" / "vest.onnx"


class VipDetectionAnalytics(OnnxDetector):
    """An `OnnxDetector` whose model knows hazard vests."""

    def __init__(
        self,
        model: str | Path | None = None,
        *,
        classes: list[str] | None = None,
        min_score: float = 0.3,
        providers: list[str] | None = None,
        threads: int | None = None,
    ) -> None:
        """Load `model`, or the one that ships with the package; raises ModelError."""
        path = Path(model) if model is not None else _SHIPPED
        if model is None and not path.exists():
            message = (
                "no vest model ships with this version; give one of your own, as in "
                'VipDetectionAnalytics(model="vest.onnx")'
            )
            raise ModelError(message)
        super().__init__(
            path, classes=classes, min_score=min_score, providers=providers, threads=threads
        )
