"""Web page of the cameras' live images, with detections and the mission state drawn in.

Each camera is a stream of JPEG images (`multipart/x-mixed-replace`), which every browser shows
without a script. Images are encoded only while a viewer is connected.
"""

from __future__ import annotations

import asyncio
import html
import threading
from collections.abc import AsyncIterator
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np
from fastapi import FastAPI, HTTPException
from fastapi.responses import HTMLResponse, StreamingResponse
from numpy.typing import NDArray
from typing_extensions import Self

from aerodaas.analytics.remote.guard import HostGuard
from aerodaas.analytics.remote.listening import listen
from aerodaas.analytics.remote.serving import web_server
from aerodaas.recording.report.overlay import draw_detections, draw_line
from aerodaas.types.data import Detection, Detections, Frame
from aerodaas.types.errors import ConfigError
from aerodaas.types.status import Message, MissionStatus

__all__ = ["CameraPage"]

_FRAMES_KEPT = 8
"""Frames kept per camera: detections arrive later than the frame that they are drawn into."""
_RATE = 10.0
"""Most images per second and viewer."""
_BOUNDARY = "picture"
_STOPPING = 5.0
_MOST_CONNECTIONS = 64


@dataclass
class _Camera:
    frames: dict[int, NDArray[np.uint8]] = field(default_factory=dict)
    """The newest images by timestamp."""
    found: dict[int, dict[str, tuple[Detection, ...]]] = field(default_factory=dict)
    """Detections in these images by timestamp and stream."""


class CameraPage:
    """Thread-safe web server of the camera page, fed with a run's messages."""

    def __init__(self, address: str) -> None:
        """Start the server.

        Args:
            address: `host:port` to listen on; port 0 selects a free one.

        Raises:
            ConfigError: If the address is malformed or cannot be listened on.
        """
        host, _, port = address.rpartition(":")
        if not host or not port.isdigit():
            raise ConfigError(f"the camera's page is served at host:port, not at {address!r}")
        try:
            self._socket = listen(host.strip("[]"), int(port))
        except (OSError, OverflowError) as error:
            raise ConfigError(
                f"cannot serve the camera's page at {address}: {error}; give another --view-address"
            ) from None
        self.port: int = self._socket.getsockname()[1]
        """Port that the server listens on."""
        self._cameras: dict[str, _Camera] = {}
        self._states: dict[str, str] = {}
        self._lock = threading.Lock()
        self._server = web_server(
            HostGuard(self._app(), host),
            most_connections=_MOST_CONNECTIONS,
            lifespan="off",
            timeout_graceful_shutdown=1,
        )
        words = {"sockets": [self._socket]}
        self._thread = threading.Thread(target=self._server.run, kwargs=words, daemon=True)
        self._thread.start()

    def put(self, message: Message[Any]) -> None:
        """Store a frame, detections or a mission status; other messages are ignored."""
        item, source = message.item, message.header.source
        with self._lock:
            if isinstance(item, Frame):
                camera = self._cameras.setdefault(source, _Camera())
                # A copy, so that the frame's shared memory is free for the next ones.
                camera.frames[item.header.stamp] = np.array(item.image)
                while len(camera.frames) > _FRAMES_KEPT:
                    oldest = min(camera.frames)
                    camera.frames.pop(oldest)
                    camera.found.pop(oldest, None)
            elif isinstance(item, Detections) and source in self._cameras:
                camera = self._cameras[source]
                if item.header.stamp in camera.frames:
                    found = camera.found.setdefault(item.header.stamp, {})
                    found[message.stream] = tuple(item)
            elif isinstance(item, MissionStatus):
                reason = f": {item.reason}" if item.reason else ""
                text = f"{item.stamp / 1e9:.1f} s  {item.state.value}{reason}"
                self._states[source.partition("/")[0]] = text

    def picture(self, source: str) -> NDArray[np.uint8] | None:
        """Return a camera's newest analysed image, detections drawn in, or else its newest image.

        Args:
            source: Stream of the camera.

        Returns:
            The image, BGR; None before the first frame.
        """
        with self._lock:
            camera = self._cameras.get(source)
            if camera is None or not camera.frames:
                return None
            stamp = max(camera.found or camera.frames)
            image: NDArray[np.uint8] = camera.frames[stamp].copy()
            found = [one for items in camera.found.get(stamp, {}).values() for one in items]
            state = self._states.get(source.partition("/")[0], "")
        draw_detections(image, found)
        if state:
            draw_line(image, state)
        return image

    def close(self) -> None:
        """Stop serving."""
        self._server.should_exit = True
        self._thread.join(_STOPPING)
        self._socket.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _app(self) -> FastAPI:
        app = FastAPI(title="AeroDaaS cameras", docs_url=None, redoc_url=None, openapi_url=None)
        app.add_api_route("/", self._page, response_class=HTMLResponse)
        app.add_api_route("/camera/{source:path}", self._stream, response_class=StreamingResponse)
        return app

    async def _page(self) -> HTMLResponse:
        with self._lock:
            names = [html.escape(name, quote=True) for name in sorted(self._cameras)]
        figures = "".join(
            f'<figure><img src="/camera/{name}" alt=""><figcaption>{name}</figcaption></figure>'
            for name in names
        )
        # Cameras are listed from their first image on; the page reloads until there is one.
        again = "" if names else '<meta http-equiv="refresh" content="1"><p>no picture yet</p>'
        style = "body{font:14px sans-serif;background:#111;color:#ddd}img{max-width:100%}"
        return HTMLResponse(
            f"<!doctype html><title>AeroDaaS</title><style>{style}</style>{again}{figures}"
        )

    async def _stream(self, source: str) -> StreamingResponse:
        if source not in self._cameras:
            raise HTTPException(404, f"no camera is called {source}")
        kind = f"multipart/x-mixed-replace; boundary={_BOUNDARY}"
        return StreamingResponse(self._parts(source), media_type=kind)

    async def _parts(self, source: str) -> AsyncIterator[bytes]:
        while not self._server.should_exit:
            image = self.picture(source)
            if image is not None:
                data = cv2.imencode(".jpg", image)[1].tobytes()
                head = f"--{_BOUNDARY}\r\nContent-Type: image/jpeg\r\n"
                yield f"{head}Content-Length: {len(data)}\r\n\r\n".encode() + data + b"\r\n"
            await asyncio.sleep(1 / _RATE)
