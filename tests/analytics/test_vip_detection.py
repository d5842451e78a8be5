"""The vest detector needs a model, and says so."""

from __future__ import annotations

import pytest

from aerodaas.analytics import vip_detection
from aerodaas.analytics.vip_detection import VipDetectionAnalytics
from aerodaas.errors import ModelError


@pytest.mark.skipif(vip_detection._SHIPPED.exists(), reason="a vest model ships")
def test_without_a_shipped_model_the_remedy_is_told() -> None:
    """At build time, not in flight."""
    with pytest.raises(ModelError, match=r'VipDetectionAnalytics\(model="vest.onnx"\)'):
        VipDetectionAnalytics()
