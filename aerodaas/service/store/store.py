"""The service's database as one object, with a part for each table."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any, Generic, TypeVar

from sqlalchemy import ColumnElement, Text, delete, func, select, type_coerce
from sqlalchemy.orm import InstrumentedAttribute, Session
from typing_extensions import Self

from aerodaas.protocol.schemas import LeaseState, MissionPhase
from aerodaas.service.errors import RefusedError
from aerodaas.service.store.database import Database
from aerodaas.service.store.rows import (
    Account,
    AuditEntry,
    Lease,
    Mission,
    RobotState,
    Row,
    Tenant,
    Token,
    Usage,
)

__all__ = ["Leases", "Store"]

Kind = TypeVar("Kind", bound=Row)
Order = Iterable[InstrumentedAttribute[Any] | ColumnElement[Any]]


class Rows(Generic[Kind]):
    """The rows of one class, by their keys; each call is one transaction."""

    def __init__(self, database: Database, kind: type[Kind], noun: str) -> None:
        """Keep rows of `kind`, which errors call `noun`, in an open database."""
        self._database = database
        self._kind = kind
        self._noun = noun
        self._table = kind.metadata.tables[kind.__tablename__]
        (self._key,) = self._table.primary_key

    def all(self) -> list[Kind]:
        """All rows, by key."""
        return self._select()

    def add(self, row: Kind) -> None:
        """Keep a new row.

        Raises:
            RefusedError: With status 409, if there is one of the same key.
            StoreError: If the database does not take it.
        """
        new = self._database.insert(self._table).on_conflict_do_nothing().returning(self._key)
        with self._database.writing() as session:
            if session.execute(new, self._values(row)).one_or_none() is None:
                key = getattr(row, self._key.name)
                raise RefusedError(409, f"there is a {self._noun} {key} already")

    def put(self, *rows: Kind) -> None:
        """Keep all of these in one transaction, each in place of the one of the same key.

        Raises:
            StoreError: If the database does not take them; then none of them is kept.
        """
        with self._database.writing() as session:
            if rows:
                self._write(session, *rows)

    def get(self, key: str) -> Kind | None:
        """The row of a key; None if there is none."""
        with self._database.reading() as session:
            return session.get(self._kind, key)

    def require(self, key: str) -> Kind:
        """The row of a key.

        Raises:
            RefusedError: With status 404, if there is none.
            StoreError: If the database does not answer.
        """
        row = self.get(key)
        if row is None:
            raise RefusedError(404, f"there is no {self._noun} {key}")
        return row

    def update(self, key: str, change: Callable[[Kind], Kind]) -> Kind:
        """Change a row in one transaction, in which nobody else can change it.

        Args:
            key: The row's key.
            change: Returns the changed row, or the given one for no change. What it raises
                leaves the row as it was, and is raised. It must not use the store.

        Returns:
            The row as it is now.

        Raises:
            RefusedError: With status 404, if there is none.
            StoreError: If the database does not take the change.
        """
        with self._database.writing() as session:
            row = session.get(self._kind, key, with_for_update=True)
            if row is None:
                raise RefusedError(404, f"there is no {self._noun} {key}")
            changed = change(row)
            if changed != row:
                self._write(session, changed)
            return changed

    def _select(
        self,
        *conditions: ColumnElement[bool],
        order: Order = (),
        limit: int | None = None,
        **equal: str | None,
    ) -> list[Kind]:
        """Rows by conditions and by what columns equal, if it is not None; then by key."""
        given = {name: value for name, value in equal.items() if value is not None}
        statement = select(self._kind).where(*conditions).filter_by(**given)
        with self._database.reading() as session:
            return list(session.scalars(statement.order_by(*order, self._key).limit(limit)))

    def _write(self, session: Session, *rows: Kind) -> None:
        new = self._database.insert(self._table)
        new = new.on_conflict_do_update(index_elements=[self._key], set_=dict(new.excluded))
        session.execute(new, [self._values(row) for row in rows])

    def _values(self, row: Kind) -> dict[str, Any]:
        return {column.name: getattr(row, column.name) for column in self._table.columns}


class Accounts(Rows[Account]):
    """Accounts, by name."""

    def of_subject(self, subject: str) -> Account | None:
        """The account of a subject of an issuer; None before its first request."""
        return next(iter(self._select(subject=subject)), None)


class Tokens(Rows[Token]):
    """Tokens, by id."""

    def all(self, account: str | None = None) -> list[Token]:
        """Tokens of an account, or all, oldest first."""
        return self._select(account=account, order=[Token.created])

    def owned(self, id_: str) -> tuple[Token, Account] | None:
        """A token and its account; None if there is none of this id."""
        owner = Token.account == Account.name
        statement = select(Token, Account).join(Account, owner).where(Token.id == id_)
        with self._database.reading() as session:
            for token, account in session.execute(statement):
                return token, account
        return None


class Leases(Rows[Lease]):
    """Leases, by id."""

    def live(self) -> list[Lease]:
        """Leases that are queued or granted, in the queue's order."""
        return self._select(Lease.state != LeaseState.ENDED, order=[Lease.number])

    def highest_number(self) -> int:
        """The highest place in the queue that was ever given; 0 before the first."""
        with self._database.reading() as session:
            return session.scalar(select(func.max(Lease.number))) or 0


