"""Missions of a provider: submitted, moved on from phase to phase, shown and commanded."""

from __future__ import annotations

import contextlib
import itertools
import logging
import secrets
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from aerodaas.config.model import EnvironmentConfig
from aerodaas.errors import AeroDaaSError, MissionError
from aerodaas.messages.health import HealthReport
from aerodaas.messages.mission import MissionState, RobotStatus
from aerodaas.messages.vehicle import VehicleMode
from aerodaas.mission.commands import Answer
from aerodaas.protocol.proposals import ApprovalIn
from aerodaas.protocol.scenery import SceneryOut
from aerodaas.protocol.schemas import (
    LeaseState,
    LinkState,
    MissionIn,
    MissionOut,
    MissionPhase,
    PictureForm,
    Role,
    Scope,
)
from aerodaas.service.access.principal import Principal, require, sees
from aerodaas.service.attachments import Attachments
from aerodaas.service.backend import PilotCommand
from aerodaas.service.errors import RefusedError, RepeatedErrorLog, StoreError
from aerodaas.service.fleet.fleet_registry import OUT_OF_SERVICE, FleetRegistry
from aerodaas.service.flights.environment import environment_of
from aerodaas.service.flights.folder import FlightFolder, RobotLocks
from aerodaas.service.flights.orders import FlightOrder, FlightOrders
from aerodaas.service.leases.lease_service import LeaseService
from aerodaas.service.mission import (
    CANCELLED_BY,
    ActiveMission,
    LostFlightError,
    fingerprint_of,
    shown,
    usage_of,
)
from aerodaas.service.mission_table import MissionTable
from aerodaas.service.models.model_store import ModelStore, require_room
from aerodaas.service.monitor.process import FleetMonitor
from aerodaas.service.proposals.service import ProposalService
from aerodaas.service.settings import ServiceSettings
from aerodaas.service.store import Lease, Mission, Store

__all__ = ["MissionService", "rehearsal_order"]

_TURN_SECONDS = 0.1
_REHEARSAL_SHARE = 4.0
"""Wall seconds for each second of a processor that a rehearsal may use."""
_MOST_SHOWN = 100
"""Most missions of a list that are over: of one's own, and of those that others share."""


