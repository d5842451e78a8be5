"""A provider whose API is asked as over HTTP, with tokens, limits and audit, and no socket."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from proposed import AGENT, OPERATOR, OTHER_AGENT, STRANGER, ProposedTo
from starlette.testclient import TestClient

from aerodaas.config.redaction import catalogue
from aerodaas.environment.provider import exchange
from aerodaas.environment.provider.client import ProviderClient
from aerodaas.protocol.schemas import TokenIn
from aerodaas.service.access.accounts import Access, Accounts
from aerodaas.service.access.audit import Audit
from aerodaas.service.app import build_app
from aerodaas.service.fleet.fleet_view import FleetView
from aerodaas.service.flights.folder import FlightFolder
from aerodaas.service.flights.orders import FlightOrder
from aerodaas.service.http.gate import Admission
from aerodaas.service.http.limits import PROVIDER, RequestLimits
from aerodaas.service.routes.fleet import FleetRoutes
from aerodaas.service.routes.missions import MissionRoutes, PilotingRoutes
from aerodaas.service.routes.proposals import ProposalRoutes
from aerodaas.service.routes.submissions import SubmissionRoutes
from aerodaas.service.store import AuditEntry

__all__ = ["ADDRESS", "AskedProvider"]

ADDRESS = "http://127.0.0.1:8400"


class AskedProvider(ProposedTo):
    """A provider with its API, asked by clients; what would command a drone is written down."""

    def __init__(
        self,
        folder: Path,
        monkeypatch: pytest.MonkeyPatch,
        *,
        limits: RequestLimits = PROVIDER,
        **settings: Any,  # noqa: ANN401
    ) -> None:
        self.flights: list[FlightOrder] = []
        """Orders of the flights that began; rehearsals are none."""
        super().__init__(folder, monkeypatch, **settings)
        audit, accounts = Audit(self.store), Accounts(self.store)
        self.missions.proposals.audit = lambda action, row, text: audit.write(
            None, action, row.id, f"{row.account}: {text}", accepted=True, required=False
        )
        admission = Admission(Access(self.store, audit), audit)
        config, actuators = self.settings.config, self.settings.actuators
        shown = catalogue(config).model_dump(mode="json", by_alias=True)
        fleet = FleetView(
            config, shown, actuators, self.registry, self.leases, self.missions, self.store
        )
        routes = (
            FleetRoutes(fleet, admission),
            MissionRoutes(self.missions, admission),
            SubmissionRoutes(self.missions, admission, audit),
            ProposalRoutes(self.missions.proposals, admission, audit),
            PilotingRoutes(self.missions, admission),
        )
        app = build_app(admission, [one.router() for one in routes], limits=limits)
        monkeypatch.setattr(exchange, "http_client", lambda *_, **__: TestClient(app))
        names = [one.account for one in (AGENT, OTHER_AGENT, STRANGER, OPERATOR)]
        self.tokens = {name: accounts.issue(TokenIn(account=name)).secret or "" for name in names}
        self._clients = {
            name: ProviderClient(ADDRESS, token) for name, token in self.tokens.items()
        }

    def client(self, account: str = AGENT.account) -> ProviderClient:
        """Client of an account."""
        return self._clients[account]

    def _start(self, folder: FlightFolder, *, tied: bool, vehicles: bool) -> Any:  # noqa: ANN401
        order = FlightOrder.read(folder.order)  # a rehearsal's is gone once there is another one
        self.flights += [] if order.rehearsal else [order]
        return super()._start(folder, tied=tied, vehicles=vehicles)

    def audited(self, account: str = AGENT.account) -> list[AuditEntry]:
        """Entries of the audit log about an account, the newest first."""
        return [one for one in self.store.audit.newest(1000) if one.account == account]
