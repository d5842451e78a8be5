"""Tables and pictures for notebooks: of streams in flight, and of recordings."""

from __future__ import annotations

import base64
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from synthetic_flight import PROVENANCE, SyntheticFlight

from aerodaas.config import extras
from aerodaas.config.model import RecordingConfig
from aerodaas.dataflow.graph import AeroStreamData, Graph
from aerodaas.errors import ConfigError, GraphError, MissionError, RecordingError
from aerodaas.extensions import notebook
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.frames import Frame, Header
from aerodaas.messages.mission import MissionState, MissionStatus
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.readings import Alert
from aerodaas.recording.pictures import detections
from aerodaas.recording.reader import Recording
from aerodaas.recording.recorder import FlightRecorder

HEAD = Header(7, 1_500_000_000, "drone/camera")
BOXES = (Detection((10, 20, 30, 60), "vest", 0.9, 4), Detection((1, 2, 3, 4), "person", 0.5))


class Reader:
    """Brings items, then waits in vain; or ends, as after the mission."""

    def __init__(self, items: list[object], *, ends: bool = False) -> None:
        self._items, self._ends = iter(items), ends

    def next_message(self, timeout: float) -> Any:  # noqa: ANN401
        """One message; its stamp counts up by a second."""
        del timeout
        for item in self._items:
            return SimpleNamespace(item=item, header=HEAD)
        raise StopIteration if self._ends else TimeoutError


def stream(*items: object, **words: bool) -> AeroStreamData[Any]:
    """A stream in flight that brings these items."""
    graph = Graph()
    graph.reader = lambda _: Reader(list(items), **words)  # type: ignore[return-value, assignment]
    return AeroStreamData(graph, "drone/some", object)


def test_what_streams_carry_becomes_columns() -> None:
    """Vectors by their axes, headers and values without their own names, states by their words."""
    place = Odometry(np.array([1.0, 2.0, 3.0]), np.zeros(3), 0.5)
    (row,) = notebook.live_table(stream(place)).to_dict("records")
    assert (row["position_east"], row["position_north"], row["position_up"]) == (1, 2, 3)
    assert (row["velocity_up"], row["yaw"]) == (0, 0.5)
    table = notebook.live_table(stream(Alert(HEAD, "low", "the battery is low", {"charge": 0.2})))
    assert list(table.index) == [1.5]
    assert table.index.name == "seconds"
    (row,) = table.to_dict("records")
    assert row == {
        "id": 7,
        "source": "drone/camera",
        "kind": "low",
        "text": "the battery is low",
        "charge": 0.2,
    }
    (row,) = notebook.live_table(stream(MissionStatus(1, MissionState.LANDED, "ok"))).to_dict(
        "records"
    )
    assert (row["state"], type(row["state"])) == (MissionState.LANDED.value, str)
    assert list(notebook.live_table(stream(3.5, 4.5))["value"]) == [3.5, 4.5]


def test_detections_are_a_row_each_and_pixels_none() -> None:
    """So that a table can be grouped by label; an empty picture has no row."""
    found = Detections(HEAD, BOXES, 640, 360)
    table = notebook.live_table(stream(found, Detections(HEAD, (), 640, 360)))
    assert list(table["label"]) == ["vest", "person"]
    assert list(table.loc[1.5, "bottom"]) == [60, 4]
    assert list(table["frame"]) == [7, 7]
    (row,) = notebook.live_table(stream(Frame(HEAD, np.zeros((4, 6, 3), np.uint8)))).to_dict(
        "records"
    )
    assert row == {"width": 6, "height": 4, "id": 7, "source": "drone/camera"}


def test_a_live_table_ends() -> None:
    """After the items asked for, with the mission, or after its time; empty if nothing came."""
    assert len(notebook.live_table(stream(1, 2, 3), items=2)) == 2
    assert len(notebook.live_table(stream(1, 2, 3, ends=True))) == 3
    assert len(notebook.live_table(stream(*range(100_000)), seconds=0.0)) == 0
    assert notebook.live_table(stream()).index.name == "seconds"


