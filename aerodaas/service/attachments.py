"""Attachments: missions that sense by the cameras of another one in flight.

They are missions like others, in a process and a Ray of their own; but their cameras are the other
flight's, whose process sends pictures as long as they are shared, and they have no drone.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Mapping
from typing import TYPE_CHECKING

from aerodaas.analytics.remote import RemoteAnalytics
from aerodaas.config.plugins import load_plugin
from aerodaas.errors import MissionError
from aerodaas.protocol.schemas import FlightLeaseIn, LeaseState, MissionIn, MissionPhase, StreamKind
from aerodaas.service.access.principal import Principal, sees
from aerodaas.service.errors import RefusedError
from aerodaas.service.flights.orders import HostFlight
from aerodaas.service.leases.lease_service import LeaseService
from aerodaas.service.mission import ActiveMission
from aerodaas.service.settings import ServiceSettings

if TYPE_CHECKING:
    from aerodaas.dataflow.mission_document import MissionDocument

__all__ = ["Attachments"]

_UNPROCESSABLE = 422
_ENDING_SECONDS = 60.0
"""Seconds after which the process of an attached mission that was told to end is ended."""


class Attachments:
    """Attached missions among those of the service, whose lock the caller holds."""

    def __init__(
        self, settings: ServiceSettings, leases: LeaseService, missions: Mapping[str, ActiveMission]
    ) -> None:
        """Attach to `missions` by the provider's settings."""
        self._most = settings.most_attached
        self._cameras = {
            sensor.full_id for sensor in settings.config.all_sensors() if sensor.type == "camera"
        }
        self._leases = leases
        self._missions = missions
        self._told: dict[str, float] = {}
        """When an attached mission was told to end, by `time.monotonic`."""

    def check(self, principal: Principal, wanted: MissionIn) -> None:
        """Check that a mission may be attached to the one that it names.

        Args:
            principal: The account that asks.
            wanted: The submitted mission.

        Raises:
            RefusedError: If the provider, the other mission's owner or the mission itself rules it
                out.
        """
        if self._most == 0:
            raise RefusedError(403, "this provider shares no cameras between applications")
        if wanted.lease is not None:
            raise RefusedError(_UNPROCESSABLE, "an attached mission has no lease: leave it out")
        _require_senses_only(wanted.document)
        host = self._host(principal, str(wanted.attach))
        shared = self.shared(host, principal.tenant)
        missing = [name for name in wanted.document.sensors if name not in shared]
        if missing:
            told = ", ".join(shared) or "none that is running"
            raise RefusedError(
                403, f"{host.row.id} does not share {', '.join(missing)}; it shares {told}"
            )
        if len(self._beside(host)) >= self._most:
            raise RefusedError(409, self._full(host))

    def shared(self, host: ActiveMission, tenant: str) -> list[str]:
        """Running cameras of a flying mission to which a tenant may attach missions.

        Args:
            host: The flying mission.
            tenant: Name of the tenant.
        """
        if self._most == 0 or host.phase is not MissionPhase.FLYING or host.attached_to:
            return []
        # Without a link of its own: requests ask for this in any thread.
        told = None if host.link is None else host.link.mission
        streams = {} if told is None else told.streams
        running = [name for name, kind in streams.items() if kind is StreamKind.PICTURES]
        cameras = [name for name in running if name in self._cameras]
        return [name for name in cameras if _may_have(tenant, [name], host)]

    def share_cameras(self, active: ActiveMission) -> HostFlight:
        """Have the flight share its cameras with a mission; raises MissionError if it does not."""
        host = self._missions.get(str(active.attached_to))
        if host is None or host.phase is not MissionPhase.FLYING:
            raise MissionError(f"{active.attached_to} is not flying any more")
        if len([other for other in self._beside(host) if other is not active]) >= self._most:
            raise MissionError(self._full(host))
        wanted = active.document().sensors
        if not set(wanted) <= set(self.shared(host, active.row.tenant)):
            raise MissionError(f"{active.attached_to} does not share its cameras any more")
        answer = host.follow().share(active.row.id, wanted)
        if not answer.accepted:
            raise MissionError(answer.text)
        return HostFlight(mission=host.row.id, socket=host.flight.socket, sensors=wanted)

    def end_if_withdrawn(self, active: ActiveMission) -> None:
        """End an attached mission whose flight has ended, or that may sense no more."""
        host = self._missions.get(str(active.attached_to))
        if host is None or host.phase is not MissionPhase.FLYING:
            self._end(active, "the flight that it was attached to has ended")
        elif not _may_have(active.row.tenant, active.document().sensors, host):
            self._withdraw(host, active)
            self._end(active, f"{host.row.tenant} has withdrawn its grant")

    def stop_sharing(self, active: ActiveMission) -> None:
        """Share no more with a mission that is over."""
        self._told.pop(active.row.id, None)
        host = self._missions.get(str(active.attached_to))
        if host is not None:
            self._withdraw(host, active)

    def grant(self, host: ActiveMission, tenant: str, sensors: list[str]) -> None:
        """Let a tenant attach missions to these cameras; what it has attached to others ends.

        Args:
            host: The mission whose cameras are shared.
            tenant: Name of the tenant.
            sensors: Full ids of the cameras; an empty list is all of them.
        """
        self._grant(host, tenant, {**host.grants, tenant: sensors})

    def withdraw_grant(self, host: ActiveMission, tenant: str) -> None:
        """Share nothing with a tenant any more, from the next picture on.

        Args:
            host: The mission whose cameras were shared.
            tenant: Name of the tenant.
        """
        others = {name: cameras for name, cameras in host.grants.items() if name != tenant}
        self._grant(host, tenant, others)

    def _beside(self, host: ActiveMission) -> list[ActiveMission]:
        """Missions that are attached to a flight, or are to be."""
        return [active for active in self._missions.values() if active.attached_to == host.row.id]

    def _full(self, host: ActiveMission) -> str:
        return f"{self._most} missions are attached to {host.row.id}, the most that may be"

    def _grant(self, host: ActiveMission, tenant: str, grants: Mapping[str, list[str]]) -> None:
        """Change the grants; what `tenant` has attached and may have no more ends at once."""
        host.change(request={**host.row.request, "grants": dict(grants)})
        for active in self._beside(host):
            if active.row.tenant == tenant and active.phase is MissionPhase.FLYING:
                self.end_if_withdrawn(active)

    def _host(self, principal: Principal, name: str) -> ActiveMission:
        """The mission to attach to; for whom it neither is nor shares with, there is none."""
        host = self._missions.get(name)
        if host is not None and _may_have(principal.tenant, [], host):
            if host.phase is not MissionPhase.FLYING or host.attached_to is not None:
                what = "senses only" if host.attached_to else f"is {host.phase.value}"
                raise RefusedError(409, f"{name} {what}: attach to a mission in flight")
            lease = self._leases.lease(str(host.row.lease))
            if lease.state is LeaseState.ENDED:
                raise RefusedError(409, f"{name}: its lease has ended, and its drones come home")
            return host
        if host is not None and sees(principal, host.row.tenant, host.row.request.get("share", ())):
            raise RefusedError(403, f"{host.row.tenant} has not granted {name}'s cameras to you")
        raise RefusedError(404, f"there is no mission {name!r} in flight")

    def _withdraw(self, host: ActiveMission, active: ActiveMission) -> None:
        # A flight that does not answer shares no more either once it is over.
        with contextlib.suppress(MissionError):
            host.follow().withdraw(active.row.id)

    def _end(self, active: ActiveMission, reason: str) -> None:
        """Tell an attached mission to end; one that does not is ended after a while."""
        now = time.monotonic()
        if active.row.id not in self._told:
            self._told[active.row.id] = now
            # Its cameras end in any case.
            with contextlib.suppress(MissionError):
                active.follow().change_lease(FlightLeaseIn(reason=reason))
        elif now - self._told[active.row.id] > _ENDING_SECONDS:
            active.end_flight()


def _may_have(tenant: str, sensors: list[str], host: ActiveMission) -> bool:
    """Whether a tenant may sense by these cameras: its own, or granted, by name or all of them."""
    if tenant == host.row.tenant:
        return True
    granted = host.grants.get(tenant)
    return granted is not None and (not granted or set(sensors) <= set(granted))


def _require_senses_only(document: MissionDocument) -> None:
    """Raise RefusedError for a document that navigates, commands, or reads nothing."""
    if document.navigation:
        raise RefusedError(
            _UNPROCESSABLE,
            "an attached mission senses only, and this one navigates "
            f"{document.navigation[0].robot}",
        )
    for entry in document.analyses:
        commands = [rule.command for rule in entry.triggers if rule.command is not None]
        kind = None if entry.analysis is None else load_plugin("analytics", entry.analysis)
        if commands or (isinstance(kind, type) and issubclass(kind, RemoteAnalytics)):
            what = commands[0] if commands else f"its {entry.analysis}"
            raise RefusedError(
                _UNPROCESSABLE,
                f"an attached mission senses only: {entry.id} would command the drone by {what}",
            )
    if not document.sensors:
        raise RefusedError(_UNPROCESSABLE, "an attached mission reads at least one camera")
