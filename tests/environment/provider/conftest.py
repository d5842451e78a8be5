"""A service to ask, and a folder of logins of the test's own."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from aerodaas.environment.provider.client import ProviderClient
from provider.stub import TOKEN, Stub


@pytest.fixture(autouse=True)
def _own_logins(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No token of whoever runs the tests is read or written."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    for name in ("AERODAAS_TOKEN", "AERODAAS_PROVIDER", "AERODAAS_INSECURE"):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture
def stub() -> Iterator[Stub]:
    """A service on a loopback port."""
    with Stub() as service:
        yield service


@pytest.fixture
def client(stub: Stub) -> ProviderClient:
    """A client with the right token."""
    return ProviderClient(stub.url, TOKEN)
