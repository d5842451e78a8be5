"""A detector's network behind Ray Serve: a server that is not ours, before which ours holds."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fastapi import FastAPI
from inference_server import Serving
from synthetic_models import patchwork_model

from aerodaas.analytics.detection.detector import OnnxDetector
from aerodaas.analytics.endpoint.analysis import endpoint_analysis
from aerodaas.config.model import ComputeConfig
from aerodaas.messages.frames import Frame, Header

# Ray Serve's own declarations are of an older Pydantic.
pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore::DeprecationWarning"),
    pytest.mark.wall_clock,
]

PICTURE = np.full((360, 640, 3), 250, np.uint8)
PICTURE[:, 320:] = 10
FRAME = Frame(Header(7, 8, "drone/camera"), PICTURE)


class Here:
    """A context without a deadline."""

    kind = "edge"


def app_of(model: Path) -> FastAPI:
    """Make the protocol's routes, in the replica."""
    return Serving(model).app


@pytest.fixture
def model(tmp_path: Path) -> Path:
    """A model whose boxes depend on the picture."""
    return patchwork_model(tmp_path / "patchwork.onnx")


@pytest.fixture
def url(runtime: None, model: Path) -> Iterator[str]:  # noqa: ARG001 - Serve runs on Ray
    """Where Ray Serve answers for the model."""
    from ray import serve  # noqa: PLC0415 - takes long
    from ray.serve.config import HTTPOptions  # noqa: PLC0415

    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]

    class Replica:
        """Routes alone."""

    ingress: Any = serve.ingress(lambda: app_of(model))(Replica)
    deployment: Any = serve.deployment(ingress, ray_actor_options={"num_cpus": 0.1})
    serve.start(http_options=HTTPOptions(host="127.0.0.1", port=port))
    try:
        serve.run(deployment.bind())
        yield f"http://127.0.0.1:{port}"
    finally:
        serve.shutdown()


def test_it_finds_the_same_there_as_here(model: Path, url: str) -> None:
    """As binary tensors of the Open Inference Protocol, and as a function URL."""
    at_home = OnnxDetector(model)
    at_home.open()
    (expected,) = at_home.detect([FRAME])
    for protocol in ("v2", "function"):
        told = {"url": f"{url}/detect" if protocol == "function" else url, "protocol": protocol}
        there = ComputeConfig.model_validate(
            {"id": "fn", "kind": "http", "executors": 2, "endpoint": {**told, "timeout": 20.0}}
        )
        analysis = endpoint_analysis(OnnxDetector(model), "lamps", there, strict=True)
        analysis.open()
        found = analysis.process(FRAME, Here())  # type: ignore[arg-type]
        assert found is not None
        analysis.close()
        if protocol == "v2":
            assert found.items == expected.items
        else:
            assert [item.label for item in found.items] == ["lamp", "moth"]