def test_a_table_that_cannot_be_says_why(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Before the mission, from a provider, and without pandas."""
    with pytest.raises(GraphError, match=r"call start_mission\(wait=False\) first"):
        notebook.live_table(AeroStreamData(Graph(), "drone/some", int))
    provided = stream()
    wire: Any = SimpleNamespace()
    provided.graph.reader = lambda _: wire
    with pytest.raises(MissionError, match="make a table of the recording"):
        notebook.live_table(provided)
    monkeypatch.setattr(extras, "has_extra", lambda _: False)
    remedy = r"pandas: pip install 'aerodaas\[notebook\]'"
    with pytest.raises(ConfigError, match=remedy):
        notebook.live_table(stream(1))
    with pytest.raises(ConfigError, match=remedy):
        notebook.recorded_table(tmp_path / "none.mcap", "a")


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short flight with a camera and a detector."""
    path = tmp_path_factory.mktemp("flight") / "flight.mcap"
    flight = SyntheticFlight(rate=2, hover=1, frames=0.5)
    with FlightRecorder(path, config=RecordingConfig(), provenance=PROVENANCE) as recorder:
        for message in flight.messages():
            recorder.write(message)
            if message.stream == "tello/detector":
                recorder.write(replace(message, stream="tello/second"))
    return path


def test_a_recorded_stream_is_found_by_its_name(recording: Path) -> None:
    """The stream itself, its name, or a channel; detections as in flight, a row each."""
    by_name = notebook.recorded_table(recording, "tello/detector")
    by_stream = notebook.recorded_table(recording, AeroStreamData(Graph(), "tello/detector", int))
    assert by_name.equals(by_stream)
    assert {"label", "score", "left", "top", "right", "bottom"} <= set(by_name.columns)
    assert by_name.index.is_monotonic_increasing
    with Recording.open(recording) as opened:
        found = [one for topic, one in detections(opened) if "detector" in topic]
    assert len(by_name) == sum(map(len, found)) > 10
    states = notebook.recorded_table(recording, "/tello/state")
    assert len(states) > 20
    assert states["battery.fraction"].between(0, 1).all()
    with pytest.raises(RecordingError, match="has no channel"):
        notebook.recorded_table(recording, "tello/nothing")


def pictures_in(shown: notebook.Pictures) -> Iterator[Any]:
    """What a notebook draws."""
    for code in re.findall(r'base64,([^"]+)"', shown._repr_html_()):
        yield cv2.imdecode(np.frombuffer(base64.b64decode(code), np.uint8), cv2.IMREAD_COLOR)


def test_recorded_pictures_are_spread_over_the_flight(recording: Path) -> None:
    """As many as asked for, with their boxes and words; never more than there are."""
    shown = notebook.recorded_pictures(recording, count=3)
    assert len(shown) == 3
    stamps = [float(re.findall(r"([\d.]+) s", one.caption)[0]) for one in shown]
    total = notebook.recorded_table(recording, "/tello/state").index[-1]
    assert stamps == sorted(stamps)
    assert stamps[0] < total / 3 < stamps[1] < 2 * total / 3 < stamps[2]
    assert all(re.search(r"person 0\.\d\d", one.caption) for one in shown), shown
    assert [image.shape for image in pictures_in(shown)] == [shown[0].image.shape] * 3
    every = notebook.recorded_pictures(recording, "tello/camera", count=10_000)
    assert len(every) > 20
    with pytest.raises(RecordingError, match="of tello/cam; it has: tello/camera"):
        notebook.recorded_pictures(recording, "tello/cam")


def test_boxes_are_drawn_into_a_copy() -> None:
    """Where they are, and nowhere else; the caption holds no markup of a stranger's label."""
    frame = Frame(HEAD, np.full((100, 100, 3), 128, np.uint8))
    odd = Detection((20, 40, 80, 90), "<b>", 0.9)
    shown = notebook.boxed(frame, [odd])
    assert (frame.image == 128).all()
    (image,) = pictures_in(shown)
    assert abs(int(image[65, 20].max()) - 128) > 30 or abs(int(image[65, 20].min()) - 128) > 30
    assert abs(int(image[65, 50].mean()) - 128) < 10
    assert "<b>" not in shown._repr_html_()
    assert "1.5 s: <b> 0.90" in shown[0].caption
    assert len(notebook.boxed(frame)) == 1
