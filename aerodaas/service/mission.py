"""One mission on its way: rehearsed, queued for its lease, flown, over."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import shutil
import signal
import subprocess
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from aerodaas.dataflow.mission_document import MissionDocument, read_mission
from aerodaas.errors import MissionError
from aerodaas.files.private_file import write_private
from aerodaas.protocol.schemas import (
    FlightLeaseIn,
    LeaseState,
    MissionOut,
    MissionPhase,
    VerdictOut,
)
from aerodaas.service.errors import without_folders
from aerodaas.service.flights.folder import FlightFolder, start_process
from aerodaas.service.flights.link import FlightLink
from aerodaas.service.flights.orders import FlightOrder, Outcome
from aerodaas.service.models.model_store import ModelStore
from aerodaas.service.store import Lease, Mission, Usage

__all__ = [
    "CANCELLED_BY",
    "FOLLOWING",
    "ActiveMission",
    "LostFlightError",
    "fingerprint_of",
    "shown",
    "usage_of",
]

_P = MissionPhase
FOLLOWING = {
    _P.PROPOSED: {_P.REHEARSING, _P.AWAITING_APPROVAL, _P.CANCELLED},
    _P.SUBMITTED: {_P.REHEARSING, _P.AWAITING_APPROVAL, _P.QUEUED, _P.REFUSED, _P.CANCELLED},
    _P.REHEARSING: {
        _P.PROPOSED,
        _P.AWAITING_APPROVAL,
        _P.QUEUED,
        _P.APPLIED,
        _P.REFUSED,
        _P.CANCELLED,
    },
    _P.AWAITING_APPROVAL: {_P.PROPOSED, _P.QUEUED, _P.APPLIED, _P.REFUSED, _P.CANCELLED},
    _P.QUEUED: {_P.PROPOSED, _P.FLYING, _P.REFUSED, _P.CANCELLED, _P.FAILED},
    _P.FLYING: {_P.LANDED, _P.CANCELLED, _P.FAILED},
}
"""Phases that may follow each one."""


CANCELLED_BY = "cancelled by "
"""How the reason of a cancelled mission begins."""
_LAST_WORDS = 300
"""Characters of a dead process' log that are told."""


class LostFlightError(Exception):
    """A flight's process has died in flight: nobody here knows where its drones are."""


