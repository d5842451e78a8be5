"""A database of the service for each test: in a file, and in PostgreSQL where one is named.

This module is a plugin of pytest, which `conftest.py` registers.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from required import needs_peer, peer

if TYPE_CHECKING:  # what only these tests need is loaded for them alone
    from aerodaas.service.store import Store

_URL = "AERODAAS_TEST_DATABASE"


@pytest.fixture(params=["sqlite", pytest.param("postgresql", marks=needs_peer(_URL))])
def place(request: pytest.FixtureRequest, tmp_path: Path) -> str | Path:
    """Where an empty database is."""
    if request.param == "sqlite":
        return tmp_path / "service.db"
    from sqlalchemy import create_engine  # noqa: PLC0415

    from aerodaas.service.store.rows import Row  # noqa: PLC0415

    url = peer(_URL)
    engine = create_engine(url.replace("postgresql://", "postgresql+psycopg://"))
    Row.metadata.drop_all(engine)
    engine.dispose()
    return url


@pytest.fixture
def store(place: str | Path) -> Iterator[Store]:
    """With the tenant `farm` and its account `pilot`."""
    from aerodaas.protocol.schemas import USUAL_SCOPES, Role  # noqa: PLC0415
    from aerodaas.service.store import Account, Store, Tenant  # noqa: PLC0415

    with Store.open(place) as opened:
        opened.tenants.add(Tenant("farm"))
        opened.accounts.add(Account("pilot", "farm", Role.PILOT, frozenset(USUAL_SCOPES), 0.0))
        yield opened
