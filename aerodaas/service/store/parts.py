"""The parts of the store, one a table, with the questions that the service asks of each."""

from __future__ import annotations

import dataclasses
import json
from typing import Any

from sqlalchemy import (
    ColumnElement,
    Text,
    bindparam,
    delete,
    func,
    insert,
    select,
    true,
    type_coerce,
)

from aerodaas.protocol.schemas import LeaseState, MissionPhase
from aerodaas.service.store import tables
from aerodaas.service.store.database import Database
from aerodaas.service.store.rows import (
    Account,
    AuditEntry,
    Lease,
    Mission,
    RobotState,
    Tenant,
    Token,
    Usage,
)
from aerodaas.service.store.table import Rows

__all__ = [
    "Accounts",
    "AuditLog",
    "Leases",
    "Missions",
    "Robots",
    "Tenants",
    "Tokens",
    "Usages",
]

_OWNED = (
    select(tables.TOKENS, tables.ACCOUNTS)
    .join(tables.ACCOUNTS, tables.TOKENS.c.account == tables.ACCOUNTS.c.name)
    .where(tables.TOKENS.c.id == bindparam("token"))
)
"""A token with its account. Each request asks this, so that it is put together once."""


class Tenants(Rows[Tenant]):
    """Tenants, by name."""

    _table, _kind, _what = tables.TENANTS, Tenant, "tenant"

    def all(self) -> list[Tenant]:
        """All of them, by name."""
        return self._select()


class Accounts(Rows[Account]):
    """Accounts, by name."""

    _table, _kind, _what = tables.ACCOUNTS, Account, "account"

    def all(self, tenant: str | None = None) -> list[Account]:
        """Those of a tenant, or all, by name."""
        return self._select(_is(tables.ACCOUNTS.c.tenant, tenant))

    def of_subject(self, subject: str) -> Account | None:
        """The account of a subject of an issuer; None before its first request."""
        return next(iter(self._select(tables.ACCOUNTS.c.subject == subject, limit=1)), None)


class Tokens(Rows[Token]):
    """Tokens, by id."""

    _table, _kind, _what = tables.TOKENS, Token, "token"

    def all(self, account: str | None = None) -> list[Token]:
        """Those of an account, or all, oldest first."""
        columns = tables.TOKENS.c
        return self._select(_is(columns.account, account), order=[columns.created])

    def owned(self, id_: str) -> tuple[Token, Account] | None:
        """A token and its account; None if there is none of this id."""
        with self._database.reading() as connection:
            found = connection.execute(_OWNED, {"token": id_}).one_or_none()
        if found is None:
            return None
        length = len(tables.TOKENS.c)
        return Token(*found[:length]), Account(*found[length:])


class Leases(Rows[Lease]):
    """Leases, by id."""

    _table, _kind, _what = tables.LEASES, Lease, "lease"

    def live(self) -> list[Lease]:
        """Those that are queued or granted, in the queue's order."""
        columns = tables.LEASES.c
        return self._select(columns.state != LeaseState.ENDED, order=[columns.number])

    def all(self, tenant: str | None = None, limit: int | None = None) -> list[Lease]:
        """The newest of a tenant, or of all, newest first."""
        columns = tables.LEASES.c
        return self._select(_is(columns.tenant, tenant), order=[columns.number.desc()], limit=limit)

    def highest_number(self) -> int:
        """The highest place in the queue that was ever given; 0 before the first."""
        with self._database.reading() as connection:
            return connection.execute(select(func.max(tables.LEASES.c.number))).scalar() or 0