class ActiveMission:
    """A mission that is not over, with its folders and processes; for one thread at a time."""

    def __init__(self, row: Mission, path: Path, save: Callable[[Mission], None]) -> None:
        """Take up a mission.

        Args:
            row: Its row in the database.
            path: Its folder.
            save: Writes a changed row.
        """
        self.row = row
        self._document = path / "mission.json"
        self.flight = FlightFolder(path / "f")
        self.rehearsal = FlightFolder(path / "r")
        self.link: FlightLink | None = None
        self._linking = threading.Lock()
        self.version = 0
        """Counts the changes."""
        self.waits_for = ""
        """Reason for which it waits in its phase; empty if that is the reason of its row."""
        self.handing_over = False
        """Whether the monitor is to let go of its drones, for it flies next."""
        self._save = save
        self._rehearsing: subprocess.Popen[bytes] | None = None
        self._flying: subprocess.Popen[bytes] | None = None
        """Processes that this service has started; the flight's is never ended from here."""
        self._rehearsed_since = time.monotonic()
        self._rehearsed_flights = 1
        self._known_lease: FlightLeaseIn | None = None
        """The last state of its lease that its flight was told."""
        self._missed_lease: tuple[FlightLeaseIn, int] | None = None
        """One that it was not, with the number of states that it had told then."""

    def write(self, document: MissionDocument) -> None:
        """Keep the document."""
        self._document.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        write_private(self._document, document.text())

    def discard(self) -> None:
        """Remove what `write` has kept, of a mission that is not taken in after all."""
        shutil.rmtree(self._document.parent)

    def document(self) -> MissionDocument:
        """The document; raises ConfigError if its file is gone."""
        return read_mission(self._document)

    @property
    def phase(self) -> MissionPhase:
        """Its phase."""
        return self.row.phase

    @property
    def over(self) -> bool:
        """Whether nothing follows any more."""
        return self.phase.over

    def set_phase(self, phase: MissionPhase, reason: str = "", **changes: object) -> None:
        """Change the phase, and what else changes with it.

        Args:
            phase: The next phase.
            reason: Why.
            **changes: Further columns of its row.
        """
        assert phase in FOLLOWING[self.phase], (self.phase, phase)  # noqa: S101 - our own order
        self.change(phase=phase, reason=reason, **changes)

    def change(self, **changes: object) -> None:
        """Change the row; the database is written first."""
        row = replace(self.row, **changes)  # type: ignore[arg-type]
        self._save(row)
        self.row = row
        self.waits_for = ""
        self.version += 1

    def set_waiting(self, what: str) -> None:
        """Tell what a mission in this phase waits for; the database need not know."""
        if what != self.waits_for:
            self.waits_for = what
            self.version += 1

    @property
    def is_proposal(self) -> bool:
        """Whether it was proposed, and flies by an approval of exactly what it is."""
        return "proposal" in self.row.request

    @property
    def attached_to(self) -> str | None:
        """The mission by whose cameras this one senses; None for one that flies itself."""
        found: str | None = self.row.request.get("attach")
        return found

    @property
    def grants(self) -> dict[str, list[str]]:
        """Cameras by tenant that may attach missions; an empty list is all of them."""
        return dict(self.row.request.get("grants", {}))

    @property
    def rehearsal_lost(self) -> bool:
        """Whether a former service began the rehearsal, which ended with it, without a result."""
        return self._rehearsing is None and self.rehearsal.outcome() is None

    def rehearse(self, order: FlightOrder, models: ModelStore) -> None:
        """Start the rehearsal, in place of what one of a former service has left.

        Args:
            order: Order of the flight.
            models: Models of the tenants.
        """
        self.forget_rehearsal()
        self._prepare(self.rehearsal, order, models)
        self._rehearsing = start_process(self.rehearsal, tied=True, vehicles=False)
        self._rehearsed_since = time.monotonic()
        self._rehearsed_flights = max(1, len(order.seeds))

    def forget_rehearsal(self) -> None:
        """End the rehearsal, and remove all that it has left."""
        self.end_rehearsal()
        shutil.rmtree(self.rehearsal.path, ignore_errors=True)

    def verdict(self, seconds: float) -> VerdictOut | None:
        """The rehearsal's verdict; None while it goes on.

        `seconds` are the most wall seconds of each of its flights.
        """
        seconds *= self._rehearsed_flights
        ended = self._rehearsing is None or self._rehearsing.poll() is not None
        if not ended or self.rehearsal.flying:
            if time.monotonic() - self._rehearsed_since < seconds:
                return None
            self.end_rehearsal()
            text = (
                f"the provider is busy: its rehearsal did not end within {seconds:g} s: submit it "
                "again later"
            )
            return VerdictOut(approved=False, reasons=[text])
        self._rehearsing = None
        outcome = self.rehearsal.outcome()
        if outcome is not None and outcome.verdict is not None:
            return outcome.verdict
        return VerdictOut(approved=False, reasons=[f"the rehearsal failed: {self._last_words()}"])

    def end_rehearsal(self) -> None:
        """End the rehearsal's process, and all that it has started."""
        process, self._rehearsing = self._rehearsing, None
        if process is not None and process.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()

    def prepare_flight(self, order: FlightOrder, models: ModelStore) -> None:
        """Write down the flight's order, before anything of it begins.

        Args:
            order: Order of the flight.
            models: Models of the tenants.
        """
        self._prepare(self.flight, order, models)
        self._known_lease = FlightLeaseIn(ends=order.ends)

    def start_flight(self) -> None:
        """Start the flight's process; one that was begun, by whatever service, begins no more."""
        if self._flying is None and not self.flight.begun:
            own = self.attached_to is None
            self._flying = start_process(self.flight, tied=False, vehicles=own)

    def cancel_flight(self, reason: str) -> None:
        """Have the flight's process bring the drones home, also one that does not listen yet.

        Raises AeroDaaSError if this could neither be told nor kept.
        """
        kept = False
        # With the disk full there is still the socket.
        with contextlib.suppress(OSError):
            self.flight.cancel(reason)
            kept = True
        try:
            self.follow().change_lease(FlightLeaseIn(reason=reason))
        except MissionError:
            if not kept:
                raise

    def _prepare(self, folder: FlightFolder, order: FlightOrder, models: ModelStore) -> None:
        document = self.document()
        folder.make(order, document.text())
        models.link_models(self.row.tenant, document, folder.models)

    def end_flight(self) -> None:
        """End the process of an attached mission, which has no drone, and all it has started."""
        if self._flying is not None and self._flying.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self._flying.pid, signal.SIGKILL)

    def follow(self) -> FlightLink:
        """The link to the flight, made when it is first needed, in any thread."""
        with self._linking:
            if self.link is None:
                self.link = FlightLink(self.flight, self._count_change)
            return self.link

    @property
    def recalled(self) -> bool:
        """Whether the flight knows that its lease has ended."""
        return self._known_lease is not None and self._known_lease.ends is None

    def send_lease(self, lease: Lease) -> None:
        """Tell the flight what has become of its lease, unless it knows.

        A flight that is being launched, or hangs, is told again once it has told its state.
        """
        state = FlightLeaseIn(ends=lease.ends)
        if lease.state is LeaseState.ENDED:
            state = FlightLeaseIn(reason=f"the lease has ended: {lease.reason}")
        link = self.follow()
        number = link.number
        if state == self._known_lease or (state, number) == self._missed_lease:
            return
        try:
            link.change_lease(state)
            self._known_lease = state
        except MissionError:
            self._missed_lease = state, number

    def flight_outcome(self) -> Outcome | None:
        """How the flight ended; None while it goes on.

        Raises LostFlightError if its process died in flight.
        """
        if self.flight.flying or (self._flying is not None and self._flying.poll() is None):
            return None
        outcome = self.flight.outcome()
        if outcome is None and self.flight.begun:
            raise LostFlightError(self._last_words())
        if outcome is None:
            text = f"the flight did not begin: {self._last_words()}"
            return Outcome(landed=False, reason=text, began=0.0, ended=0.0)
        return outcome

    def close(self) -> None:
        """Leave the mission to itself: a flight goes on; one that is over needs no models more."""
        self.end_rehearsal()
        if self.over:
            for folder in (self.rehearsal, self.flight):
                shutil.rmtree(folder.models, ignore_errors=True)
        if self.link is not None:
            self.link.close()

    def _count_change(self) -> None:
        self.version += 1

    def _last_words(self) -> str:
        folder = self.flight if self.phase is MissionPhase.FLYING else self.rehearsal
        try:
            lines = folder.log.read_text(errors="replace").strip().splitlines()
        except OSError:
            lines = []
        return lines[-1][-_LAST_WORDS:] if lines else "its process ended without a word"


