"""Orders of a flight and their outcome: what the service and the flight's process write down."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from pydantic import BaseModel, ConfigDict, Field

from aerodaas.clock import WallOffset
from aerodaas.config.checked import checked
from aerodaas.config.options import EdgeShare
from aerodaas.config.plugins import require_plugin
from aerodaas.dataflow.mission_document import MissionDocument
from aerodaas.messages.mission import Place, RobotStatus
from aerodaas.protocol.schemas import (
    Area,
    Positive,
    Role,
    Scope,
    SilencePolicy,
    VerdictOut,
)
from aerodaas.service.access.principal import Principal, require
from aerodaas.service.errors import RefusedError
from aerodaas.text.json_text import read_json

if TYPE_CHECKING:
    from aerodaas.service.fleet.fleet_registry import FleetRegistry
    from aerodaas.service.leases.lease_service import LeaseService
    from aerodaas.service.settings import ServiceSettings
    from aerodaas.service.store import Lease, Mission, Store

__all__ = [
    "FlightOrder",
    "FlightOrders",
    "HostFlight",
    "OtherLease",
    "Outcome",
    "TenantLimits",
    "actuators_of",
    "robots_of",
]


@dataclass(frozen=True)
class TenantLimits:
    """Limits of a tenant, on top of the provider's; None for no further limit."""

    max_height: Positive | None = None
    """Metres above home."""
    max_speed: Positive | None = None
    """m/s, level and upright."""


