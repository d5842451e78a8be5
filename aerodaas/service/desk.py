"""The desk: takes missions in, moves them on, and answers for those that there are."""

from __future__ import annotations

import logging
import secrets
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from aerodaas.analytics.remote.schemas import AnswerOut, WaypointsIn
from aerodaas.service.access import Principal, RefusedError
from aerodaas.service.bookings import Bookings
from aerodaas.service.briefing import Briefing
from aerodaas.service.flights.folder import FlightFolder
from aerodaas.service.mission import CANCELLED_BY, ActiveMission, LostFlightError
from aerodaas.service.phases import OVER
from aerodaas.service.quotas import Quotas
from aerodaas.service.records import shown
from aerodaas.protocol.schemas import (
    CommandIn,
    MissionIn,
    MissionOut,
    MissionPhase,
    Role,
)
from aerodaas.service.settings import ServiceSettings
from aerodaas.service.store import MissionRow, Store
from aerodaas.types.errors import AeroDaaSError, MissionError

__all__ = ["MissionDesk"]

_log = logging.getLogger(__name__)
_TURN_SECONDS = 0.1
_HEARD_SECONDS = 1.0
_SLOT_FULL = "as many flights are under way as this provider allows"


class MissionDesk:
    """Missions of all tenants; safe in any thread."""

    def __init__(
        self, settings: ServiceSettings, store: Store, bookings: Bookings, briefing: Briefing,
        quotas: Quotas,
    ) -> None:
        """Take up the missions that the database has; `start` moves them on."""
        self._settings = settings
        self._store = store
        self._bookings = bookings
        self._briefing = briefing
        self._quotas = quotas
        self._lock = threading.RLock()
        self._closed = threading.Event()
        self._heard: dict[str, float] = {}
        self._missions: dict[str, ActiveMission] = {}
        for row in store.open_missions():
            self._missions[row.id] = self._active(row)

    def start(self) -> None:
        """Move missions on from now on, in a thread of its own."""
        threading.Thread(target=self._run, name="desk", daemon=True).start()

    def close(self) -> None:
        """Move on no more; flights go on by themselves."""
        self._closed.set()
        with self._lock:
            for one in self._missions.values():
                one.close()

    def submit(self, principal: Principal, wanted: MissionIn) -> MissionOut:
        """Take a mission in.

        Raises RefusedError, with the reason, for one that cannot be flown here.
        """
        robots = self._briefing.check(principal, wanted.document)
        self._quotas.require_flight(principal.tenant, wanted.minutes)
        if wanted.lease is not None:
            self._bookings.require(principal, wanted.lease, robots)
        row = MissionRow(
            id=secrets.token_hex(6),
            name=wanted.document.name or "mission",
            tenant=principal.tenant,
            account=principal.account,
            phase=MissionPhase.SUBMITTED,
            robots=tuple(robots),
            lease=wanted.lease,
            submitted=time.time(),
            request=wanted.model_dump_json(),
        )
        with self._lock:
            self._store.add_mission(row)
            mission = self._missions[row.id] = self._active(row)
        return shown(mission)

    def approve(self, principal: Principal, mission: str) -> MissionOut:
        """Approve a mission that waits for it."""
        with self._lock:
            one = self._one(mission)
            if one.phase is not MissionPhase.AWAITING_APPROVAL:
                raise RefusedError(409, f"{mission} does not wait for approval: {one.phase.value}")
            one.to(MissionPhase.QUEUED, f"approved by {principal.account}")
            return shown(one)

    def cancel(self, principal: Principal, mission: str) -> MissionOut:
        """Cancel a mission; drones in flight come home first."""
        self._require_own(principal, mission)
        with self._lock:
            one = self._one(mission)
            reason = f"{CANCELLED_BY}{principal.account}"
            if one.phase is not MissionPhase.FLYING:
                one.end_rehearsal()
                self._end(one, MissionPhase.CANCELLED, reason)
                return shown(one)
        one.follow().ask(do="end", reason=reason)
        return shown(one)

    def command(self, principal: Principal, mission: str, command: CommandIn) -> AnswerOut:
        """Give a robot of a flying mission a command; raises MissionError if it is lost."""
        return self._ask(principal, mission, do=command.command, robot=command.robot)

    def fly(self, principal: Principal, mission: str, robot: str, body: WaypointsIn) -> AnswerOut:
        """Add waypoints to a flying mission; raises MissionError if it is lost."""
        waypoints = body.model_dump()
        return self._ask(principal, mission, do="fly", robot=robot, waypoints=waypoints)

    def _ask(self, principal: Principal, mission: str, **request: Any) -> AnswerOut:  # noqa: ANN401
        self._require_own(principal, mission)
        with self._lock:
            one = self._one(mission)
            if one.phase is not MissionPhase.FLYING:
                raise RefusedError(409, f"{mission} is not flying: {one.phase.value}")
            link = one.follow()
        return link.ask(operator=principal.may(Role.OPERATOR), **request)

    def mission(self, principal: Principal, mission: str) -> MissionOut:
        """A mission that this account may see; raises RefusedError for any other."""
        found = self.shown(mission)
        if not self._sees(principal, found):
            raise RefusedError(404, f"there is no mission {mission!r}")
        return found

    def missions(self, principal: Principal) -> list[MissionOut]:
        """All missions that this account may see, newest first."""
        with self._lock:
            found = [self._with_news(row) for row in self._store.missions()]
        return [one for one in found if self._sees(principal, one)]

    def shown(self, mission: str) -> MissionOut:
        """A mission, whoever asks."""
        with self._lock:
            one = self._missions.get(mission)
            if one is not None:
                return shown(one)
        row = self._store.mission(mission)
        if row is None:
            raise RefusedError(404, f"there is no mission {mission!r}")
        return shown(self._active(row))

    def version(self, mission: str) -> int:
        """A number that grows with each change of a mission; -1 once it is over."""
        one = self._missions.get(mission)
        return -1 if one is None else one.version

    def flies(self, principal: Principal, mission: str) -> bool:
        """Whether a mission is this account's own, so that its presence counts."""
        found = self.shown(mission)
        return found.tenant == principal.tenant and principal.may(Role.PILOT)

    def hear(self, mission: str) -> None:
        """Note that the user of a mission is there."""
        now = time.monotonic()
        one = self._missions.get(mission)
        if one is None or one.phase is not MissionPhase.FLYING:
            return
        if now - self._heard.get(mission, 0.0) >= _HEARD_SECONDS:
            self._heard[mission] = now
            try:
                one.follow().ask(do="heard")
            except MissionError:
                return

    def items(self, mission: str, stream: str) -> Iterator[tuple[dict[str, Any], bytes]]:
        """Items of a flying mission's stream; raises AeroDaaSError if there is none."""
        with self._lock:
            one = self._one(mission)
            if one.phase is not MissionPhase.FLYING:
                raise MissionError(f"{mission} is not flying")
            link = one.follow()
        return link.items(stream)

    def file(self, principal: Principal, mission: str, name: str) -> Path:
        """The recording or the rehearsal's picture of a mission; raises RefusedError if none."""
        found = self.mission(principal, mission)
        path = self._path(found.id)
        files = {
            "recording": FlightFolder(path / "f").recording,
            "picture": FlightFolder(path / "r").picture,
        }
        if not files[name].is_file() or (name == "recording" and found.phase not in OVER):
            raise RefusedError(404, f"{mission} has no {name} yet")
        return files[name]

    def lease_changed(self, lease: str, ends: float | None, reason: str = "") -> None:
        """Tell a flying mission that its lease was extended, or has ended."""
        with self._lock:
            flying = [
                one
                for one in self._missions.values()
                if one.row.lease == lease and one.phase is MissionPhase.FLYING
            ]
        for one in flying:
            if ends is not None:
                one.follow().ask(do="extend", ends=ends)
            else:
                one.follow().ask(do="end", reason=reason)

    def _run(self) -> None:
        while not self._closed.wait(_TURN_SECONDS):
            try:
                self.turn()
            except AeroDaaSError:
                # The database may be gone for a while; flights do not need it.
                _log.exception("the desk could not move on")

    def turn(self) -> None:
        """Move every mission on by what has happened."""
        with self._lock:
            for one in list(self._missions.values()):
                self._step(one)
                if one.over:
                    one.close()
                    del self._missions[one.row.id]
            busy = {
                robot
                for one in self._missions.values()
                if one.phase is MissionPhase.FLYING
                for robot in one.row.robots
            }
            self._bookings.advance(busy)

    def _step(self, one: ActiveMission) -> None:
        steps: dict[MissionPhase, Callable[[ActiveMission], None]] = {
            MissionPhase.SUBMITTED: self._begin,
            MissionPhase.REHEARSING: self._judge,
            MissionPhase.QUEUED: self._take_off,
            MissionPhase.FLYING: self._watch,
        }
        step = steps.get(one.phase)
        if step is not None:
            step(one)

    def _begin(self, one: ActiveMission) -> None:
        if not self._settings.rehearse:
            self._admit(one)
            return
        wanted = MissionIn.model_validate_json(one.row.request)
        order = self._briefing.rehearsal(one.row, wanted)
        one.rehearse(order, wanted.document)
        self._briefing.lend(wanted.document, one.rehearsal)
        one.start_rehearsal()
        one.to(MissionPhase.REHEARSING, started=None)

    def _judge(self, one: ActiveMission) -> None:
        verdict = one.verdict()
        if verdict is None:
            return
        text = verdict.model_dump_json()
        if not verdict.approved:
            one.to(MissionPhase.REFUSED, "; ".join(verdict.reasons), verdict=text, ended=time.time())
            return
        one.row = one.row.with_verdict(text)
        self._admit(one)

    def _admit(self, one: ActiveMission) -> None:
        if self._settings.approval:
            one.to(MissionPhase.AWAITING_APPROVAL, "waits for an operator's approval")
        else:
            one.to(MissionPhase.QUEUED, "waits for its drones")

    def _take_off(self, one: ActiveMission) -> None:
        wanted = MissionIn.model_validate_json(one.row.request)
        if one.row.lease is None:
            lease = self._bookings.for_mission(one.row, wanted.minutes)
            one.row = one.row.with_lease(lease.id)
            self._store.save_mission(one.row)
        lease = self._bookings.lease(one.row.lease)
        if lease.ended:
            self._end(one, MissionPhase.REFUSED, f"its lease has ended: {lease.reason}")
        elif lease.granted and self._free_slot():
            order = self._briefing.flight(one.row, wanted, lease)
            one.take_off(order, wanted.document)
            self._briefing.lend(wanted.document, one.flight)
            one.to(MissionPhase.FLYING, started=time.time())
            one.start_flight()
            one.follow()

    def _free_slot(self) -> bool:
        flying = [one for one in self._missions.values() if one.phase is MissionPhase.FLYING]
        return len(flying) < self._settings.most_flights

    def _watch(self, one: ActiveMission) -> None:
        link = one.follow()
        self._briefing.heard(link.news.status)
        try:
            outcome = one.flown()
        except LostFlightError as error:
            reason = (
                f"its process died in flight ({error}); its drones are out of service until an "
                "operator has looked"
            )
            self._briefing.take_out_of_service(one.row.robots, f"mission {one.row.id} was lost")
            self._end(one, MissionPhase.FAILED, reason)
            return
        if outcome is None:
            return
        self._briefing.heard(outcome.status)
        self._quotas.account(one.row, outcome, one.flight.recording)
        phase = MissionPhase.LANDED if outcome.landed else MissionPhase.FAILED
        if outcome.landed and outcome.reason.startswith(CANCELLED_BY):
            phase = MissionPhase.CANCELLED
        self._end(one, phase, outcome.reason)

    def _end(self, one: ActiveMission, phase: MissionPhase, reason: str) -> None:
        one.to(phase, reason, ended=time.time())
        if one.row.lease is not None:
            self._bookings.give_back_own(one.row)

    def _active(self, row: MissionRow) -> ActiveMission:
        return ActiveMission(row, self._path(row.id), self._store.save_mission)

    def _path(self, mission: str) -> Path:
        return self._settings.missions / mission

    def _one(self, mission: str) -> ActiveMission:
        one = self._missions.get(mission)
        if one is None:
            phase = self.shown(mission).phase.value
            raise RefusedError(409, f"{mission} is over: {phase}")
        return one

    def _with_news(self, row: MissionRow) -> MissionOut:
        return shown(self._missions.get(row.id) or self._active(row))

    def _sees(self, principal: Principal, mission: MissionOut) -> bool:
        own = mission.tenant == principal.tenant
        return own or principal.tenant in mission.share or principal.may(Role.OPERATOR)

    def _require_own(self, principal: Principal, mission: str) -> None:
        """Raise RefusedError unless this account may command a mission."""
        found = self.mission(principal, mission)
        if found.tenant != principal.tenant and not principal.may(Role.OPERATOR):
            raise RefusedError(403, f"{mission} is {found.tenant}'s: you may watch it")
