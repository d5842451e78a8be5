"""What a provider adds to its fleet: drones in and out of service, and users' models."""

from __future__ import annotations

import asyncio
from typing import Any

from fastapi import APIRouter, Request, Response
from pydantic import BaseModel, ConfigDict

from aerodaas.protocol.schemas import Role, Scope
from aerodaas.service.access.audit import Audit
from aerodaas.service.errors import RefusedError
from aerodaas.service.fleet.fleet_registry import FleetRegistry
from aerodaas.service.http.bodies import api_router
from aerodaas.service.http.gate import Admission
from aerodaas.service.http.limits import RequestLimits
from aerodaas.service.models.model_store import ModelStore

__all__ = ["ProvisionRoutes"]


class RobotIn(BaseModel):
    """Change of one robot."""

    model_config = ConfigDict(extra="forbid")

    enabled: bool


class ProvisionRoutes:
    """Routes `/v1/robots/{id}` and `/v1/models`."""

    def __init__(
        self, registry: FleetRegistry, models: ModelStore, admission: Admission, audit: Audit
    ) -> None:
        """Change these."""
        self._registry = registry
        self._models = models
        self._admission = admission
        self._audit = audit

    def router(self) -> APIRouter:
        """The routes."""
        router = api_router("/v1", "fleet")
        none: dict[str, Any] = {"status_code": 204, "response_class": Response}
        router.add_api_route("/robots/{robot}", self.enable, methods=["PATCH"], **none)
        router.add_api_route("/models/{sha256}", self.has_model, methods=["HEAD"], **none)
        router.add_api_route("/models/{sha256}", self.put_model, methods=["PUT"], **none)
        return router

    def enable(self, robot: str, body: RobotIn, request: Request) -> Response:
        """Put a drone into service, or take it out."""
        principal = self._admission.require(request, Role.OPERATOR)
        self._registry.enable(robot, enabled=body.enabled)
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
            if len(content) > RequestLimits.model_bytes:
                raise RefusedError(
                    413, f"a model has at most {RequestLimits.model_bytes >> 20} MiB"
                )
        # A large one takes a while to be hashed and written, and others do not wait for it.
        await asyncio.to_thread(self._models.put, principal.tenant, sha256, bytes(content))
        self._audit.write(principal, "model.put", sha256, f"{len(content)} bytes", accepted=True)
        return Response(status_code=204)
