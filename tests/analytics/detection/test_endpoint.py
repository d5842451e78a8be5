"""Inference endpoints: the same results as on the edge, and every kind of bad answer survived."""

from __future__ import annotations

import contextlib
import json
import logging
import socket
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes
from hypothesis.extra.numpy import arrays as numpy_arrays
from inference_server import Serving, serving
from synthetic_models import constant_model, patchwork_model

from aerodaas.analytics.base import Analytics
from aerodaas.analytics.detection.detector import OnnxDetector
from aerodaas.analytics.endpoint.analysis import endpoint_analysis
from aerodaas.analytics.endpoint.tensors import HEADER_LENGTH, decode_reply, encode_request
from aerodaas.config.model import ComputeConfig
from aerodaas.errors import ConfigError, EndpointError, GraphError, ModelError
from aerodaas.messages.detections import Detections
from aerodaas.messages.frames import Frame, Header

pytestmark = pytest.mark.wall_clock

SECRET = "correct-horse-battery"  # noqa: S105 - this test's own
PICTURE = np.full((360, 640, 3), 250, np.uint8)
PICTURE[:, 320:] = 10
FRAME = Frame(Header(7, 8, "drone/camera"), PICTURE)


class Hurried:
    """A context that says how long there is."""

    kind = "edge"

    def __init__(self, seconds: float | None = None) -> None:
        self._seconds = seconds

    def time_left(self) -> float | None:
        """Wall seconds."""
        return self._seconds


def ask(analysis: Analytics[Any], seconds: float | None = None) -> Any:  # noqa: ANN401
    """Process the frame with so much time left."""
    return analysis.process(FRAME, Hurried(seconds))  # type: ignore[arg-type]


def resource(url: str, **endpoint: Any) -> ComputeConfig:  # noqa: ANN401
    """A compute resource for an address."""
    told = {"url": url, "timeout": 10.0, **endpoint}
    return ComputeConfig.model_validate(
        {"id": "fn", "kind": "http", "executors": 4, "endpoint": told}
    )


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A model whose boxes depend on the picture."""
    return patchwork_model(tmp_path_factory.mktemp("model") / "patchwork.onnx")


@pytest.fixture
def served(model: Path) -> Serving:
    """A server of the model."""
    return Serving(model)


@pytest.fixture
def url(served: Serving) -> Iterator[str]:
    """Its address."""
    with serving(served) as address:
        yield address


@contextmanager
def opened(
    work: Analytics[Any], to: ComputeConfig, *, strict: bool = True
) -> Iterator[Analytics[Any]]:
    """An analysis before an endpoint, opened as its actor opens it."""
    analysis = endpoint_analysis(work, "lamps", to, strict=strict)
    analysis.open()
    yield analysis
    analysis.close()


def at_home(model: Path) -> Detections:
    """What the detector finds on the edge."""
    detector = OnnxDetector(model)
    detector.open()
    return detector.detect([FRAME])[0]


@pytest.mark.parametrize("binary", [True, False])
def test_a_model_finds_the_same_there_as_here(
    model: Path, served: Serving, url: str, *, binary: bool
) -> None:
    """Binary tensors where the server takes them, JSON where it does not."""
    served.binary = binary
    with opened(OnnxDetector(model), resource(url)) as analysis:
        found = ask(analysis)
    assert found.items == at_home(model).items
    assert len(found) > 0
    assert served.seen["binary"] == (2 if binary else 1)
    assert served.seen["json"] == (0 if binary else 2)


def test_threads_share_one_analysis_and_its_connections(
    model: Path, served: Serving, url: str
) -> None:
    """Each thread gets its own frame's boxes; connections are kept, and no more than allowed."""
    detector = OnnxDetector(model)
    pictures = [np.full((360, 640, 3), shade, np.uint8) for shade in range(120, 250, 10)]
    frames = [Frame(Header(i, i, "c"), picture) for i, picture in enumerate(pictures)]
    detector.open()
    wanted = [detector.detect([frame])[0].items for frame in frames]
    with (
        opened(OnnxDetector(model), resource(url)) as analysis,
        ThreadPoolExecutor(8) as pool,
    ):
        found = list(pool.map(lambda f: analysis.process(f, Hurried()), frames))  # type: ignore[arg-type]
    assert [one.items for one in found if one] == wanted
    assert 1 <= len(served.connections) <= 4


