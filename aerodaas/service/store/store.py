"""The service's database, as one object with a part for each table."""

from __future__ import annotations

from pathlib import Path

from typing_extensions import Self

from aerodaas.service.store.database import Database
from aerodaas.service.store.parts import (
    Accounts,
    AuditLog,
    Leases,
    Missions,
    Robots,
    Tenants,
    Tokens,
    Usages,
)

__all__ = ["Store"]


class Store:
    """Keeps what must outlive the service; each call of a part is one transaction.

    Threads may share it. Every call of every part raises StoreError for a database that is full,
    missing, locked or out of reach; nothing was changed then.

    ```python
    with Store.open(state / "service.db") as store:
        store.missions.add(mission)
        store.missions.update(mission.id, lambda row: replace(row, phase=MissionPhase.FLYING))
    ```
    """

    def __init__(self, database: Database) -> None:
        """Keep in an open database; see `open`."""
        self._database = database
        self.tenants = Tenants(database)
        self.accounts = Accounts(database)
        self.tokens = Tokens(database)
        self.leases = Leases(database)
        self.missions = Missions(database)
        self.robots = Robots(database)
        self.audit = AuditLog(database)
        self.usage = Usages(database)

    @classmethod
    def open(cls, where: Path | str) -> Store:
        """Open a database, and make its tables if it has none.

        Args:
            where: File of an SQLite database, made with mode 0600 if it is missing, or a URL:
                `sqlite:///FILE` or `postgresql://USER:PASSWORD@HOST/NAME` (needs psycopg).

        Raises:
            StoreError: If it cannot be opened, or was made by another version.
        """
        return cls(Database(where))

    def close(self) -> None:
        """Close its connections."""
        self._database.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