class Missions(Rows[Mission]):
    """Missions, by id."""

    _table, _kind, _what = tables.MISSIONS, Mission, "mission"

    def open(self) -> list[Mission]:
        """All that are not over, oldest first."""
        columns = tables.MISSIONS.c
        still = [phase for phase in MissionPhase if not phase.over]
        return self._select(columns.phase.in_(still), order=[columns.submitted])

    def newest(self, limit: int, tenant: str | None = None) -> list[Mission]:
        """The newest of a tenant, or of all, newest first."""
        columns = tables.MISSIONS.c
        order = [columns.submitted.desc()]
        return self._select(_is(columns.tenant, tenant), order=order, limit=limit)

    def newest_shared(self, limit: int, tenant: str) -> list[Mission]:
        """The newest of other tenants that name `tenant` in their requests, newest first."""
        columns = tables.MISSIONS.c
        named = type_coerce(columns.request, Text).contains(json.dumps(tenant), autoescape=True)
        order = [columns.submitted.desc()]
        return self._select(columns.tenant != tenant, named, order=order, limit=limit)

    def of_key(self, tenant: str, key: str) -> Mission | None:
        """A tenant's mission by the idempotency key of its submission; None if there is none."""
        columns = tables.MISSIONS.c
        found = self._select(columns.tenant == tenant, columns.key == key, limit=1)
        return next(iter(found), None)


class Robots(Rows[RobotState]):
    """What is known of drones, by id."""

    _table, _kind, _what = tables.ROBOTS, RobotState, "robot"

    def all(self) -> list[RobotState]:
        """All of them, by id."""
        return self._select()


class Usages(Rows[Usage]):
    """What missions have used, by mission."""

    _table, _kind, _what = tables.USAGE, Usage, "usage of mission"

    def all(
        self, tenant: str | None = None, since: float | None = None, limit: int | None = None
    ) -> list[Usage]:
        """Those of a tenant, or of all, that started at `since` or later; oldest first."""
        columns = tables.USAGE.c
        later = true() if since is None else columns.started >= since
        return self._select(
            _is(columns.tenant, tenant), later, order=[columns.started], limit=limit
        )

    def total(self, tenant: str, since: float) -> tuple[float, int]:
        """Flight seconds and cloud calls of a tenant's missions that started since then."""
        columns = tables.USAGE.c
        used = (columns.flight_seconds, columns.cloud_calls)
        chosen = (columns.tenant == tenant) & (columns.started >= since)
        statement = select(*map(func.sum, used)).where(chosen)
        with self._database.reading() as connection:
            flown, calls = tuple(connection.execute(statement).one())
        return float(flown or 0), int(calls or 0)

    def stored_bytes(self, tenant: str) -> int:
        """Bytes of a tenant's recordings that are kept."""
        columns = tables.USAGE.c
        chosen = (columns.tenant == tenant) & columns.kept
        with self._database.reading() as connection:
            total = connection.execute(select(func.sum(columns.recorded_bytes)).where(chosen))
            return int(total.scalar() or 0)


class AuditLog:
    """Entries of the audit log, which only grow; see `aerodaas.service.access.Audit`."""

    def __init__(self, database: Database) -> None:
        """Keep in an open database."""
        self._database = database

    def add(self, *entries: AuditEntry) -> int:
        """Keep entries in their order; the database numbers them.

        Returns:
            The number of the last one.
        """
        number = 0
        with self._database.writing() as connection:
            for entry in entries:
                values = dataclasses.asdict(entry)
                del values["number"]
                done = connection.execute(insert(tables.AUDIT).values(values))
                (number,) = done.inserted_primary_key or (0,)
        return number

    def all(self, tenant: str | None = None, limit: int | None = None) -> list[AuditEntry]:
        """The newest of a tenant, or of all, newest first."""
        columns = tables.AUDIT.c
        statement = (
            select(tables.AUDIT)
            .where(_is(columns.tenant, tenant))
            .order_by(columns.number.desc())
            .limit(limit)
        )
        with self._database.reading() as connection:
            return [AuditEntry(*found) for found in connection.execute(statement)]

    def trim(self, below: int) -> None:
        """Drop those whose number is below `below`."""
        with self._database.writing() as connection:
            connection.execute(delete(tables.AUDIT).where(tables.AUDIT.c.number < below))


def _is(column: ColumnElement[Any], wanted: str | None) -> ColumnElement[bool]:
    return true() if wanted is None else column == wanted