_LAST = ("status", "places", "alerts")
"""What is told of a mission's drones in flight and afterwards, as `MissionOut` has it."""
_IN_FLIGHT = ("told", "streams", "analytics")
_REQUESTED = ("share", "attach", "grants")


def shown(active: ActiveMission) -> MissionOut:
    """A mission with its newest state: of its flight while it goes on, else as it ended."""
    row, state = active.row, None if active.link is None else active.link.mission
    outcome = active.flight.outcome() if active.over else None
    recorded = active.phase is not MissionPhase.FLYING and active.flight.recording.is_file()
    news: dict[str, Any] = {
        "reason": without_folders(active.waits_for or row.reason),
        "recording": recorded,
        **{name: row.request[name] for name in _REQUESTED if name in row.request},
    }
    if (newest := outcome or state) is not None:
        news |= {name: getattr(newest, name) for name in _LAST}
    if state is not None and not active.over:
        news |= {name: getattr(state, name) for name in _IN_FLIGHT}
    answer = MissionOut.model_validate(row)
    if (verdict := answer.verdict) is not None:
        drawn = active.rehearsal.picture.is_file()
        picture = f"/v1/missions/{row.id}/rehearsal.png" if drawn else verdict.picture
        reasons = [without_folders(reason) for reason in verdict.reasons]
        news["verdict"] = verdict.model_copy(update={"reasons": reasons, "picture": picture})
    return answer.model_copy(update=news)


def fingerprint_of(submission: BaseModel) -> str:
    """SHA-256 of a submission's content, hexadecimal; the order of its keys makes no difference.

    What was left out counts as such: a later version's defaults change no fingerprint.
    """
    content = submission.model_dump(mode="json", exclude_unset=True)
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def usage_of(mission: Mission, outcome: Outcome, recording: Path) -> Usage:
    """Usage of a mission that is over.

    Args:
        mission: The mission.
        outcome: Outcome of its flight.
        recording: File of its recording; one that is missing takes no storage.
    """
    used = Outcome.model_fields.keys() & Usage.__table__.columns.keys()
    return Usage(
        mission=mission.id,
        tenant=mission.tenant,
        account=mission.account,
        started=outcome.began,
        recorded_bytes=recording.stat().st_size if recording.is_file() else 0,
        **outcome.model_dump(include=used),
    )
