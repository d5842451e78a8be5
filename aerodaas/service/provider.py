"""A provider's service: the API over its fleet, leases, accounts and flights."""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any

from fastapi import FastAPI

from aerodaas.config.extensions import service
from aerodaas.config.redaction import catalogue
from aerodaas.service.access.accounts import Access, Accounts
from aerodaas.service.access.audit import Audit
from aerodaas.service.access.oidc import OidcVerifier
from aerodaas.service.access.principal import Principal
from aerodaas.service.access.quotas import Quotas
from aerodaas.service.app import build_app
from aerodaas.service.edge import EdgeArbiter
from aerodaas.service.fleet.fleet_registry import FleetRegistry
from aerodaas.service.fleet.fleet_view import FleetView
from aerodaas.service.http.gate import Admission
from aerodaas.service.leases.lease_service import LeaseService
from aerodaas.service.live.playback import Player, Players
from aerodaas.service.mission_service import MissionService
from aerodaas.service.models.model_store import ModelStore
from aerodaas.service.models.model_trial import try_model
from aerodaas.service.monitor.process import FleetMonitor
from aerodaas.service.routes.accounts import AccountRoutes
from aerodaas.service.routes.fleet import FleetRoutes
from aerodaas.service.routes.here import HereRoutes
from aerodaas.service.routes.leases import LeaseRoutes
from aerodaas.service.routes.live import LiveRoutes
from aerodaas.service.routes.missions import MissionRoutes, PilotingRoutes, extension_routers
from aerodaas.service.routes.playback import PlaybackRoutes
from aerodaas.service.routes.proposals import ProposalRoutes
from aerodaas.service.routes.provisions import ProvisionRoutes
from aerodaas.service.routes.submissions import SubmissionRoutes
from aerodaas.service.settings import ServiceSettings
from aerodaas.service.store import Mission, Store

__all__ = ["build_service"]


def build_service(
    settings: ServiceSettings,
    store: Store,
    tell: Callable[[str], None] = lambda _: None,
    address: str = "",
) -> FastAPI:
    """Build the service; its missions move on while the application runs.

    Args:
        settings: Of the provider.
        store: Its open database.
        tell: Tells the provider's people of what they should look at.
        address: Where this machine reaches it without TLS, for the agents' endpoint.
    """
    audit = Audit(store)
    issuer = None if settings.oidc is None else OidcVerifier(settings.oidc)
    accounts, access = Accounts(store), Access(store, audit, tell, issuer=issuer)
    accounts.on_change = access.forget
    quotas, registry = Quotas(store), FleetRegistry(settings.config, store)
    models = ModelStore(settings.models, try_model)
    leases = LeaseService(settings.config, store, registry, quotas, settings.state / "clock")
    monitor = None
    if settings.monitor:
        monitor = FleetMonitor(
            settings.fleet, settings.state / "monitor.log", registry.record_reports
        )
    missions = MissionService(
        settings, store, leases=leases, registry=registry, models=models, monitor=monitor
    )

    def audit_proposal(action: str, proposal: Mission, text: str) -> None:
        told = f"{proposal.account}: {text}"
        audit.write(None, action, proposal.id, told, accepted=True, required=False)

    missions.proposals.audit = audit_proposal
    audit.approved_hash = missions.proposals.approved_hash
    admission = Admission(access, audit)
    shown: dict[str, Any] = catalogue(settings.config).model_dump(mode="json", by_alias=True)
    fleet = FleetView(settings.config, shown, settings.actuators, registry, leases, missions, store)
    players = Players()

    def player(principal: Principal, mission: str) -> Player:
        return players.of(mission, missions.file(principal, mission, "recording"))

    edge = None
    if settings.edge_slots is not None:
        edge = EdgeArbiter(settings.edge_turns, settings.edge_slots)

    @asynccontextmanager
    async def running() -> AsyncIterator[None]:
        missions.start()
        if edge is not None:
            edge.start()
        yield
        missions.close()
        if edge is not None:
            edge.close()

    routes = (
        FleetRoutes(fleet, admission),
        ProvisionRoutes(registry, models, admission, audit),
        LeaseRoutes(leases, admission, audit),
        MissionRoutes(missions, admission),
        SubmissionRoutes(missions, admission, audit),
        ProposalRoutes(missions.proposals, admission, audit),
        PilotingRoutes(missions, admission),
        PlaybackRoutes(player, admission),
        LiveRoutes(missions, admission),
        HereRoutes(missions, admission),
        AccountRoutes(accounts, store, admission, audit),
    )
    return build_app(
        admission,
        [*extension_routers(missions, admission), *(one.router() for one in routes)],
        tiles=settings.config.map_tiles,
        running=running,
        endpoint=service("agents.endpoint")(admission, settings, address)
        if settings.agents
        else None,
    )
