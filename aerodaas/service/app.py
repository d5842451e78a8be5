"""The API as one ASGI application, whatever missions stand behind it."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractAsyncContextManager, asynccontextmanager, nullcontext

import anyio.to_thread
from fastapi import APIRouter, FastAPI

from aerodaas.config.map_tiles import MapTilesConfig
from aerodaas.service.http.admission import Admission
from aerodaas.service.http.gate import Bounds, Gate
from aerodaas.service.http.map_archive import archive_routes
from aerodaas.service.http.page import page_routes
from aerodaas.service.http.refusals import register_refusals

__all__ = ["build_app"]

_BOUNDS = Bounds()
_THREADS = 200
"""Most threads that answer requests, and most that look whether lasting ones still may be: more
than all users but those with a reserve may keep busy, see `Bounds`."""


def build_app(
    admission: Admission,
    routers: Sequence[APIRouter],
    *,
    bounds: Bounds = _BOUNDS,
    tiles: MapTilesConfig | None = None,
    framed: bool = False,
    running: Callable[[], AbstractAsyncContextManager[None]] = nullcontext,
) -> FastAPI:
    """Build the application: the page, and the routes that it and other clients ask.

    Args:
        admission: Admits each request.
        routers: Routes of the API.
        bounds: Bounds of who may ask how much at once.
        tiles: Map below the page's drones.
        framed: Whether a page of this machine, such as a notebook, may hold the page in a frame.
        running: Makes the context that is entered while the application runs.

    Raises:
        ConfigError: If `tiles` name a file that is no archive of pictures.
    """

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        anyio.to_thread.current_default_thread_limiter().total_tokens = _THREADS
        asyncio.get_running_loop().set_default_executor(ThreadPoolExecutor(_THREADS, "service"))
        async with running():
            yield

    app = FastAPI(
        title="AeroDaaS",
        version="1",
        docs_url=None,
        redoc_url=None,
        redirect_slashes=False,
        lifespan=lifespan,
        openapi_url="/v1/openapi.json",
    )
    register_refusals(app)
    for router in (*routers, page_routes(framed=framed, tiles=tiles), archive_routes(tiles)):
        app.include_router(router)
    app.add_middleware(Gate, admission=admission, bounds=bounds)
    return app