def test_a_function_takes_jpeg_and_tells_detections(model: Path, served: Serving, url: str) -> None:
    """Boxes are clipped, classes and scores are those that the analysis asks for."""
    detector = OnnxDetector(model, names=["lamp", *(f"other{i}" for i in range(79))])
    detector.classes = ["lamp"]
    function = resource(f"{url}/detect", protocol="function", models={"lamps": "night"})
    with opened(detector, function) as analysis:
        (lamp,) = ask(analysis)
    assert lamp.label == "lamp"
    assert lamp.box == (0.0, 0.0, 320.0, 360.0)
    assert lamp.keypoints.tolist() == [[1.0, 2.0, 0.5]]
    assert served.headers[-1]["x-analysis"] == "night"
    assert served.headers[-1]["content-type"] == "image/jpeg"


def test_the_secret_is_sent_and_told_to_nobody(
    model: Path,
    served: Serving,
    url: str,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    """Right secret: served. Wrong one: refused at once, without naming it. None: says where."""
    served.token = SECRET
    guarded = resource(url, token_env="FN_SECRET")  # noqa: S106 - a variable's name
    with pytest.raises(ConfigError, match="set the environment variable FN_SECRET"):
        opened(OnnxDetector(model), guarded).__enter__()
    monkeypatch.setenv("FN_SECRET", SECRET)
    with opened(OnnxDetector(model), guarded) as analysis:
        assert len(ask(analysis)) > 0
        served.mood = "500"
        with pytest.raises(EndpointError) as failure:
            ask(analysis)
    monkeypatch.setenv("FN_SECRET", "wrong" + SECRET)
    with pytest.raises(ConfigError, match="refuses our secret") as refusal:
        opened(OnnxDetector(model), guarded).__enter__()
    told = f"{failure.value} {refusal.value} {caplog.text} {guarded.model_dump_json()}"
    assert SECRET not in told


def test_a_model_that_does_not_fit_is_refused_before_the_mission(
    model: Path, url: str, tmp_path: Path, served: Serving
) -> None:
    """Another name, another input, another number of classes, an address of something else."""
    with pytest.raises(ModelError, match=r"no model 'yolo'.*endpoint\.models"):
        opened(OnnxDetector(model), resource(url, models={"lamps": "yolo"})).__enter__()
    boxes = np.repeat(np.array([[[20], [20], [9], [9], [0.05], [0.05]]], "f4"), 84, axis=2)
    few = OnnxDetector(constant_model(tmp_path / "few.onnx", [boxes]))
    with pytest.raises(ModelError, match="no output output0"):
        opened(few, resource(url, models={"lamps": "patchwork"})).__enter__()
    with pytest.raises(ModelError, match="no model"):
        opened(OnnxDetector(model), resource(f"{url}/elsewhere")).__enter__()
    function = resource(f"{url}/nothing", protocol="function")
    with pytest.raises(ConfigError, match="takes no JPEG by POST"):
        opened(OnnxDetector(model), function).__enter__()
    served.mood = "shape"
    with pytest.raises(ModelError, match="wrong shape"):
        opened(OnnxDetector(model), resource(url)).__enter__()


def test_only_what_fits_the_protocol_may_be_deployed() -> None:
    """An analysis without a model has no tensors to send, one without boxes no function."""

    class Brightness(Analytics[float]):
        produces = float

    with pytest.raises(GraphError, match="only an analysis with a model"):
        endpoint_analysis(Brightness(), "b", resource("http://127.0.0.1:1"), strict=True)
    function = resource("http://127.0.0.1:1", protocol="function")
    with pytest.raises(GraphError, match="not float"):
        endpoint_analysis(Brightness(), "b", function, strict=True)


@pytest.mark.parametrize(
    ("mood", "says"),
    [
        ("500", "status 500: as told"),
        ("404", "status 404"),
        ("503", r"busy \(status 503\) \(3 attempts\)"),
        ("garbage", "no reply of the inference protocol"),
        ("shape", "wrong shape"),
        ("redirect", "redirects elsewhere"),
    ],
)
def test_bad_answers_in_flight_cost_one_frame(
    model: Path, served: Serving, url: str, mood: str, says: str
) -> None:
    """Each is told with its reason; when the server is well again, so are we."""
    with opened(OnnxDetector(model), resource(url)) as analysis:
        served.mood = mood
        with pytest.raises(EndpointError, match=says):
            ask(analysis)
        served.mood = ""
        assert len(ask(analysis)) > 0


def test_a_lenient_analysis_goes_on_in_silence_but_says_so_once(
    model: Path, served: Serving, url: str, caplog: pytest.LogCaptureFixture
) -> None:
    """No result, no exception, one warning for any number of equal failures, a count at the end."""
    caplog.set_level(logging.WARNING, "aerodaas")
    with opened(OnnxDetector(model), resource(url), strict=False) as analysis:
        served.mood = "500"
        assert [ask(analysis) for _ in range(5)] == [None] * 5
        assert len(caplog.messages) == 1
    assert "of 5 frames sent, attempts failed: status 5" in caplog.messages[-1]


def test_a_busy_server_is_asked_again_only_while_there_is_time(
    model: Path, served: Serving, url: str
) -> None:
    """One attempt more if the deadline allows, none if not."""
    with opened(OnnxDetector(model), resource(url)) as analysis:
        served.mood = "busy once"
        assert len(ask(analysis, seconds=5.0)) > 0
        asked = served.seen["POST"]
        served.mood = "busy once"
        with pytest.raises(EndpointError, match=r"busy|in time"):
            ask(analysis, seconds=0.015)
        assert served.seen["POST"] <= asked + 1


def speaking(speak: Callable[[socket.socket], None]) -> tuple[str, socket.socket]:
    """A server that does as it likes with every connection."""
    listener = socket.create_server(("127.0.0.1", 0))

    def serve() -> None:
        while True:
            try:
                connection, _ = listener.accept()
            except OSError:
                return
            try:
                speak(connection)
            except OSError:
                continue

    threading.Thread(target=serve, daemon=True).start()
    return f"http://127.0.0.1:{listener.getsockname()[1]}", listener


def _drip(connection: socket.socket) -> None:
    connection.sendall(b"HTTP/1.1 200 OK\r\nContent-Length: 1000\r\n\r\n")
    stop = threading.Event()
    while not stop.wait(0.05):
        connection.sendall(b" ")


def _flood(connection: socket.socket) -> None:
    connection.sendall(b"HTTP/1.1 200 OK\r\nContent-Length: 999999999999\r\n\r\n")
    while True:
        connection.sendall(b" " * 2**20)


def _nonsense(connection: socket.socket) -> None:
    connection.sendall(b"SSH-2.0-OpenSSH_9.9\r\n")
    connection.close()


@pytest.mark.parametrize(
    ("speak", "kind"),
    [
        (lambda _: threading.Event().wait(30), "timeout"),
        (_drip, "timeout"),
        (_flood, "huge"),
        (_nonsense, "broken"),
    ],
)
def test_hanging_dripping_flooding_and_foreign_servers(
    model: Path, speak: Callable[[socket.socket], None], kind: str
) -> None:
    """None is waited for longer than allowed, none fills the memory; the mission may start."""
    address, listener = speaking(speak)
    analysis: Any = endpoint_analysis(
        OnnxDetector(model), "lamps", resource(address, timeout=1.0, retries=1), strict=True
    )
    analysis.open()
    with pytest.raises(EndpointError):
        ask(analysis, seconds=0.4 if kind == "timeout" else None)
    assert analysis._connection.failures[kind] > 0
    listener.close()


def test_nobody_listening_is_told_and_the_mission_may_start(
    model: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """A refused connection is a warning before the mission, and a lost frame in it."""
    caplog.set_level(logging.WARNING, "aerodaas")
    with opened(OnnxDetector(model), resource("http://127.0.0.1:9"), strict=False) as analysis:
        assert "cannot be reached" in caplog.text
        assert ask(analysis) is None


KINDS = ["f2", "f4", "f8", "u1", "i4", "i8", "?"]


@given(
    st.dictionaries(
        st.text(min_size=1, max_size=5),
        st.sampled_from(KINDS).flatmap(
            lambda kind: numpy_arrays(kind, array_shapes(max_dims=4, max_side=4))
        ),
        min_size=1,
        max_size=3,
    )
)
def test_tensors_come_back_as_they_went(tensors: dict[str, np.ndarray[Any, Any]]) -> None:
    """A request read as a reply gives the same tensors, to the bit."""
    body, headers = encode_request(tensors, [], binary=True)
    end = int(headers[HEADER_LENGTH])
    reply = json.dumps({"outputs": json.loads(body[:end])["inputs"]}).encode()
    found = decode_reply(reply + body[end:], str(len(reply)))
    assert found.keys() == tensors.keys()
    for name, array in tensors.items():
        assert found[name].dtype == array.dtype
        assert found[name].tobytes() == array.tobytes()


@given(st.binary(max_size=200), st.none() | st.text(max_size=5) | st.integers(-5, 300).map(str))
def test_garbage_is_an_endpoint_error_whatever_it_is(body: bytes, length: str | None) -> None:
    """Nothing but an EndpointError escapes the decoder."""
    with contextlib.suppress(EndpointError):
        decode_reply(body, length)
