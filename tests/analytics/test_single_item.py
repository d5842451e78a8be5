"""`analyse` of one item: its result at once, without a mission or an actor."""

from __future__ import annotations

import logging
from typing import ClassVar

import numpy as np
import pytest

from aerodaas import AeroData, Alert, Analytics, Detections, Frame, Header
from aerodaas.analytics import BodyPoseEmergencyAnalytics, TowerInspectionAnalytics
from aerodaas.analytics.base import Context
from aerodaas.errors import GraphError

_FRAME = Frame(Header(3, 7_000, "camera"), np.full((4, 6, 3), 9, np.uint8))


class _Mean(Analytics[float]):
    accepts: ClassVar[tuple[type, ...]] = (Frame,)
    produces: ClassVar[type] = float

    def __init__(self) -> None:
        self.opened = 0

    def open(self) -> None:
        self.opened += 1

    def process(self, item: Frame, context: Context) -> float | None:
        """The mean of the image, with how often it was opened and the stamp."""
        assert context.vehicle() is None
        assert context.kind == "edge"
        context.alert(Alert(item.header, "seen", f"frame {item.header.id}"))
        return float(item.image.mean()) + 100 * self.opened + context.now()


def test_an_item_is_processed_at_once(caplog: pytest.LogCaptureFixture) -> None:
    """By one copy that is opened once, so that the analysis itself may still fly."""
    mean = _Mean()
    with caplog.at_level(logging.WARNING):
        results = [mean.analyse(AeroData(_FRAME)).get_data() for _ in range(2)]
    assert results == [7109.0, 7109.0]
    assert mean.opened == 0
    assert caplog.messages == ["frame 3", "frame 3"]


@pytest.mark.parametrize("item", [None, 3, Detections(_FRAME.header, (), 6, 4)])
def test_another_type_is_refused(item: object) -> None:
    """By name, as a stream would be."""
    with pytest.raises(GraphError, match=f"_Mean takes a Frame, not a {type(item).__name__}"):
        _Mean().analyse(AeroData(item))


def test_what_is_neither_a_stream_nor_an_item_is_refused() -> None:
    """The item itself is one: it goes in an AeroData."""
    with pytest.raises(GraphError, match="takes a stream or AeroData, not Frame"):
        _Mean().analyse(_FRAME)  # type: ignore[call-overload]


def test_analyses_that_need_a_stream_say_so() -> None:
    """A fall is seen over time; boxes have no picture that could be written to a folder."""
    with pytest.raises(GraphError, match="watches a stream of frames"):
        BodyPoseEmergencyAnalytics().analyse(AeroData(_FRAME))
    with pytest.raises(GraphError, match="has no pictures to write"):
        TowerInspectionAnalytics(pictures="here").analyse(
            AeroData(Detections(_FRAME.header, (), 6, 4))
        )
