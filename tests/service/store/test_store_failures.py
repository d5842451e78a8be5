"""A database that fails says how, changes nothing and works again afterwards."""

from __future__ import annotations

import os
import signal
import sqlite3
import subprocess
import sys
from pathlib import Path

import pytest
from sqlalchemy import event

from aerodaas.service.errors import StoreError
from aerodaas.service.store import RobotState, Store, Tenant, database

WRITER = """
import itertools, sys
from aerodaas.service.store import Store, Tenant
store = Store.open(sys.argv[1])
for number in itertools.count():
    store.tenants.add(Tenant(f"t{number}"))
    print(number, flush=True)
"""


def test_a_full_one_takes_nothing_until_there_is_room(tmp_path: Path) -> None:
    """SQLite's own bound on pages is a disk that is full."""
    with Store.open(tmp_path / "service.db") as store:
        engine = store._database._engine
        engine.dispose()

        def bound(connection: sqlite3.Connection, _: object) -> None:
            connection.execute("PRAGMA max_page_count = 1")

        event.listen(engine, "connect", bound)
        large = Tenant("x" * 1_000_000)
        with pytest.raises(StoreError, match=r"is full: free some of its disk"):
            store.tenants.add(large)
        assert store.tenants.all() == []
        event.remove(engine, "connect", bound)
        engine.dispose()
        store.tenants.add(Tenant("farm"))
        assert store.tenants.get("farm") == Tenant("farm")


def test_a_locked_one_is_waited_for_and_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Reading goes on meanwhile."""
    monkeypatch.setattr(database, "_PATIENCE", 0.05)
    path = tmp_path / "service.db"
    with Store.open(path) as store:
        other = sqlite3.connect(path, isolation_level=None)
        other.execute("BEGIN IMMEDIATE")
        with pytest.raises(StoreError, match=r"locked: end the other program"):
            store.robots.add(RobotState("a"))
        assert store.robots.all() == []
        other.execute("ROLLBACK")
        other.close()
        store.robots.add(RobotState("a"))
        assert store.robots.all() == [RobotState("a")]


def test_one_that_is_deleted_or_replaced_is_gone(tmp_path: Path) -> None:
    """SQLite itself would go on writing to what nobody can open any more."""
    path = tmp_path / "service.db"
    with Store.open(path) as store:
        path.rename(tmp_path / "elsewhere.db")
        with pytest.raises(StoreError, match="is gone"):
            store.robots.add(RobotState("a"))
        with pytest.raises(StoreError, match="is gone"):
            store.robots.all()
        assert not path.exists()
        path.touch()
        with pytest.raises(StoreError, match="is gone"):
            store.robots.all()
        (tmp_path / "elsewhere.db").rename(path)
        store.robots.add(RobotState("a"))


def test_it_is_its_owners_alone(tmp_path: Path) -> None:
    """With what SQLite puts beside it."""
    with Store.open(tmp_path / "service.db") as store:
        store.robots.add(RobotState("a"))
        modes = {path.name: path.stat().st_mode & 0o777 for path in tmp_path.iterdir()}
    assert modes == dict.fromkeys(("service.db", "service.db-wal", "service.db-shm"), 0o600)


@pytest.mark.parametrize(
    ("where", "said"),
    [
        ("missing/service.db", "No such file or directory: check its path"),
        ("mysql://root:secret@127.0.0.1/x", "mysql cannot be used"),
        ("sqlite://", "sqlite cannot be used"),
        ("://secret", "no URL of a database"),
        ("postgresql://root:secret@127.0.0.1:1/x", "refused: check that its server runs"),
    ],
)
def test_what_cannot_be_opened_says_why_and_no_password(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, where: str, said: str
) -> None:
    """With the remedy."""
    monkeypatch.chdir(tmp_path)
    with pytest.raises(StoreError, match=said) as error:
        Store.open(where)
    assert "secret" not in str(error.value)


def test_a_file_of_something_else_is_left_as_it_is(tmp_path: Path) -> None:
    """It is told."""
    path = tmp_path / "notes.txt"
    path.write_text("these are my notes, which are longer than a header\n" * 3)
    before = path.read_bytes()
    with pytest.raises(StoreError, match="not a database: name another file"):
        Store.open(path)
    assert path.read_bytes() == before


def test_what_was_kept_survives_a_kill(tmp_path: Path) -> None:
    """Whatever a call has returned from is there afterwards."""
    path = tmp_path / "service.db"
    with subprocess.Popen(
        [sys.executable, "-c", WRITER, path], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        told = [next(process.stdout) for _ in range(20)]
        os.kill(process.pid, signal.SIGKILL)
        told += list(process.stdout)
    with Store.open(path) as store:
        kept = {tenant.name for tenant in store.tenants.all()}
    assert {f"t{number.strip()}" for number in told} <= kept