class MissionService:
    """Missions of all tenants; safe in any thread."""

    def __init__(
        self,
        settings: ServiceSettings,
        store: Store,
        *,
        leases: LeaseService,
        registry: FleetRegistry,
        models: ModelStore,
        monitor: FleetMonitor | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Take up the missions that the database has; `start` moves them on.

        `monitor` holds the drones that no mission flies; None for nobody. Approvals lapse by
        `clock`, in seconds as of `time.monotonic`.
        """
        self._settings = settings
        self._store = store
        self._leases = leases
        self._registry = registry
        self._models = models
        self._monitor = monitor
        self._orders = FlightOrders(settings, store, leases, registry)
        self._table = MissionTable(store, settings.missions)
        self._lock, self._missions = self._table.lock, self._table.missions
        self._closed = threading.Event()
        self._errors = RepeatedErrorLog(logging.getLogger(__name__))
        self._robot_locks = RobotLocks(settings.locks)
        self._robots = [robot.id for robot in settings.config.robots]
        self._texts: dict[str, tuple[int, str, bool]] = {}
        """Version, JSON and whether it is over, by mission that is watched."""
        self.proposals = ProposalService(
            settings,
            store,
            self._table,
            self._orders,
            leases=leases,
            registry=registry,
            clock=clock,
        )
        self._attachments = Attachments(settings, leases, self._missions)
        leases.flying = self._busy
        leases.on_end.append(self._tell_flights)
        leases.on_extension.append(self._tell_flights)
        self._rehearsals = itertools.count(1)
        self._last_rehearsed: dict[str, int] = {}
        """Number of each tenant's last rehearsal."""
        self._rehearsal_places: dict[str, int] = {}
        self._in_flight: dict[str, ActiveMission] = {
            id_: active
            for id_, active in self._missions.items()
            if active.phase is MissionPhase.FLYING
        }
        """Missions of these that fly."""

    def start(self) -> None:
        """Move missions on from now on, in a thread of its own."""
        threading.Thread(target=self._run, name="missions", daemon=True).start()

    def close(self) -> None:
        """Move on no more; flights go on by themselves."""
        self._closed.set()
        with self._lock:
            for active in self._missions.values():
                active.close()
        if self._monitor is not None:
            self._monitor.close()

    def submit(
        self, principal: Principal, submission: MissionIn, key: str | None = None
    ) -> MissionOut:
        """Take a mission in, or find the one that was submitted before with the same `key`.

        Args:
            principal: The account that asks.
            submission: The document, and its lease or the mission that it is attached to.
            key: Idempotency key; None for none.

        Raises:
            RefusedError: If it cannot be flown here; with status 422 for another one than was
                submitted with this key.
        """
        # First: what was taken in has used up its quota and its lease.
        earlier = self._submitted(principal, submission, key)
        if earlier is not None:
            return shown(earlier)
        self._require_open(principal.tenant)
        require_room(self._settings.state)
        attached = submission.attach is not None
        robots = self._orders.check(principal, submission.document, attached=attached)
        if attached:
            with self._lock:
                self._attachments.check(principal, submission)
        self._registry.require_fit(robots)
        if submission.lease is not None:
            # It has used up its minutes of the quota already.
            self._leases.require(principal, submission.lease, robots)
        own = 0.0 if submission.lease is not None else submission.minutes * len(robots)
        cloud = self._orders.may_call_cloud(submission.document)
        self._leases.require_quota(principal.tenant, own, cloud=cloud)
        name = secrets.token_hex(6)
        row = Mission(
            id=name,
            name=submission.document.name or "mission",
            tenant=principal.tenant,
            account=principal.account,
            phase=MissionPhase.SUBMITTED,
            robots=tuple(robots),
            lease=submission.lease,
            submitted=time.time(),
            folder=str(self._table.path(name)),
            request=submission.model_dump(mode="json", exclude={"document"}),
            key=key,
            fingerprint=None if key is None else fingerprint_of(submission),
        )

        def find() -> ActiveMission | None:
            found = self._submitted(principal, submission, key)
            if found is None:
                self._require_open(principal.tenant)
            return found

        return shown(self._table.add(row, submission.document, find))

    def _require_open(self, tenant: str) -> None:
        """Raise RefusedError for a tenant with as many missions that are not over as it may."""
        most = self._settings.most_open
        taken = [
            active
            for active in list(self._missions.values())
            # Agents have a bound of their own, and keep no person from submitting.
            if active.row.tenant == tenant and active.phase is not MissionPhase.PROPOSED
        ]
        if len(taken) >= most:
            raise RefusedError(
                429, f"{tenant} has {most} missions that are not over: wait for one, or cancel some"
            )

    def _submitted(
        self, principal: Principal, submission: MissionIn, key: str | None
    ) -> ActiveMission | None:
        """The mission that this submission has become; None if it was not sent before."""
        row = None if key is None else self._store.missions.of_key(principal.tenant, key)
        if row is None:
            return None
        if row.fingerprint != fingerprint_of(submission):
            raise RefusedError(
                422,
                f"another mission was submitted with this Idempotency-Key ({row.id}): send a "
                "new key with each new mission",
            )
        return self._table.of_row(row)

    def approve(
        self, principal: Principal, mission: str, approval: ApprovalIn | None = None
    ) -> MissionOut:
        """Approve a mission that waits for it.

        Args:
            principal: The account that approves.
            mission: Id of the mission.
            approval: What exactly is approved, of a proposal; None for any other mission.
        """
        with self._lock:
            active = self._table.open(mission)
            if active.phase is not MissionPhase.AWAITING_APPROVAL:
                raise RefusedError(
                    409, f"{mission} does not wait for approval: {active.phase.value}"
                )
            if active.is_proposal:
                self.proposals.approve(principal, active, approval)
            else:
                active.set_phase(MissionPhase.QUEUED, f"approved by {principal.account}")
            return self.proposals.shown(active)

    def cancel(self, principal: Principal, mission: str) -> MissionOut:
        """Cancel a mission; drones in flight come home first.

        Args:
            principal: The account that asks.
            mission: Id of the mission.
        """
        owner = self._table.require_own(principal, mission).row.account
        if principal.agent and owner != principal.account:
            raise RefusedError(403, f"{mission} is {owner}'s: an agent stops it, and no more")
        with self._lock:
            active = self._table.open(mission)
            reason = f"{CANCELLED_BY}{principal.account}"
            if active.phase is not MissionPhase.FLYING:
                active.end_rehearsal()
                self._end(active, MissionPhase.CANCELLED, reason)
                return shown(active)
            active.set_waiting(reason)
        active.cancel_flight(reason)
        return shown(active)

    def fly(self, principal: Principal, mission: str, command: PilotCommand) -> Answer:
        """Give a robot of a flying mission a command."""
        # Without the lock, which may be held for long: a drone that is to come home comes home.
        link = self._flown(principal, mission).follow()
        return link.fly(command, operator=principal.role.reaches(Role.OPERATOR))

    def require_pilot(self, principal: Principal, mission: str) -> None:
        """Check that a mission flies and this account may command it."""
        self._flown(principal, mission)

    def environment(self, principal: Principal, mission: str) -> EnvironmentConfig:
        """The environment of a mission that flies and that this account may command."""
        return environment_of(FlightOrder.read(self._flown(principal, mission).flight.order))

    def grant(
        self, principal: Principal, mission: str, tenant: str, sensors: list[str] | None
    ) -> MissionOut:
        """Let a tenant attach missions to a mission's cameras.

        Args:
            principal: The account that asks.
            mission: Id of the mission.
            tenant: Tenant that may attach.
            sensors: Full ids of the cameras; None for none at all.
        """
        self._table.require_own(principal, mission)
        with self._lock:
            active = self._table.open(mission)
            if sensors is None:
                self._attachments.withdraw_grant(active, tenant)
            else:
                self._attachments.grant(active, tenant, sensors)
            return shown(active)

    def shared(self, robot: str, tenant: str) -> tuple[str | None, list[str]]:
        """The mission that flies a robot, and its cameras that a tenant may attach missions to.

        Args:
            robot: Id of the robot.
            tenant: Tenant that would attach.
        """
        host = next((active for active in self._flying() if robot in active.row.robots), None)
        if host is None:
            return None, []
        sensors = self._settings.config.all_sensors()
        own = {sensor.full_id for sensor in sensors if sensor.robot == robot}
        return host.row.id, [name for name in self._attachments.shared(host, tenant) if name in own]

    def _flown(self, principal: Principal, mission: str) -> ActiveMission:
        """A flying mission; raises RefusedError unless this account may command it."""
        self._table.require_own(principal, mission)
        active = self._table.open(mission)
        if active.phase is not MissionPhase.FLYING:
            raise RefusedError(409, f"{mission} is not flying: {active.phase.value}")
        if active.attached_to is not None:
            text = f"{mission} is attached to {active.attached_to}: it senses only"
            raise RefusedError(403, text)
        return active

    def mission(self, principal: Principal, mission: str) -> MissionOut:
        """As `Missions.mission`; the mission's own user counts as present."""
        found = self.proposals.shown(self._table.seen(principal, mission))
        if _is_user(principal, found):
            self.record_presence(mission)
        return found

    def scenery(self, principal: Principal, mission: str) -> SceneryOut:
        """Ground below a mission that this account may see."""
        seed = self._table.seen(principal, mission).row.request.get("seed")
        return SceneryOut.of(self._settings.config, seed)

    def missions(self, principal: Principal) -> list[MissionOut]:
        """Missions that this account may see, newest first: all that go on, and the newest."""
        table = self._store.missions
        if principal.role.reaches(Role.OPERATOR):
            rows = table.newest(_MOST_SHOWN)
        else:
            rows = table.newest(_MOST_SHOWN, principal.tenant)
            rows += table.newest_shared(_MOST_SHOWN, principal.tenant)
        found = {
            row.id: row
            for row in (*rows, *(active.row for active in list(self._missions.values())))
        }
        return [
            shown(self._table.of_row(row))
            for row in sorted(found.values(), key=lambda row: row.submitted, reverse=True)
            if sees(principal, row.tenant, row.request.get("share", ()))
        ]

    def shown(self, mission: str) -> MissionOut:
        """A mission, whoever asks."""
        return self._table.shown(mission)

    def text(self, mission: str) -> tuple[str, bool]:
        """A mission as JSON, made once for all that watch it, and whether it is over."""
        version = self.version(mission)
        cached = self._texts.get(mission)
        if cached is None or cached[0] != version or version < 0:
            found = self.shown(mission)
            cached = version, found.model_dump_json(), found.phase.over
            if version >= 0:
                self._texts[mission] = cached
        return cached[1], cached[2]

    def version(self, mission: str) -> int:
        """A number that grows with each change of a mission; -1 once it is over."""
        active = self._missions.get(mission)
        return -1 if active is None else active.version

    def flies(self, principal: Principal, mission: str) -> bool:
        """Whether a mission is this account's own, so that its presence counts."""
        return _is_user(principal, self.shown(mission))

    def require_users_side(self, principal: Principal, mission: str) -> None:
        """Check that this account may answer for a mission's user.

        It sees what the mission sees and steers it: its token must be as good as for submitting.

        Args:
            principal: The account that asks.
            mission: Id of the mission.

        Raises:
            RefusedError: If it may not.
        """
        active = self._table.seen(principal, mission)
        if active.row.tenant != principal.tenant:
            raise RefusedError(403, f"{mission} is {active.row.tenant}'s")
        if active.attached_to is None:
            require(principal, Role.PILOT, Scope.FLY)
        self._orders.require_scopes(principal, active.document())

    def record_presence(self, mission: str) -> None:
        """Record that the user of a mission is there."""
        active = self._missions.get(mission)
        if active is not None and active.phase is MissionPhase.FLYING:
            active.follow().record_presence()

    def items(
        self, mission: str, stream: str, form: PictureForm
    ) -> Iterator[tuple[dict[str, Any], bytes]]:
        """Items of a flying mission's stream."""
        with self._lock:
            active = self._table.open(mission)
            if active.phase is not MissionPhase.FLYING:
                raise MissionError(f"{mission} is not flying")
            link = active.follow()
        return link.items(stream, form)

    def flight(self, mission: str) -> FlightFolder | None:
        """The folder of a mission's flight; None unless it is flying."""
        active = self._missions.get(mission)
        return active.flight if active is not None and active.phase is MissionPhase.FLYING else None

    def preflight(self, robot: str) -> HealthReport | None:
        """The list before take-off that the flight of a robot has; None without a flight."""
        active = next((active for active in self._flying() if robot in active.row.robots), None)
        if active is None or active.link is None:
            return None
        with contextlib.suppress(MissionError):
            return active.link.preflight(robot)
        return None

    def file(self, principal: Principal, mission: str, name: str) -> Path:
        """The recording or the rehearsal's picture of a mission.

        Args:
            principal: The account that asks.
            mission: Id of the mission.
            name: `recording` or `picture`.

        Raises:
            RefusedError: If there is none.
        """
        active = self._table.seen(principal, mission)
        files = {"recording": active.flight.recording, "picture": active.rehearsal.picture}
        if not files[name].is_file() or (name == "recording" and not active.over):
            raise RefusedError(404, f"{mission} has no {name}")
        return files[name]

    def delete_recording(self, principal: Principal, mission: str) -> None:
        """Remove the recording of a mission that is over.

        Args:
            principal: The account that asks.
            mission: Id of the mission.

        Raises:
            RefusedError: If the mission is another tenant's, goes on, or has no recording.
        """
        self._table.require_own(principal, mission)
        self.file(principal, mission, "recording").unlink(missing_ok=True)
        # A flight whose process was killed has told of no usage.
        if self._store.usage.get(mission) is not None:
            self._store.usage.update(mission, lambda row: replace(row, kept=False))

    def _tell_flights(self, lease: Lease) -> None:
        """Bring home what flies under a lease that has ended; prolong what flies under a longer."""
        for active in self._flying():
            if active.row.lease == lease.id:
                active.send_lease(lease)

    def _run(self) -> None:
        while not self._closed.wait(_TURN_SECONDS):
            self._try()

    def _try(self) -> None:
        try:
            self.advance()
        except StoreError as error:
            self._errors.log_error("missions", error)
        except Exception as error:  # noqa: BLE001 - see below
            # Without this thread, no lease and no mission would ever move on again.
            self._errors.log_error("missions", error, trace=True)
        else:
            self._errors.log_recovery("missions")

    def advance(self) -> None:
        """Move every mission on by what has happened."""
        # First: leases end also while the database fails.
        self._leases.advance()
        with self._lock:
            self._rehearsal_places = self._places()
            for active in list(self._missions.values()):
                self._move(active)
                if active.over:
                    active.close()
                    del self._missions[active.row.id]
                    self._in_flight.pop(active.row.id, None)
                    self._texts.pop(active.row.id, None)
            self._have_watched()

    def _have_watched(self) -> None:
        """Have the monitor hold each drone in service that no mission has, or is to have next."""
        if self._monitor is None:
            return
        taken = self._busy() | {
            robot
            for active in self._missions.values()
            if active.handing_over
            for robot in active.row.robots
        }
        states = self._registry.states.values()
        self._monitor.hold(
            {state.id for state in states if state.enabled and state.id not in taken}
        )

    def _move(self, active: ActiveMission) -> None:
        """Move one mission on; what it meets is its own failure, unless the database is gone."""
        try:
            self._step(active)
        except StoreError:
            raise
        except (AeroDaaSError, OSError) as error:
            if active.phase is not MissionPhase.FLYING:
                self._end(active, MissionPhase.REFUSED, str(error))
            else:
                # The flight goes on by itself; the next turn looks again.
                self._errors.log_error(active.row.id, error)
        else:
            self._errors.log_recovery(active.row.id)

    def _step(self, active: ActiveMission) -> None:
        steps: dict[MissionPhase, Callable[[ActiveMission], object]] = {
            MissionPhase.SUBMITTED: self._begin,
            MissionPhase.REHEARSING: self._judge,
            MissionPhase.AWAITING_APPROVAL: self.proposals.has_lapsed,
            MissionPhase.QUEUED: self._take_off,
            MissionPhase.FLYING: self._watch,
        }
        step = steps.get(active.phase)
        if step is not None and not self.proposals.cancel_obsolete(active):
            step(active)

    def _begin(self, active: ActiveMission) -> None:
        if not self._settings.rehearse or active.attached_to is not None:
            self._admit(active)
            return
        self._rehearse(active)

    def _rehearse(self, active: ActiveMission) -> None:
        """Begin a mission's rehearsal, once it is its turn."""
        if place := self._rehearsal_places.get(active.row.id, 1):
            active.set_waiting(f"waits for its rehearsal: number {place} of those that wait")
            return
        order = self._orders.rehearsal(active.row)
        self.proposals.begin(active, order)
        active.rehearse(order, self._models)
        self._last_rehearsed[active.row.tenant] = next(self._rehearsals)
        if active.phase is not MissionPhase.REHEARSING:
            active.set_phase(MissionPhase.REHEARSING)

    def _places(self) -> dict[str, int]:
        """The place in the queue of each mission that waits for a rehearsal; 0 for its turn."""
        waiting, running = [], []
        for active in self._missions.values():
            lost = active.phase is MissionPhase.REHEARSING and active.rehearsal_lost
            if lost or active.phase is MissionPhase.SUBMITTED:
                waiting.append((active.row.id, active.row.tenant))
            elif active.phase is MissionPhase.REHEARSING:
                running.append(active.row.tenant)
        free = max(0, self._settings.most_rehearsals - len(running))
        order = rehearsal_order(waiting, running, self._last_rehearsed)
        return {id_: max(0, number - free) for number, id_ in enumerate(order, 1)}

    def _judge(self, active: ActiveMission) -> None:
        if active.rehearsal_lost:
            self._rehearse(active)
            return
        verdict = active.verdict(_REHEARSAL_SHARE * self._settings.rehearsal_seconds)
        if verdict is None:
            return
        if active.is_proposal:
            self.proposals.judge(active, verdict)
            return
        active.row = replace(active.row, verdict=verdict.model_dump(mode="json"))
        if verdict.approved:
            self._admit(active)
        else:
            self._end(active, MissionPhase.REFUSED, "; ".join(verdict.reasons))

    def _admit(self, active: ActiveMission) -> None:
        if self._settings.approval:
            active.set_phase(MissionPhase.AWAITING_APPROVAL, "waits for an operator's approval")
        else:
            active.set_phase(MissionPhase.QUEUED, "waits for its drones")

    def _take_off(self, active: ActiveMission) -> None:
        if self.proposals.has_lapsed(active):
            return
        if active.attached_to is not None:
            if self._has_place(active):
                attached = self._attachments.share_cameras(active)
                self._begin_flight(active, self._orders.attached(active.row, attached))
            return
        if active.row.lease is None:
            lease = self._leases.for_mission(active.row)
            active.change(lease=lease.id)
        else:
            lease = self._leases.lease(active.row.lease)
        if lease.state is LeaseState.ENDED:
            self._end(active, MissionPhase.REFUSED, f"its lease has ended: {lease.reason}")
        elif (
            lease.state is LeaseState.GRANTED
            and self._has_place(active)
            and self._handed_over(active)
            and not self.proposals.has_lapsed(active, limits=True)
        ):
            self._begin_flight(active, self._orders.flight(active.row, lease))

    def _begin_flight(self, active: ActiveMission, order: FlightOrder) -> None:
        active.prepare_flight(order, self._models)
        active.set_phase(MissionPhase.FLYING, started=time.time())
        self._in_flight[active.row.id] = active
        self._registry.set_link(active.row.robots, LinkState.MISSION)
        active.start_flight()

    def _handed_over(self, active: ActiveMission) -> bool:
        """Whether the monitor has let go of a mission's drones, each of which was fit to fly.

        A flight begins only then, so that one process at a time is connected with a drone.
        """
        if self._monitor is None:
            return True
        robots = active.row.robots
        if active.handing_over:
            # One that somebody else has armed meanwhile is not let go of.
            active.handing_over = not any(map(self._registry.objection, robots))
            return active.handing_over and self._monitor.released(robots)
        held_up = [f"{name}: {why}" for name in robots if (why := self._registry.obstacle(name))]
        active.handing_over = not held_up
        if held_up:
            active.set_waiting(f"waits for {'; '.join(held_up)}")
        return False

    def _has_place(self, queued: ActiveMission) -> bool:
        """Whether a flight may begin: its drones may be on their way home from the last one."""
        busy = self._flown_robots() | self._robot_locks.held(queued.row.robots)
        full = len(self._flying()) >= self._settings.most_flights
        if taken := sorted(busy.intersection(queued.row.robots)):
            queued.set_waiting(f"waits for {', '.join(taken)}: in another flight")
        elif full:
            queued.set_waiting(f"waits for the end of one of {self._settings.most_flights} flights")
        return not (taken or full)

    def _busy(self) -> set[str]:
        """Robots in flight, also by a process of which the database says nothing."""
        return self._flown_robots() | self._robot_locks.held(self._robots)

    def _flown_robots(self) -> set[str]:
        return {robot for active in self._flying() for robot in active.row.robots}

    def _flying(self) -> list[ActiveMission]:
        missions = list(self._in_flight.values())
        return [active for active in missions if active.phase is MissionPhase.FLYING]

    def _watch(self, active: ActiveMission) -> None:
        # After a restart: a flight whose order was written may not have begun.
        active.start_flight()
        active.set_waiting(active.flight.cancelled)
        link = active.follow()
        if link.mission is not None:
            self._registry.record_status(link.mission.status)
        if active.attached_to is not None:
            self._attachments.end_if_withdrawn(active)
        elif active.row.lease is not None and not active.recalled:
            # It may have ended, or been extended, while nobody could tell the flight.
            active.send_lease(self._leases.lease(active.row.lease))
        try:
            outcome = active.flight_outcome()
        except LostFlightError as error:
            reason = f"its process died in flight ({error})"
            if active.row.robots:
                reason += f"; its drones are {OUT_OF_SERVICE}"
            self._registry.take_out_of_service(active.row.robots)
            self._registry.set_link(active.row.robots, LinkState.UNWATCHED)
            self._end(active, MissionPhase.FAILED, reason)
            return
        if outcome is None:
            return
        self._registry.record_status(outcome.status, ended=outcome.ended)
        self._registry.set_link(active.row.robots, LinkState.UNWATCHED)
        self._store.usage.put(usage_of(active.row, outcome, active.flight.recording))
        phase = MissionPhase.LANDED if outcome.landed else MissionPhase.FAILED
        # One that was called home before its take-off has been aborted by that.
        if CANCELLED_BY in outcome.reason:
            phase = MissionPhase.CANCELLED
        reason = outcome.reason
        if up := [name for name, last in outcome.status.items() if _may_fly(last)]:
            # Its actor may fly it still, or a pilot: nobody else connects with it before a look.
            self._registry.take_out_of_service(up)
            reason += f"; {', '.join(up)}: not known to be down, {OUT_OF_SERVICE}"
        self._end(active, phase, reason)

    def _end(self, active: ActiveMission, phase: MissionPhase, reason: str) -> None:
        active.set_phase(phase, reason, ended=time.time())
        if active.attached_to is not None:
            self._attachments.stop_sharing(active)
        if active.row.lease is not None:
            self._leases.give_back(active.row)


def _is_user(principal: Principal, mission: MissionOut) -> bool:
    own = mission.tenant == principal.tenant and principal.role.reaches(Role.PILOT)
    return own and not principal.agent


def _may_fly(last: RobotStatus) -> bool:
    """Whether a drone whose mission has ended is not known to stand on the ground."""
    down = last.vehicle is None or last.vehicle.mode is VehicleMode.GROUNDED
    return not down and last.mission.state is not MissionState.LANDED


def rehearsal_order(
    waiting: Iterable[tuple[str, str]], running: Iterable[str], begun: Mapping[str, int]
) -> list[str]:
    """Put the missions that wait for a rehearsal into the order in which theirs begin.

    First comes a tenant with the fewest under way, counting those before it in this order; among
    equals the one whose last one began longest ago, then who has waited longest.

    Args:
        waiting: Id and tenant of each, in the order of submission.
        running: Tenant of each that is under way.
        begun: When each tenant's last one began, as a number that grows.

    Returns:
        The ids.
    """
    counts = Counter(running)
    keyed = []
    for number, (id_, tenant) in enumerate(waiting):
        keyed.append((counts[tenant], begun.get(tenant, 0), number, id_))
        counts[tenant] += 1
    return [id_ for *_, id_ in sorted(keyed)]
