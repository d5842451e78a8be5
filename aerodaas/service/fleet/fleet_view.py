"""The fleet as an account may see it."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any

from aerodaas.config.model import EnvironmentConfig, RobotConfig
from aerodaas.config.sections.actuators import permitted
from aerodaas.messages.health import HealthReport
from aerodaas.protocol.scenery import SceneryOut
from aerodaas.protocol.schemas import AccountOut, FleetOut, LinkState, RobotOut, VehicleReport
from aerodaas.service.access.principal import Principal, sees
from aerodaas.service.fleet.fleet_registry import FleetRegistry
from aerodaas.service.leases.lease_service import LeaseService
from aerodaas.service.mission_service import MissionService
from aerodaas.service.store import RobotState, Store

__all__ = ["FleetView"]


class FleetView:
    """The fleet as an account may see it."""

    def __init__(
        self,
        config: EnvironmentConfig,
        catalogue: dict[str, Any],
        actuators: Mapping[str, frozenset[str]],
        registry: FleetRegistry,
        leases: LeaseService,
        missions: MissionService,
        store: Store,
    ) -> None:
        """Show `catalogue`, and the drones of `config`; to a tenant its `actuators`."""
        self._store = store
        self._actuators = actuators
        self._config = config
        self._catalogue = catalogue
        self._registry = registry
        self._leases = leases
        self._missions = missions

    def account(self, principal: Principal) -> AccountOut:
        """The account that asks."""
        return AccountOut.model_validate(self._store.accounts.require(principal.account))

    def preflight(self, robot: str) -> HealthReport:
        """A robot's health before take-off; raises RefusedError for an unknown robot."""
        known = self._registry.preflight(robot)
        return self._missions.preflight(robot) or known

    def fleet_scenery(self) -> SceneryOut:
        """Ground below the fleet on a map; raises ConfigError if its world cannot be read."""
        return self._scenery

    @cached_property
    def _scenery(self) -> SceneryOut:
        return SceneryOut.of(self._config)

    def seen_by(self, principal: Principal) -> FleetOut:
        """The fleet as this account may see it."""
        states = self._registry.states
        robots = [self._robot(robot, states[robot.id], principal) for robot in self._config.robots]
        return FleetOut(
            name=self._config.name, robots=robots, environment=self._environment(principal)
        )

    def _environment(self, principal: Principal) -> dict[str, Any]:
        """The catalogue, with the actuators that this account's tenant may move."""
        names = self._actuators.get(principal.tenant, frozenset())
        moved = {
            robot.id: [
                one.model_dump(mode="json") for one in permitted(robot.id, robot.actuators, names)
            ]
            for robot in self._config.robots
        }
        robots = [{**one, "actuators": moved[one["id"]]} for one in self._catalogue["robots"]]
        return {**self._catalogue, "robots": robots}

    def _robot(self, robot: RobotConfig, state: RobotState, principal: Principal) -> RobotOut:
        lease = self._leases.holder(robot.id)
        news, ready = self._registry.report(robot.id), self._registry.preflight(robot.id)
        flying, shared = self._missions.shared(robot.id, principal.tenant)
        if principal.agent:
            shared = []
        mine = lease is not None and sees(principal, lease.tenant)
        # Only of a lease that this account sees.
        own = lease if mine else None
        heard = {"battery": state.battery, "position": state.position, "heard": state.heard}
        return RobotOut(
            **news.model_dump(include=set(VehicleReport.model_fields) - set(heard)),
            **heard,
            id=robot.id,
            sensors=[sensor.full_id for sensor in robot.sensors],
            lease=None if lease is None else lease.id,
            tenant=None if own is None else own.tenant,
            area=None if own is None or own.area is None else list(own.area),
            mission=flying if mine or shared else None,
            shared=shared,
            enabled=state.enabled,
            objection="" if flying is not None else self._registry.objection(robot.id),
            preflight=ready.verdict if news.link is LinkState.CONNECTED else None,
        )
