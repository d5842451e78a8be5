"""The fleet, the account that asks, and the models that users bring."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Depends, Request, Response
from pydantic import BaseModel, ConfigDict

from aerodaas.config.model import EnvironmentConfig
from aerodaas.service.access import Accounts, Audit, Principal, sees
from aerodaas.service.bookings import Bookings
from aerodaas.service.desk import MissionDesk
from aerodaas.service.errors import RefusedError
from aerodaas.service.garage import Garage
from aerodaas.service.models import LARGEST_MODEL, ModelShelf
from aerodaas.service.routes.admission import Admission
from aerodaas.service.schemas import AccountOut, FleetOut, RobotOut, Role, Scope

__all__ = ["FleetView", "fleet_router"]


class RobotIn(BaseModel):
    """Change of one robot."""

    model_config = ConfigDict(extra="forbid")

    enabled: bool


class FleetView:
    """The fleet as an account may see it."""

    def __init__(
        self,
        config: EnvironmentConfig,
        catalogue: dict[str, Any],
        garage: Garage,
        bookings: Bookings,
        desk: MissionDesk,
    ) -> None:
        """Show `catalogue`, and the drones of `config`."""
        self._config = config
        self._catalogue = catalogue
        self._garage = garage
        self._bookings = bookings
        self._desk = desk

    def seen_by(self, principal: Principal) -> FleetOut:
        """The fleet as this account may see it."""
        robots = [self._robot(robot.id, principal) for robot in self._config.robots]
        return FleetOut(name=self._config.name, robots=robots, environment=self._catalogue)

    def _robot(self, name: str, principal: Principal) -> RobotOut:
        state, lease = self._garage.states[name], self._bookings.holder(name)
        config = next(robot for robot in self._config.robots if robot.id == name)
        mine = lease is not None and sees(principal, lease.tenant)
        return RobotOut(
            id=name,
            sensors=[sensor.full_id for sensor in config.sensors],
            lease=None if lease is None else lease.id,
            tenant=lease.tenant if lease is not None and mine else None,
            mission=self._desk.flying(name) if mine else None,
            battery=state.battery,
            position=state.position,
            heard=state.heard,
            enabled=state.enabled,
        )


def fleet_router(
    fleet: FleetView,
    garage: Garage,
    models: ModelShelf,
    accounts: Accounts,
    admission: Admission,
    audit: Audit,
) -> APIRouter:
    """Routes `/v1/me`, `/v1/fleet`, `/v1/robots` and `/v1/models`."""
    router = APIRouter(prefix="/v1")
    viewer = Depends(admission.needs(Role.VIEWER))
    pilot = Depends(admission.needs(Role.PILOT, Scope.COMPUTE))
    operator = Depends(admission.needs(Role.OPERATOR))

    @router.get("/me", tags=["accounts"])
    def me(principal: Annotated[Principal, viewer]) -> AccountOut:
        """The account that asks."""
        return accounts.get(principal.account)

    @router.get("/fleet", tags=["fleet"])
    def whole(principal: Annotated[Principal, viewer]) -> FleetOut:
        """The drones, and the environment that applications are built against."""
        return fleet.seen_by(principal)

    @router.patch("/robots/{robot}", tags=["fleet"], status_code=204)
    def enable(robot: str, body: RobotIn, principal: Annotated[Principal, operator]) -> Response:
        """Put a drone into service, or take it out."""
        garage.enable(robot, enabled=body.enabled)
        audit.write(principal, "robot.enable", robot, str(body.enabled), accepted=True)
        return Response(status_code=204)

    @router.head("/models/{sha256}", tags=["models"], status_code=204)
    def has_model(sha256: str, principal: Annotated[Principal, viewer]) -> Response:  # noqa: ARG001
        """Whether a model is here."""
        return Response(status_code=204 if models.has(sha256) else 404)

    @router.put("/models/{sha256}", tags=["models"], status_code=204)
    async def put_model(
        sha256: str, request: Request, principal: Annotated[Principal, pilot]
    ) -> Response:
        """Bring a model, an ONNX file of at most 64 MiB, named by its SHA-256."""
        content = bytearray()
        async for part in request.stream():
            content += part
            if len(content) > LARGEST_MODEL:
                raise RefusedError(413, f"a model has at most {LARGEST_MODEL >> 20} MiB")
        models.put(sha256, bytes(content))
        audit.write(principal, "model.put", sha256, f"{len(content)} bytes", accepted=True)
        return Response(status_code=204)

    return router
