"""An open database: its connections and transactions, and its failures in plain words."""

from __future__ import annotations

import os
import threading
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from sqlite3 import Connection as SqliteConnection

from sqlalchemy import URL, Connection, Engine, Table, create_engine, event
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.engine import make_url
from sqlalchemy.exc import ArgumentError, SQLAlchemyError
from sqlalchemy.orm import Session

from aerodaas.service.errors import StoreError
from aerodaas.service.store.migrations import VERSION, prepare

__all__ = ["Database"]

_PATIENCE = 5.0
"""Seconds to wait for a lock, a connection or an answer."""
_CONNECTIONS = 10
_WRITES = "aerodaas_writes"


class Database:
    """Connections to one database; threads may share it."""

    def __init__(self, where: Path | str) -> None:
        """Open it; see `Store.open`."""
        url = _url(where)
        self._name = url.render_as_string(hide_password=True)
        self._file = _file(url)
        # SQLite has one writer at a time, and its own waiting is by sleeping.
        self._writer = threading.Lock()
        try:
            self._engine = _engine(url)
        except (SQLAlchemyError, ImportError) as error:
            raise StoreError(self._line(error)) from None
        try:
            self._identity = self._identify()
            self._prepare()
        except StoreError:
            self.close()
            raise

    def close(self) -> None:
        """Close the connections."""
        self._engine.dispose()

    @contextmanager
    def reading(self) -> Generator[Session, None, None]:
        """A transaction that reads; raises StoreError for what the database raises."""
        with self._transaction(self._engine) as session:
            yield session

    @contextmanager
    def writing(self) -> Generator[Session, None, None]:
        """A transaction that writes: all of it, or nothing; raises StoreError as `reading`."""
        engine = self._engine.execution_options(**{_WRITES: True})
        if self._file is None:
            with self._transaction(engine) as session:
                yield session
            return
        if not self._writer.acquire(timeout=_PATIENCE):
            raise StoreError(f"{self._name}: the database is locked: {_remedy('locked')}")
        try:
            with self._transaction(engine) as session:
                yield session
        finally:
            self._writer.release()

    def insert(self, table: Table) -> sqlite.Insert | postgresql.Insert:
        """An insertion that can say what is done where the key is there already."""
        if self._engine.dialect.name == "sqlite":
            return sqlite.insert(table)
        return postgresql.insert(table)

    @contextmanager
    def _transaction(self, engine: Engine) -> Generator[Session, None, None]:
        if self._identify() != self._identity:
            raise StoreError(f"{self._name} is gone: {_remedy('unable to open')}")
        try:
            with Session(engine, expire_on_commit=False) as session, session.begin():
                yield session
        except SQLAlchemyError as error:
            raise StoreError(self._line(error)) from None

    def _identify(self) -> tuple[int, int] | None:
        """Of the file: SQLite would go on writing to one that was deleted or replaced."""
        if self._file is None:
            return None
        try:
            status = self._file.stat()
        except OSError:
            return (0, 0)
        return (status.st_dev, status.st_ino)

    def _prepare(self) -> None:
        with self.writing() as session:
            found = prepare(session)
        if found != VERSION:
            raise StoreError(
                f"{self._name} has tables of version {found}, not {VERSION}: use the AeroDaaS "
                "that made it, or another database"
            )

    def _line(self, error: Exception) -> str:
        """Text of an error without the statement and its values, and the remedy."""
        said = str(getattr(error, "orig", None) or error).strip().partition("\n")[0]
        return f"{self._name}: {said}: {_remedy(said)}"


def _url(where: Path | str) -> URL:
    text = str(where)
    if isinstance(where, Path) or "://" not in text:
        return URL.create("sqlite", database=text)
    try:
        url = make_url(text)
    except (ArgumentError, ValueError):
        # What cannot be read may hold a password.
        raise StoreError(
            "this is no URL of a database: give a file's path or postgresql://USER@HOST/NAME"
        ) from None
    kind = url.get_backend_name()
    if kind == "postgresql":
        return url.set(drivername="postgresql+psycopg")
    if kind == "sqlite" and url.database not in {None, "", ":memory:"}:
        return url
    raise StoreError(
        f"{kind} cannot be used: give the path of an SQLite file or postgresql://USER@HOST/NAME"
    )


def _file(url: URL) -> Path | None:
    return Path(url.database or "") if url.get_backend_name() == "sqlite" else None


def _engine(url: URL) -> Engine:
    file = _file(url)
    if file is None:
        patience = int(_PATIENCE * 1000)
        options = f"-c lock_timeout={patience} -c statement_timeout={2 * patience}"
        return create_engine(
            url,
            pool_size=_CONNECTIONS,
            pool_timeout=_PATIENCE,
            pool_pre_ping=True,
            connect_args={"connect_timeout": int(_PATIENCE), "options": options},
        )
    _make(file)
    engine = create_engine(
        url,
        pool_size=_CONNECTIONS,
        pool_timeout=_PATIENCE,
        connect_args={"timeout": _PATIENCE},
    )
    event.listen(engine, "connect", _set_up)
    event.listen(engine, "begin", _begin)
    return engine


def _make(file: Path) -> None:
    """Make a missing file that only its owner reads; its neighbours of SQLite get its mode."""
    try:
        os.close(os.open(file, os.O_CREAT | os.O_RDWR, 0o600))
    except OSError as error:
        raise StoreError(f"{file}: {error.strerror}: {_remedy('unable to open')}") from None


def _set_up(connection: SqliteConnection, _: object) -> None:
    """Set up a connection of SQLite; its own module would begin transactions late."""
    connection.isolation_level = None
    for pragma in ("journal_mode = WAL", "synchronous = FULL", "foreign_keys = ON"):
        connection.execute(f"PRAGMA {pragma}")


def _begin(connection: Connection) -> None:
    """Begin; one that will write waits for its turn now, not in the middle."""
    writes = connection.get_execution_options().get(_WRITES)
    connection.exec_driver_sql("BEGIN IMMEDIATE" if writes else "BEGIN")


_REMEDIES = {
    "full": "free some of its disk",
    "no space": "free some of its disk",
    "constraint": "what it names must be there first",
    "lock": "end the other program that holds it",
    "unable to open": "check its path and who may write there",
    "readonly": "check its path and who may write there",
    "not a database": "name another file, or restore a copy",
    "malformed": "restore a copy",
    "psycopg": 'pip install "psycopg[binary]"',
    "connect": "check that its server runs and may be reached",
}


def _remedy(said: str) -> str:
    for word, remedy in _REMEDIES.items():
        if word in said.lower():
            return remedy
    return "see the database's own log"
