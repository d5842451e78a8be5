"""A store for each test of the service: in a file, and in PostgreSQL where one is named."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from required import needs_peer, peer
from sqlalchemy import create_engine

from aerodaas.service.schemas import Role, Scope
from aerodaas.service.store import Account, Store, Tenant
from aerodaas.service.store.tables import METADATA


@pytest.fixture(
    params=["sqlite", pytest.param("postgresql", marks=needs_peer("AERODAAS_TEST_DATABASE"))]
)
def place(request: pytest.FixtureRequest, tmp_path: Path) -> str | Path:
    """Where an empty database is."""
    if request.param == "sqlite":
        return tmp_path / "service.db"
    url: str = peer("AERODAAS_TEST_DATABASE")
    engine = create_engine(url.replace("postgresql://", "postgresql+psycopg://"))
    METADATA.drop_all(engine)
    engine.dispose()
    return url


@pytest.fixture
def store(place: str | Path) -> Iterator[Store]:
    """With the tenant `farm` and its account `pilot`."""
    with Store.open(place) as opened:
        opened.tenants.add(Tenant("farm"))
        opened.accounts.add(Account("pilot", "farm", Role.PILOT, frozenset(Scope), 0.0))
        yield opened
