"""Versions of the tables, and the steps from each to the next."""

from __future__ import annotations

from collections.abc import Callable

from sqlalchemy import select, text, update
from sqlalchemy.orm import Session

from aerodaas.service.store.rows import Row, SchemaVersion

__all__ = ["MIGRATIONS", "VERSION", "prepare"]


def _drop_tasks(session: Session) -> None:
    """Analyses are counted as calls of cloud nodes alone."""
    for table in ("tenants", "usage"):
        session.execute(text(f"ALTER TABLE {table} DROP COLUMN tasks"))


MIGRATIONS: dict[int, Callable[[Session], None]] = {2: _drop_tasks}
"""Statements that turn the tables of a version into the next one's, on each kind of database."""
VERSION = 3
"""Of the tables in `rows`: increased, with a migration, whenever they change."""


def prepare(session: Session) -> int:
    """The database has tables of this version, or keeps those that no migration knows.

    Returns:
        The version of its tables now.
    """
    SchemaVersion.metadata.tables["schema_version"].create(session.connection(), checkfirst=True)
    version = session.scalar(select(SchemaVersion.version).with_for_update())
    if version is None:
        Row.metadata.create_all(session.connection())
        session.add(SchemaVersion(VERSION))
        return VERSION
    while version in MIGRATIONS:
        MIGRATIONS[version](session)
        version += 1
        session.execute(update(SchemaVersion).values(version=version))
    return version
