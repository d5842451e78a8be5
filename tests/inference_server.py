"""A small inference server for tests: the Open Inference Protocol in front of onnxruntime."""

from __future__ import annotations

import json
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import onnxruntime as ort
import uvicorn
from fastapi import FastAPI, Request, Response

LENGTH = "inference-header-content-length"


class Serving:
    """One model; `mood` makes it misbehave. `seen` counts the requests by kind."""

    def __init__(self, path: Path | None = None, *, binary: bool = True, token: str = "") -> None:
        self.session = ort.InferenceSession(path) if path else None
        self.binary = binary
        self.token = token
        self.mood = ""
        self.seen: Counter[str] = Counter()
        self.connections: set[tuple[str, int]] = set()
        self.headers: list[dict[str, str]] = []
        self.app = FastAPI()
        self.app.middleware("http")(self._watch)
        self.app.get("/v2/models/{name}")(self.metadata)
        self.app.post("/v2/models/{name}/infer")(self.infer)
        self.app.post("/detect")(self.detect)

    async def _watch(self, request: Request, call_next: Any) -> Response:  # noqa: ANN401
        self.seen[request.method] += 1
        self.headers.append(dict(request.headers))
        if request.client is not None:
            self.connections.add((request.client.host, request.client.port))
        if self.token and request.headers.get("authorization") != f"Bearer {self.token}":
            return Response("who are you?", 401)
        made = self._moody()
        return made if made is not None else await call_next(request)

    def _moody(self) -> Response | None:
        if self.mood == "busy once":
            self.mood = ""
            return Response("later", 503)
        if self.mood == "garbage":
            return Response(b'{"outputs": [' * 100, media_type="application/json")
        if self.mood == "redirect":
            return Response(status_code=307, headers={"location": "/elsewhere"})
        if self.mood.isdigit():
            return Response("as told", int(self.mood))
        return None

    async def metadata(self, name: str) -> Any:  # noqa: ANN401
        """Describe the model."""
        if self.session is None or name != "patchwork":
            return Response('{"error": "unknown model"}', 404)

        def described(tensors: Any) -> list[dict[str, Any]]:  # noqa: ANN401
            shapes = [[a if isinstance(a, int) else -1 for a in t.shape] for t in tensors]
            return [
                {"name": tensor.name, "datatype": "FP32", "shape": shape}
                for tensor, shape in zip(tensors, shapes, strict=True)
            ]

        inputs, outputs = self.session.get_inputs(), self.session.get_outputs()
        return {
            "name": name,
            "platform": "onnxruntime",
            "inputs": described(inputs),
            "outputs": described(outputs),
        }

    async def infer(self, name: str, request: Request) -> Response:
        """Run the model."""
        assert self.session is not None
        body = await request.body()
        size = request.headers.get(LENGTH)
        self.seen["binary" if size else "json"] += 1
        if size and not self.binary:
            return Response("no binary tensors here", 400)
        head = json.loads(body[: int(size)] if size else body)
        (told,) = head["inputs"]
        if size:
            flat: Any = np.frombuffer(body[int(size) :], np.float32)
        else:
            flat = np.array(told["data"], np.float32)
        (found,) = self.session.run(None, {told["name"]: flat.reshape(told["shape"])})
        if self.mood == "shape":
            found = np.asarray(found)[:, :5]
        return self._reply(name, np.asarray(found), as_bytes=bool(size))

    def _reply(self, name: str, found: Any, *, as_bytes: bool) -> Response:  # noqa: ANN401
        output: dict[str, Any] = {"name": "output0", "datatype": "FP32", "shape": list(found.shape)}
        if not as_bytes:
            output["data"] = found.ravel().tolist()
            return Response(json.dumps({"model_name": name, "outputs": [output]}))
        output["parameters"] = {"binary_data_size": found.nbytes}
        head = json.dumps({"model_name": name, "outputs": [output]}).encode()
        data = head + found.tobytes()
        return Response(data, headers={LENGTH: str(len(head))})

    async def detect(self, request: Request) -> Any:  # noqa: ANN401
        """A plain function: the bright half of the picture is a `lamp`."""
        jpeg = np.frombuffer(await request.body(), np.uint8)
        image = cv2.imdecode(jpeg, cv2.IMREAD_COLOR)
        assert image is not None
        height, width = image.shape[:2]
        found = []
        if image[:, : width // 2].mean() > 200:
            box = [-5, 0, width / 2, height]
            found.append({"box": box, "label": "lamp", "score": 0.9, "keypoints": [[1, 2, 0.5]]})
            found.append({"box": [0, 0, 9, 9], "label": "moth", "score": 0.8})
            found.append({"box": [-9, -9, -1, -1], "label": "lamp", "score": 0.8})
        return {"detections": found, "model": "ignored"}


@contextmanager
def serving(served: Serving) -> Iterator[str]:
    """Serve on the loopback interface; yields the address."""
    config = uvicorn.Config(served.app, host="127.0.0.1", port=0, log_level="error")
    server = uvicorn.Server(config)
    thread = threading.Thread(target=server.run, daemon=True)
    thread.start()
    while not server.started:
        time.sleep(0.01)
    port = server.servers[0].sockets[0].getsockname()[1]
    try:
        yield f"http://127.0.0.1:{port}"
    finally:
        server.should_exit = True
        thread.join(10)