class _Record(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class OtherLease(_Record):
    """Area of another granted lease, from which the rehearsed flight has to stay away."""

    id: str
    area: Area


class HostFlight(_Record):
    """The flight by whose cameras a mission senses."""

    mission: str
    socket: Path
    """At which its process serves the API."""
    sensors: list[str]
    """Cameras that are shared, by full id."""


class FlightOrder(_Record):
    """All that a flight's process needs to know; the document lies beside it."""

    mission: str
    """Id of the mission."""
    lease: str
    fleet: Path
    """The provider's environment file."""
    robots: list[str]
    locks: Path
    """Folder of the drones' locks, see `RobotLocks`."""
    ends: float
    """End of the lease, Unix seconds; after it the drones come home, whatever becomes of the
    service."""
    offset: WallOffset | None = None
    """Of the wall clock by which `ends` is meant; None for the present one."""
    minutes: float
    """Length of the lease."""
    limits: TenantLimits = TenantLimits()
    area: Area | None = None
    actuators: list[str] = Field(default_factory=list)
    """Actuators that the tenant may move, as `robot/actuator`."""
    silence: SilencePolicy = SilencePolicy.CONTINUE
    silence_seconds: float = 30.0
    speed: Literal["max"] | float = 1.0
    """Mission seconds a wall second; `max`: as fast as the machine goes, in simulated time,
    where all robots are simulated."""
    seeds: list[int] = Field(default_factory=list)
    """Of wind, noise and a simulated world: one for each flight of a rehearsal; a flight has the
    first. None is the environment's own."""
    address: str | None = None
    """Ray cluster to join; None for one of its own."""
    edge: EdgeShare | None = None
    """None where flights use the edge as they like."""
    attached: HostFlight | None = None
    """For a mission that senses only, which has no robots."""
    rehearsal: bool = False
    """Fly in simulation, and judge the recording."""
    rehearsal_seconds: float = 300.0
    """Most seconds of a processor that the rehearsal uses."""
    rehearsal_bytes: int = 2 << 30
    """Most memory of the same."""
    battery: dict[str, float] = Field(default_factory=dict)
    """Charge by robot, 0 to 1, with which the rehearsal begins."""
    others: list[OtherLease] = Field(default_factory=list)

    @property
    def seed(self) -> int | None:
        """Seed of the next flight; None for the environment's own."""
        return self.seeds[0] if self.seeds else None

    @classmethod
    def read(cls, path: Path) -> FlightOrder:
        """Read an order; raises ConfigError for one that is malformed."""
        return checked(cls, read_json(path, "the flight's order"), str(path))


class Outcome(_Record):
    """How a flight ended; written last."""

    landed: bool
    """Whether it ended as planned."""
    reason: str = ""
    began: float
    ended: float
    """Unix seconds."""
    status: dict[str, RobotStatus] = Field(default_factory=dict)
    """Last status by robot."""
    places: dict[str, dict[str, Place]] = Field(default_factory=dict)
    """As `MissionOut` has them."""
    alerts: list[str] = Field(default_factory=list)
    flight_seconds: float = 0.0
    """Sum of its robots' time in flight, mission seconds."""
    distance: float = 0.0
    battery_used: float = 0.0
    compute_seconds: dict[str, float] = Field(default_factory=dict)
    cloud_calls: int = 0
    verdict: VerdictOut | None = None
    """Of a rehearsal."""


_UNPROCESSABLE = 422


class FlightOrders:
    """Writes orders by the provider's settings and the tenant's limits."""

    def __init__(
        self, settings: ServiceSettings, store: Store, leases: LeaseService, registry: FleetRegistry
    ) -> None:
        """Write orders for one provider.

        Args:
            settings: Settings of the provider.
            store: Its open database, which has the tenants' limits.
            leases: Its leases, from whose areas rehearsed flights stay away.
            registry: Its drones, with their charge.
        """
        self._settings = settings
        self._store = store
        self._leases = leases
        self._registry = registry

    def check(
        self, principal: Principal, document: MissionDocument, *, attached: bool = False
    ) -> list[str]:
        """Robots that a document flies, none for one that is attached to another mission.

        Args:
            principal: The account that asks.
            document: The mission document.
            attached: Whether it is attached.

        Raises:
            RefusedError: If the document asks for what cannot be had here.
        """
        config = self._settings.config
        robots = robots_of(document)
        _require_known("robot", robots, {robot.id for robot in config.robots})
        sensors = {sensor.full_id for sensor in config.all_sensors()}
        _require_known("sensor", document.sensors, sensors)
        if config.compute != "auto":
            resources = [entry.compute for entry in document.analyses if entry.compute is not None]
            _require_known("compute resource", resources, {node.id for node in config.compute})
        for entry in document.analyses:
            if entry.analysis is not None:
                require_plugin("analytics", entry.analysis)
        if not (robots or attached):
            text = "its navigation is empty: it flies no drone, and is attached to no mission"
            raise RefusedError(_UNPROCESSABLE, text)
        self._require_actuators(principal.tenant, document)
        self.require_scopes(principal, document)
        return robots

    def may_call_cloud(self, document: MissionDocument) -> bool:
        """Whether an analysis may run elsewhere than on the edge; a scheduler may place any."""
        nodes = self._settings.config.compute
        if nodes == "auto":
            return bool(document.analyses)
        elsewhere = {node.id for node in nodes if node.kind != "edge"}
        if document.analytics_scheduler is not None:
            return bool(elsewhere and document.analyses)
        return any(entry.compute in elsewhere for entry in document.analyses)

    def require_scopes(self, principal: Principal, document: MissionDocument) -> None:
        """Check that a token is good for what a document senses and computes.

        Args:
            principal: The account that asks.
            document: The mission document.

        Raises:
            RefusedError: If the token lacks a role or a scope.
        """
        cameras = {
            sensor.full_id
            for sensor in self._settings.config.all_sensors()
            if sensor.type == "camera"
        }
        if cameras & set(document.sensors):
            require(principal, Role.PILOT, Scope.SENSE, agents=True)
        if document.analyses:
            require(principal, Role.PILOT, Scope.COMPUTE, agents=True)

    def _require_actuators(self, tenant: str, document: MissionDocument) -> None:
        """Raise RefusedError for a document that moves what the tenant may not."""
        may = self._settings.actuators.get(tenant, frozenset())
        if refused := sorted(actuators_of(document) - may):
            raise RefusedError(
                403,
                f"{tenant} may not move {', '.join(refused)}: its provider says who moves "
                "actuators (`aerodaas serve --actuator`)",
            )

    def rehearsal(self, mission: Mission) -> FlightOrder:
        """The order of a mission's rehearsal, which begins with the drones' present charge."""
        order = self._order(mission, "rehearsal", None)
        others = [
            OtherLease(id=lease.id, area=list(lease.area))
            for lease in self._leases.granted()
            if lease.area is not None and lease.id != mission.lease
        ]
        own = self._leases.lease(mission.lease) if mission.lease is not None else None
        return order.model_copy(
            update={
                "rehearsal": True,
                "rehearsal_seconds": self._settings.rehearsal_seconds,
                "rehearsal_bytes": self._settings.rehearsal_bytes,
                "edge": None,
                "speed": "max",
                "seeds": self._seeds(mission),
                "battery": self.charges(mission.robots),
                "others": others,
                "area": None if own is None or own.area is None else list(own.area),
            }
        )

    def charges(self, robots: Iterable[str]) -> dict[str, float]:
        """Present charge of those robots of which it is known, 0 to 1."""
        states = self._registry.states
        known = ((name, states[name].battery) for name in robots)
        return {name: charge for name, charge in known if charge is not None}

    def _seeds(self, mission: Mission) -> list[int]:
        """Seeds of a rehearsal: the environment's own and those after it, for a proposal."""
        if (proposal := mission.request.get("proposal")) is None:
            seed = mission.request["seed"]
            return [] if seed is None else [seed]
        first = self._settings.config.simulation.seed
        return list(range(first, first + proposal["seeds"]))

    def flight(self, mission: Mission, lease: Lease) -> FlightOrder:
        """The order of a mission's flight under a granted lease.

        Args:
            mission: The mission.
            lease: The lease, which is granted.
        """
        order = self._order(mission, lease.id, lease)
        if (proposal := mission.request.get("proposal")) is None:
            return order
        # What its approver has not ticked does not move, whatever its tenant may.
        ticked = proposal["approval"]["actuators"]
        return order.model_copy(
            update={"actuators": [name for name in order.actuators if name in ticked]}
        )

    def attached(self, mission: Mission, to: HostFlight) -> FlightOrder:
        """The order of a mission that senses by the cameras of another one, in real time.

        Args:
            mission: The mission.
            to: The flight whose cameras it uses.
        """
        order = self._order(mission, "attached", None)
        return order.model_copy(update={"attached": to, "speed": 1.0, "address": None})

    def _order(self, mission: Mission, lease: str, granted: Lease | None) -> FlightOrder:
        minutes = float(mission.request["minutes"])
        tenant = self._store.tenants.require(mission.tenant)
        seed = mission.request["seed"]
        ends = None if granted is None else granted.ends
        return FlightOrder(
            mission=mission.id,
            lease=lease,
            fleet=self._settings.fleet,
            robots=list(mission.robots),
            locks=self._settings.locks,
            ends=self._leases.now() + 60.0 * minutes if ends is None else ends,
            offset=self._leases.offset,
            minutes=minutes if granted is None else granted.minutes,
            limits=TenantLimits(max_height=tenant.max_height, max_speed=tenant.max_speed),
            area=None if granted is None or granted.area is None else list(granted.area),
            actuators=sorted(self._settings.actuators.get(mission.tenant, ())),
            silence=mission.request["silence"],
            silence_seconds=mission.request["silence_seconds"],
            speed=self._settings.speed,
            seeds=[] if seed is None else [seed],
            address=self._settings.address,
            edge=self._edge(mission.tenant),
        )

    def _edge(self, tenant: str) -> EdgeShare | None:
        settings = self._settings
        if settings.edge_slots is None:
            return None
        weight = self._store.tenants.require(tenant).weight
        return EdgeShare(turns=settings.edge_turns, tenant=tenant, weight=weight)


def robots_of(document: MissionDocument) -> list[str]:
    """Robots that a document navigates, in the order in which it names them."""
    return list(dict.fromkeys(entry.robot for entry in document.navigation))


def actuators_of(document: MissionDocument) -> frozenset[str]:
    """Actuators that a document moves, as `robot/actuator`."""
    return frozenset(
        f"{entry.robot}/{action.equipment}"
        for entry in document.navigation
        for waypoint in entry.waypoints
        for action in waypoint.actions
        if action.equipment
    )


def _require_known(kind: str, wanted: list[str], known: set[str]) -> None:
    missing = sorted(set(wanted) - known)
    if missing:
        found = ", ".join(sorted(known)) or "none"
        text = f"this provider has no {kind} {', '.join(missing)}; it has {found}"
        raise RefusedError(_UNPROCESSABLE, text)
