"""Databases that an earlier or a later AeroDaaS has made."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from sqlalchemy import create_engine, text
from sqlalchemy.orm import Session
from test_store_rows import LEASE, MISSION, USAGE

from aerodaas.protocol.schemas import USUAL_SCOPES, Role, Scope
from aerodaas.service.errors import StoreError
from aerodaas.service.store import Account, AuditEntry, RobotState, Store, Tenant, Token
from aerodaas.service.store.migrations import MIGRATIONS, VERSION

DATA = Path(__file__).parents[1] / "data"
TO_VERSION_2 = """
ALTER TABLE tenants ADD COLUMN tasks BIGINT;
ALTER TABLE usage ADD COLUMN tasks BIGINT NOT NULL DEFAULT 7;
UPDATE schema_version SET version = 2
"""
_COUNTED = {
    "sqlite": "INTEGER NOT NULL PRIMARY KEY AUTOINCREMENT",
    "postgresql": "BIGSERIAL PRIMARY KEY",
}

Script = Callable[[str], None]


@pytest.fixture
def script(place: str | Path) -> Script:
    """Runs statements on the database, beside the service."""
    url = f"sqlite:///{place}" if isinstance(place, Path) else place
    engine = create_engine(url.replace("postgresql://", "postgresql+psycopg://"))

    def run(statements: str) -> None:
        with engine.begin() as connection:
            for statement in statements.split(";\n"):
                if statement.strip():
                    counted = statement.replace("COUNTED", _COUNTED[engine.dialect.name])
                    connection.exec_driver_sql(counted)
        engine.dispose()

    return run


@pytest.mark.parametrize("since", ["", TO_VERSION_2], ids=["version 3", "version 2"])
def test_what_an_earlier_version_has_kept_is_there(
    place: str | Path, script: Script, since: str
) -> None:
    """Each row, and the database is good for more of them."""
    script((DATA / "schema_3.sql").read_text())
    script(since)
    for _ in range(2):
        with Store.open(place) as store:
            assert store.tenants.all() == [
                Tenant("farm"),
                Tenant("t", 1.0, 2.0, 3.0, 5, 2**40, 6.5, 7.5),
            ]
            assert store.accounts.all() == [
                Account("pilot", "farm", Role.PILOT, frozenset(USUAL_SCOPES), 0.0),
                Account("x", "farm", Role.ADMIN, frozenset(), 1.0, True, "https://issuer 7"),  # noqa: FBT003
            ]
            scopes = frozenset({Scope.FLY, Scope.SENSE})
            assert store.tokens.all() == [Token("id", "pilot", "d", scopes, 1.0, 2.0, revoked=True)]
            assert store.leases.all() == [LEASE]
            assert store.missions.newest(9) == [replace(MISSION, key="k", fingerprint="f")]
            position = (1.0, 2.0, 3.0)
            assert store.robots.all() == [
                RobotState("a", enabled=False, battery=0.5, position=position, heard=4.0),
                RobotState("b"),
            ]
            assert store.usage.all() == [USAGE]
            assert [entry.text for entry in store.audit.newest(9)][-1] == "paused"
            last = store.audit.newest(9)[0].number
            again = AuditEntry(2.0, "pilot", "farm", "::1", "mission.resume", accepted=True)
            assert store.audit.add(again) == last + 1
            store.missions.put(*store.missions.newest(9))
            store.usage.put(*store.usage.all())


@pytest.mark.parametrize("version", [1, VERSION + 1])
def test_tables_of_an_unknown_version_are_left_as_they_are(
    place: str | Path, script: Script, version: int
) -> None:
    """A newer service has made them, or one from before there were migrations."""
    Store.open(place).close()
    script(f"UPDATE schema_version SET version = {version}")  # noqa: S608 - a number
    for _ in range(2):
        with pytest.raises(StoreError, match=f"tables of version {version}, not {VERSION}"):
            Store.open(place)


def test_a_migration_that_fails_changes_nothing(
    place: str | Path, script: Script, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The AeroDaaS that made the tables still reads them."""

    def fail(session: Session) -> None:
        session.execute(text("ALTER TABLE tenants DROP COLUMN weight"))
        session.execute(text("ALTER TABLE nothing DROP COLUMN weight"))

    with Store.open(place) as store:
        store.tenants.add(Tenant("farm", weight=3.0))
    script("UPDATE schema_version SET version = 2")
    with monkeypatch.context() as patch:
        patch.setitem(MIGRATIONS, 2, fail)
        with pytest.raises(StoreError):
            Store.open(place)
    script("UPDATE schema_version SET version = 3")
    with Store.open(place) as store:
        assert store.tenants.all() == [Tenant("farm", weight=3.0)]