class Missions(Rows[Mission]):
    """Missions, by id."""

    def open(self) -> list[Mission]:
        """All that are not over, oldest first."""
        still = [phase for phase in MissionPhase if not phase.over]
        return self._select(Mission.phase.in_(still), order=[Mission.submitted])

    def newest(self, limit: int, tenant: str | None = None) -> list[Mission]:
        """The newest of a tenant, or of all, newest first.

        Args:
            limit: Most rows.
            tenant: Name of the tenant; None for all.
        """
        return self._select(tenant=tenant, order=[Mission.submitted.desc()], limit=limit)

    def newest_shared(self, limit: int, tenant: str) -> list[Mission]:
        """The newest of other tenants that name `tenant` in their requests, newest first.

        Args:
            limit: Most rows.
            tenant: Name of the tenant.
        """
        named = type_coerce(Mission.request, Text).contains(json.dumps(tenant), autoescape=True)
        others = Mission.tenant != tenant
        return self._select(others, named, order=[Mission.submitted.desc()], limit=limit)

    def of_key(self, tenant: str, key: str) -> Mission | None:
        """A tenant's mission by the idempotency key of its submission; None if there is none.

        Args:
            tenant: Name of the tenant.
            key: The idempotency key.
        """
        return next(iter(self._select(tenant=tenant, key=key)), None)


class Usages(Rows[Usage]):
    """Usage by mission."""

    def all(self, tenant: str | None = None) -> list[Usage]:
        """Usage of a tenant, or of all, oldest first."""
        return self._select(tenant=tenant, order=[Usage.started])

    def total(self, tenant: str, since: float) -> tuple[float, int]:
        """Flight seconds and cloud calls of a tenant's missions that started since then.

        Args:
            tenant: Name of the tenant.
            since: Earliest start, seconds since the Unix epoch.
        """
        used = select(func.sum(Usage.flight_seconds), func.sum(Usage.cloud_calls))
        chosen = used.where(Usage.tenant == tenant, Usage.started >= since)
        with self._database.reading() as session:
            flown, calls = session.execute(chosen).one()
        return float(flown or 0), int(calls or 0)

    def stored_bytes(self, tenant: str) -> int:
        """Bytes of a tenant's recordings that are kept."""
        total = select(func.sum(Usage.recorded_bytes)).where(Usage.tenant == tenant, Usage.kept)
        with self._database.reading() as session:
            return int(session.scalar(total) or 0)


class AuditLog:
    """Entries of the audit log, which only grow; see `aerodaas.service.access.audit.Audit`."""

    def __init__(self, database: Database) -> None:
        """Keep in an open database."""
        self._database = database

    def add(self, *entries: AuditEntry) -> int:
        """Keep entries in their order; the database numbers them.

        Returns:
            The number of the last one.
        """
        # Copies: an entry that the database does not take is given again.
        rows = [replace(entry) for entry in entries]
        with self._database.writing() as session:
            session.add_all(rows)
            session.flush()
        return rows[-1].number if rows else 0

    def newest(self, limit: int) -> list[AuditEntry]:
        """The newest entries, at most `limit`, newest first."""
        statement = select(AuditEntry).order_by(AuditEntry.number.desc()).limit(limit)
        with self._database.reading() as session:
            return list(session.scalars(statement))

    def trim(self, below: int) -> None:
        """Drop those whose number is below `below`."""
        with self._database.writing() as session:
            session.execute(delete(AuditEntry).where(AuditEntry.number < below))


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
        self.tenants = Rows(database, Tenant, "tenant")
        self.accounts = Accounts(database, Account, "account")
        self.tokens = Tokens(database, Token, "token")
        self.leases = Leases(database, Lease, "lease")
        self.missions = Missions(database, Mission, "mission")
        self.robots = Rows(database, RobotState, "robot")
        self.audit = AuditLog(database)
        self.usage = Usages(database, Usage, "usage of mission")

    @classmethod
    def open(cls, where: Path | str) -> Store:
        """Open a database, make its tables if it has none, and bring older ones up to date.

        Args:
            where: File of an SQLite database, made with mode 0600 if it is missing, or a URL:
                `sqlite:///FILE` or `postgresql://USER:PASSWORD@HOST/NAME` (needs psycopg).

        Raises:
            StoreError: If it cannot be opened, or its tables are of a version that is newer, or
                older than any migration.
        """
        return cls(Database(where))

    def close(self) -> None:
        """Close its connections."""
        self._database.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
