"""The fleet, the account that asks, and the models that users bring."""

from __future__ import annotations

import asyncio
from typing import Any

from fastapi import APIRouter, Request, Response
from pydantic import BaseModel, ConfigDict

from aerodaas.protocol.preflight import PreflightOut
from aerodaas.protocol.scenery import SceneryOut
from aerodaas.protocol.schemas import AccountOut, FleetOut, Role, Scope
from aerodaas.service.access import Accounts, Audit
from aerodaas.service.errors import RefusedError
from aerodaas.service.fleet_view import FleetView
from aerodaas.service.garage import Garage
from aerodaas.service.models import LARGEST_MODEL, ModelShelf
from aerodaas.service.routes.admission import Admission
from aerodaas.service.routes.bodies import BoundedRoute

__all__ = ["FleetRoutes"]


class RobotIn(BaseModel):
    """Change of one robot."""

    model_config = ConfigDict(extra="forbid")

    enabled: bool


class FleetRoutes:
    """Routes `/v1/me`, `/v1/fleet`, `/v1/robots` and `/v1/models`."""

    def __init__(
        self,
        fleet: FleetView,
        garage: Garage,
        models: ModelShelf,
        accounts: Accounts,
        admission: Admission,
        audit: Audit,
    ) -> None:
        """Answer from these."""
        self._fleet = fleet
        self._garage = garage
        self._models = models
        self._accounts = accounts
        self._admission = admission
        self._audit = audit

    def router(self) -> APIRouter:
        """The routes."""
        router = APIRouter(prefix="/v1", tags=["fleet"], route_class=BoundedRoute)
        none: dict[str, Any] = {"status_code": 204, "response_class": Response}
        router.add_api_route("/me", self.me)
        router.add_api_route("/fleet", self.fleet)
        router.add_api_route("/fleet/scenery", self.scenery)
        router.add_api_route("/robots/{robot}", self.enable, methods=["PATCH"], **none)
        router.add_api_route("/robots/{robot}/preflight", self.preflight)
        router.add_api_route("/models/{sha256}", self.has_model, methods=["HEAD"], **none)
        router.add_api_route("/models/{sha256}", self.put_model, methods=["PUT"], **none)
        return router

    def me(self, request: Request) -> AccountOut:
        """The account that asks."""
        principal = self._admission.require(request, Role.VIEWER)
        return self._accounts.get(principal.account)

    def fleet(self, request: Request) -> FleetOut:
        """The drones, and the environment that applications are built against."""
        return self._fleet.seen_by(self._admission.require(request, Role.VIEWER))

    def scenery(self, request: Request) -> SceneryOut:
        """What lies below the fleet on a map."""
        self._admission.require(request, Role.VIEWER)
        return self._fleet.scenery

    def preflight(self, robot: str, request: Request) -> PreflightOut:
        """A drone's health before take-off, to whoever sees its charge and place."""
        self._admission.require(request, Role.VIEWER)
        return self._garage.preflight(robot)

    def enable(self, robot: str, body: RobotIn, request: Request) -> Response:
        """Put a drone into service, or take it out."""
        principal = self._admission.require(request, Role.OPERATOR)
        self._garage.enable(robot, enabled=body.enabled)
        self._audit.write(principal, "robot.enable", robot, str(body.enabled), accepted=True)
        return Response(status_code=204)

    def has_model(self, sha256: str, request: Request) -> Response:
        """Whether the tenant has a model here."""
        tenant = self._admission.require(request, Role.VIEWER).tenant
        if not self._models.has(tenant, sha256):
            raise RefusedError(404, f"{tenant} has no model {sha256} here")
        return Response(status_code=204)

    async def put_model(self, sha256: str, request: Request) -> Response:
        """Bring a model, an ONNX file of at most 64 MiB, named by its SHA-256."""
        principal = self._admission.require(request, Role.PILOT, Scope.COMPUTE)
        content = bytearray()
        async for part in request.stream():
            content += part
            if len(content) > LARGEST_MODEL:
                raise RefusedError(413, f"a model has at most {LARGEST_MODEL >> 20} MiB")
        # A large one takes a while to be hashed and written, and others do not wait for it.
        await asyncio.to_thread(self._models.put, principal.tenant, sha256, bytes(content))
        self._audit.write(principal, "model.put", sha256, f"{len(content)} bytes", accepted=True)
        return Response(status_code=204)
