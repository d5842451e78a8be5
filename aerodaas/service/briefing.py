"""Briefing: the orders of a mission's rehearsal and flight, and what a document asks for."""

from __future__ import annotations

from pathlib import Path

from aerodaas.config.plugins import require_plugin
from aerodaas.dataflow.mission_document import MissionDocument
from aerodaas.protocol.schemas import Role, Scope
from aerodaas.service.access.principal import Principal, require
from aerodaas.service.bookings import Bookings
from aerodaas.service.errors import RefusedError
from aerodaas.service.flights.order import (
    Attached,
    EdgeTurnsOrder,
    FlightOrder,
    OtherLease,
    Outcome,
    TenantLimits,
)
from aerodaas.service.garage import Garage
from aerodaas.service.settings import ServiceSettings
from aerodaas.service.store import Lease, Mission, Store, Usage

__all__ = ["Briefing", "robots_of", "usage_of"]

_UNPROCESSABLE = 422


class Briefing:
    """Writes orders by the provider's settings and the tenant's limits."""

    def __init__(
        self, settings: ServiceSettings, store: Store, bookings: Bookings, garage: Garage
    ) -> None:
        """Brief by these."""
        self._settings = settings
        self._store = store
        self._bookings = bookings
        self._garage = garage

    def check(
        self, principal: Principal, document: MissionDocument, *, attached: bool = False
    ) -> list[str]:
        """Robots that a document flies, none for one that is `attached` to another mission.

        Raises RefusedError for what cannot be had here.
        """
        config = self._settings.config
        robots = robots_of(document)
        _require_known("robot", robots, {robot.id for robot in config.robots})
        _require_known("sensor", document.sensors, {one.full_id for one in config.all_sensors()})
        if config.compute != "auto":
            wanted = [one.compute for one in document.analyses if one.compute is not None]
            _require_known("compute resource", wanted, {one.id for one in config.compute})
        for one in document.analyses:
            if one.analysis is not None:
                require_plugin("analytics", one.analysis)
        if not (robots or attached):
            text = "its navigation is empty: it flies no drone, and is attached to no mission"
            raise RefusedError(_UNPROCESSABLE, text)
        self._require_actuators(principal.tenant, document)
        self.require_scopes(principal, document)
        return robots

    def may_call_cloud(self, document: MissionDocument) -> bool:
        """Whether an analysis may run elsewhere than on the edge; a scheduler may place any."""
        known = self._settings.config.compute
        if known == "auto":
            return bool(document.analyses)
        elsewhere = {one.id for one in known if one.kind != "edge"}
        if document.analytics_scheduler is not None:
            return bool(elsewhere and document.analyses)
        return any(one.compute in elsewhere for one in document.analyses)

    def require_scopes(self, principal: Principal, document: MissionDocument) -> None:
        """Raise RefusedError for a token not good for what a document senses and computes."""
        cameras = {
            one.full_id for one in self._settings.config.all_sensors() if one.type == "camera"
        }
        if cameras & set(document.sensors):
            require(principal, Role.PILOT, Scope.SENSE)
        if document.analyses:
            require(principal, Role.PILOT, Scope.COMPUTE)

    def _require_actuators(self, tenant: str, document: MissionDocument) -> None:
        """Raise RefusedError for a document that moves what the tenant may not."""
        may = self._settings.actuators.get(tenant, frozenset())
        asked = {
            f"{one.robot}/{name}"
            for one in document.navigation
            for waypoint in one.waypoints
            for name in waypoint.actuate
        }
        if refused := sorted(asked - may):
            raise RefusedError(
                403,
                f"{tenant} may not move {', '.join(refused)}: its provider says who moves "
                "actuators (`aerodaas serve --actuator`)",
            )

    def rehearsal(self, mission: Mission) -> FlightOrder:
        """The order of a mission's rehearsal, which begins with the drones' present charge."""
        order = self._order(mission, "rehearsal", None)
        states = self._garage.states
        battery = {
            name: charge for name in mission.robots if (charge := states[name].battery) is not None
        }
        others = [
            OtherLease(id=one.id, area=list(one.area))
            for one in self._bookings.granted()
            if one.area is not None and one.id != mission.lease
        ]
        own = self._bookings.lease(mission.lease) if mission.lease is not None else None
        return order.model_copy(
            update={
                "rehearsal": True,
                "rehearsal_seconds": self._settings.rehearsal_seconds,
                "rehearsal_bytes": self._settings.rehearsal_bytes,
                "edge": None,
                "speed": "max",
                "battery": battery,
                "others": others,
                "area": None if own is None or own.area is None else list(own.area),
            }
        )

    def flight(self, mission: Mission, lease: Lease) -> FlightOrder:
        """The order of a mission's flight under a granted lease."""
        return self._order(mission, lease.id, lease)

    def attached(self, mission: Mission, to: Attached) -> FlightOrder:
        """The order of a mission that senses by the cameras of another one, in real time."""
        order = self._order(mission, "attached", None)
        return order.model_copy(update={"attached": to, "speed": 1.0, "address": None})

    def _order(self, mission: Mission, lease: str, granted: Lease | None) -> FlightOrder:
        minutes = float(mission.request["minutes"])
        tenant = self._store.tenants.demand(mission.tenant)
        ends = None if granted is None else granted.ends
        return FlightOrder(
            mission=mission.id,
            lease=lease,
            fleet=self._settings.fleet,
            robots=list(mission.robots),
            locks=self._settings.locks,
            ends=self._bookings.now() + 60.0 * minutes if ends is None else ends,
            offset=self._bookings.offset,
            minutes=minutes if granted is None else granted.minutes,
            limits=TenantLimits(max_height=tenant.max_height, max_speed=tenant.max_speed),
            area=None if granted is None or granted.area is None else list(granted.area),
            actuators=sorted(self._settings.actuators.get(mission.tenant, ())),
            silence=mission.request["silence"],
            silence_seconds=mission.request["silence_seconds"],
            speed=self._settings.speed,
            seed=mission.request["seed"],
            address=self._settings.address,
            edge=self._edge(mission.tenant),
        )

    def _edge(self, tenant: str) -> EdgeTurnsOrder | None:
        settings = self._settings
        if settings.edge_slots is None:
            return None
        weight = self._store.tenants.demand(tenant).weight
        return EdgeTurnsOrder(turns=settings.edge_turns, tenant=tenant, weight=weight)


def robots_of(document: MissionDocument) -> list[str]:
    """Robots that a document navigates, in the order in which it names them."""
    return list(dict.fromkeys(one.robot for one in document.navigation))


def usage_of(mission: Mission, outcome: Outcome, recording: Path) -> Usage:
    """What a mission has used."""
    return Usage(
        mission=mission.id,
        tenant=mission.tenant,
        account=mission.account,
        started=outcome.began,
        flight_seconds=outcome.flight_seconds,
        distance=outcome.distance,
        battery_used=outcome.battery_used,
        compute_seconds=outcome.compute_seconds,
        cloud_calls=outcome.cloud_calls,
        recorded_bytes=recording.stat().st_size if recording.is_file() else 0,
    )


def _require_known(kind: str, wanted: list[str], known: set[str]) -> None:
    missing = sorted(set(wanted) - known)
    if missing:
        found = ", ".join(sorted(known)) or "none"
        text = f"this provider has no {kind} {', '.join(missing)}; it has {found}"
        raise RefusedError(_UNPROCESSABLE, text)
