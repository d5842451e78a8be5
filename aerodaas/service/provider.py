"""A provider's service: the API over its fleet, leases, accounts and flights."""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any

from fastapi import FastAPI

from aerodaas.config.redaction import catalogue
from aerodaas.service.access.accounts import Access, Accounts
from aerodaas.service.access.audit import Audit
from aerodaas.service.access.oidc import OidcVerifier
from aerodaas.service.access.principal import Principal
from aerodaas.service.access.quotas import Quotas
from aerodaas.service.app import build_app
from aerodaas.service.bookings import Bookings
from aerodaas.service.desk import MissionDesk
from aerodaas.service.edge import EdgeArbiter
from aerodaas.service.fleet_view import FleetView
from aerodaas.service.garage import Garage
from aerodaas.service.http.gate import Admission
from aerodaas.service.live.playback import Player, Players
from aerodaas.service.model_trial import try_model
from aerodaas.service.models import ModelShelf
from aerodaas.service.monitor.process import FleetMonitor
from aerodaas.service.routes.accounts import AccountRoutes
from aerodaas.service.routes.fleet import FleetRoutes
from aerodaas.service.routes.here import HereRoutes
from aerodaas.service.routes.leases import LeaseRoutes
from aerodaas.service.routes.live import LiveRoutes
from aerodaas.service.routes.missions import MissionRoutes, PilotingRoutes
from aerodaas.service.routes.playback import PlaybackRoutes
from aerodaas.service.routes.provisions import ProvisionRoutes
from aerodaas.service.routes.submissions import SubmissionRoutes
from aerodaas.service.settings import ServiceSettings
from aerodaas.service.store import Store

__all__ = ["build_service"]


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
    admission = Admission(access, audit)
    shown: dict[str, Any] = catalogue(settings.config).model_dump(mode="json", by_alias=True)
    fleet = FleetView(settings.config, shown, settings.actuators, garage, bookings, desk, accounts)
    players = Players()

    def player(principal: Principal, mission: str) -> Player:
        return players.of(mission, desk.file(principal, mission, "recording"))

    edge = None
    if settings.edge_slots is not None:
        edge = EdgeArbiter(settings.edge_turns, settings.edge_slots)

    @asynccontextmanager
    async def running() -> AsyncIterator[None]:
        desk.start()
        if edge is not None:
            edge.start()
        yield
        desk.close()
        if edge is not None:
            edge.close()

    routes = (
        FleetRoutes(fleet, admission),
        ProvisionRoutes(garage, models, admission, audit),
        LeaseRoutes(bookings, admission, audit),
        MissionRoutes(desk, admission),
        SubmissionRoutes(desk, admission, audit),
        PilotingRoutes(desk, admission),
        PlaybackRoutes(player, admission),
        LiveRoutes(desk, admission),
        HereRoutes(desk, admission),
        AccountRoutes(accounts, store, admission, audit),
    )
    return build_app(
        admission,
        [one.router() for one in routes],
        tiles=settings.config.map_tiles,
        running=running,
    )
