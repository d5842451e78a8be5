"""The fleet, and the account that asks."""

from __future__ import annotations

from fastapi import APIRouter, Request

from aerodaas.messages.health import HealthReport
from aerodaas.protocol.scenery import SceneryOut
from aerodaas.protocol.schemas import AccountOut, FleetOut, Role
from aerodaas.service.backend import Fleet
from aerodaas.service.http.bodies import api_router
from aerodaas.service.http.gate import Admission

__all__ = ["FleetRoutes"]


class FleetRoutes:
    """Routes `/v1/me`, `/v1/fleet` and `/v1/robots/{id}/preflight`."""

    def __init__(self, fleet: Fleet, admission: Admission) -> None:
        """Answer from `fleet`."""
        self._fleet = fleet
        self._admission = admission

    def router(self) -> APIRouter:
        """The routes."""
        router = api_router("/v1", "fleet")
        router.add_api_route("/me", self.me)
        router.add_api_route("/fleet", self.fleet)
        router.add_api_route("/fleet/scenery", self.scenery)
        router.add_api_route("/robots/{robot}/preflight", self.preflight)
        return router

    def me(self, request: Request) -> AccountOut:
        """The account that asks."""
        return self._fleet.account(self._admission.require(request, Role.VIEWER, agents=True))

    def fleet(self, request: Request) -> FleetOut:
        """The drones, and the environment that applications are built against."""
        return self._fleet.seen_by(self._admission.require(request, Role.VIEWER, agents=True))

    def scenery(self, request: Request) -> SceneryOut:
        """Scenery below the fleet on a map."""
        self._admission.require(request, Role.VIEWER, agents=True)
        return self._fleet.fleet_scenery()

    def preflight(self, robot: str, request: Request) -> HealthReport:
        """A drone's health before take-off, to whoever sees its charge and place."""
        self._admission.require(request, Role.VIEWER, agents=True)
        return self._fleet.preflight(robot)
