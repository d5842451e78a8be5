"""The API as one ASGI application, whatever missions stand behind it."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractAsyncContextManager, asynccontextmanager, nullcontext
from dataclasses import dataclass

import anyio.to_thread
from fastapi import APIRouter, FastAPI
from starlette.routing import Route
from starlette.types import ASGIApp

from aerodaas.config.sections.place import MapTilesConfig
from aerodaas.service.http.gate import Admission, LimitsMiddleware
from aerodaas.service.http.limits import PROVIDER, RequestLimits
from aerodaas.service.http.map_archive import archive_routes
from aerodaas.service.http.page import page_routes
from aerodaas.service.http.refusals import register_refusals

__all__ = ["Endpoint", "build_app"]


@dataclass(frozen=True)
class Endpoint:
    """Another protocol at a path of the API's own address, under the same limits and tokens."""

    path: str
    app: ASGIApp
    """Answers each request for the path whose sender was admitted."""
    before: Callable[[ASGIApp], ASGIApp]
    """Makes the middleware before all else: what needs no token, and headers of refusals."""
    running: Callable[[], AbstractAsyncContextManager[None]]
    """Makes the context that is entered while the application runs."""


def build_app(
    admission: Admission,
    routers: Sequence[APIRouter],
    *,
    limits: RequestLimits = PROVIDER,
    tiles: MapTilesConfig | None = None,
    framed: bool = False,
    running: Callable[[], AbstractAsyncContextManager[None]] = nullcontext,
    endpoint: Endpoint | None = None,
) -> FastAPI:
    """Build the application: the page, and the routes that it and other clients ask.

    Args:
        admission: Admits each request.
        routers: Routes of the API.
        limits: Limits of requests.
        tiles: Map below the page's drones.
        framed: Whether a page of this machine, such as a notebook, may hold the page in a frame.
        running: Makes the context that is entered while the application runs.
        endpoint: Another protocol beside the API; None for none.

    Raises:
        ConfigError: If `tiles` name a file that is no archive of pictures.
    """

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        # One pool answers requests, the other looks whether live views may stay.
        anyio.to_thread.current_default_thread_limiter().total_tokens = limits.threads
        executor = ThreadPoolExecutor(limits.threads, "service")
        asyncio.get_running_loop().set_default_executor(executor)
        async with running(), nullcontext() if endpoint is None else endpoint.running():
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
    app.add_middleware(LimitsMiddleware, admission=admission, limits=limits)
    if endpoint is not None:
        app.router.routes.append(Route(endpoint.path, endpoint.app))
        app.add_middleware(endpoint.before)
    return app
