"""The service as one ASGI application, from its settings."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager
from typing import Any

import anyio.to_thread
from fastapi import FastAPI, Security
from fastapi.security import HTTPBearer

from aerodaas.config.redaction import catalogue
from aerodaas.console.hub import StreamHub
from aerodaas.console.map_archive import archive_routes
from aerodaas.console.page import page_routes
from aerodaas.service.access import Access, Accounts, Audit, OidcVerifier, Quotas, RateLimiter
from aerodaas.service.bookings import Bookings
from aerodaas.service.desk import MissionDesk
from aerodaas.service.edge import EdgeArbiter
from aerodaas.service.fleet_view import FleetView
from aerodaas.service.garage import Garage
from aerodaas.service.gate import Gate
from aerodaas.service.model_trial import try_model
from aerodaas.service.models import ModelShelf
from aerodaas.service.monitor.process import FleetMonitor
from aerodaas.service.routes.accounts import AccountRoutes
from aerodaas.service.routes.admission import Admission
from aerodaas.service.routes.fleet import FleetRoutes
from aerodaas.service.routes.here import HereRoutes
from aerodaas.service.routes.leases import LeaseRoutes
from aerodaas.service.routes.live import LiveRoutes
from aerodaas.service.routes.missions import MissionRoutes
from aerodaas.service.routes.piloting import PilotingRoutes
from aerodaas.service.routes.refusals import REFUSALS, register_refusals
from aerodaas.service.settings import ServiceSettings
from aerodaas.service.store import Store

__all__ = ["build_service"]

_RATE = 50.0
"""Requests a second of one account, on average."""
_BURST = 200.0
_THREADS = 200
"""Most threads that answer requests, and most that look whether lasting ones still may be."""


def build_service(
    settings: ServiceSettings, store: Store, tell: Callable[[str], None] = lambda _: None
) -> FastAPI:
    """Build the service; its missions move on while the application runs.

    Args:
        settings: Of the provider.
        store: Its open database.
        tell: Tells the provider's people of what they should look at.
    """
    audit = Audit(store)
    issuer = None if settings.oidc is None else OidcVerifier(settings.oidc)
    accounts, access = Accounts(store), Access(store, audit, tell, issuer=issuer)
    accounts.on_change = access.forget
    quotas, garage = Quotas(store), Garage(settings.config, store)
    models = ModelShelf(settings.models, try_model)
    bookings = Bookings(settings.config, store, garage, quotas, settings.state / "clock")
    monitor = None
    if settings.monitor:
        monitor = FleetMonitor(settings.fleet, settings.state / "monitor.log", garage.observe)
    desk = MissionDesk(
        settings, store, bookings=bookings, garage=garage, models=models, monitor=monitor
    )
    hub = StreamHub(desk.items)
    admission = Admission(access, audit, RateLimiter(_RATE, _BURST))
    shown: dict[str, Any] = catalogue(settings.config).model_dump(mode="json", by_alias=True)
    fleet = FleetView(settings.config, shown, settings.actuators, garage, bookings, desk)

    edge = None
    if settings.edge_slots is not None:
        edge = EdgeArbiter(settings.edge_turns, settings.edge_slots)

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        # More than all users but operators may keep busy, see `Gate`.
        anyio.to_thread.current_default_thread_limiter().total_tokens = _THREADS
        asyncio.get_running_loop().set_default_executor(ThreadPoolExecutor(_THREADS, "service"))
        desk.start()
        if edge is not None:
            edge.start()
        yield
        desk.close()
        if edge is not None:
            edge.close()

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
    # The gate has looked at the token by then; this tells the schema's readers of it.
    secured = [Security(HTTPBearer(auto_error=False))]
    for routes in (
        FleetRoutes(fleet, garage, models, accounts, admission, audit),
        LeaseRoutes(bookings, admission, audit),
        MissionRoutes(desk, admission, audit),
        AccountRoutes(accounts, store, admission, audit),
    ):
        app.include_router(routes.router(), dependencies=secured, responses=REFUSALS)
    app.include_router(PilotingRoutes(desk, admission, audit).router(), responses=REFUSALS)
    app.include_router(LiveRoutes(desk, hub, admission).router())
    app.include_router(HereRoutes(desk, admission).router())
    app.include_router(page_routes(tiles=settings.config.map_tiles))
    app.include_router(archive_routes(settings.config.map_tiles))
    app.add_middleware(Gate, admission=admission)
    return app
