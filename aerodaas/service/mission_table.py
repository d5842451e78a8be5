"""The missions that are not over, with the database of all: found by id, and kept."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path

from aerodaas.dataflow.mission_document import MissionDocument
from aerodaas.protocol.schemas import MissionOut, Role
from aerodaas.service.access.principal import Principal, sees
from aerodaas.service.errors import RefusedError
from aerodaas.service.mission import ActiveMission, shown
from aerodaas.service.store import Mission, Store

__all__ = ["MissionTable"]


class MissionTable:
    """Missions by id; who changes one holds `lock`, who only looks need not."""

    def __init__(self, store: Store, folder: Path) -> None:
        """Take up the missions of the database that are not over.

        Args:
            store: The open database.
            folder: Folder of all missions' own.
        """
        self._store = store
        self._folder = folder
        self.lock = threading.RLock()
        self.missions: dict[str, ActiveMission] = {
            row.id: self._active(row) for row in store.missions.open()
        }
        """Those that are not over, and those that have ended in this turn."""

    def path(self, mission: str) -> Path:
        """Folder of a mission."""
        return self._folder / mission

    def add(
        self, row: Mission, document: MissionDocument, find: Callable[[], ActiveMission | None]
    ) -> ActiveMission:
        """Keep a new mission, or find the same one, which may have been sent twice at once.

        Args:
            row: Its row.
            document: Its document.
            find: Finds the same one; what it raises keeps the new one out.
        """
        mission = self._active(row)
        mission.write(document)
        with self.lock:
            try:
                earlier = find()
                if earlier is None:
                    self._store.missions.add(row)
                    self.missions[row.id] = mission
            finally:
                if row.id not in self.missions:
                    mission.discard()
        return earlier or mission

    def of_row(self, row: Mission) -> ActiveMission:
        """The mission of a row, over or not."""
        return self.missions.get(row.id) or self._active(row)

    def any(self, mission: str) -> ActiveMission:
        """A mission, over or not; raises RefusedError if there is none."""
        active = self.missions.get(mission)
        return active or self._active(self._store.missions.require(mission))

    def open(self, mission: str) -> ActiveMission:
        """A mission that is not over; raises RefusedError for any other."""
        active = self.missions.get(mission)
        # One that is over stays among them until the next turn.
        if active is None or active.over:
            phase = self.any(mission).phase.value
            raise RefusedError(409, f"{mission} is over: {phase}")
        return active

    def seen(self, principal: Principal, mission: str) -> ActiveMission:
        """A mission that an account may see, over or not.

        Args:
            principal: The account that asks.
            mission: Id of the mission.

        Raises:
            RefusedError: For any other, as if there were none.
        """
        try:
            active = self.any(mission)
        except RefusedError:
            active = None
        if active is None or not sees(
            principal, active.row.tenant, active.row.request.get("share", ())
        ):
            raise RefusedError(404, f"there is no mission {mission!r}")
        return active

    def require_own(self, principal: Principal, mission: str) -> ActiveMission:
        """A mission that an account may command, over or not.

        Args:
            principal: The account that asks.
            mission: Id of the mission.

        Raises:
            RefusedError: If it may not.
        """
        active = self.seen(principal, mission)
        tenant = active.row.tenant
        if tenant != principal.tenant and not principal.role.reaches(Role.OPERATOR):
            raise RefusedError(403, f"{mission} is {tenant}'s: you may watch it")
        return active

    def shown(self, mission: str) -> MissionOut:
        """A mission with its newest state, whoever asks."""
        # Without the lock, which is held while flights are asked: whoever watches does not wait.
        return shown(self.any(mission))

    def _active(self, row: Mission) -> ActiveMission:
        return ActiveMission(row, Path(row.folder), self._store.missions.put)
