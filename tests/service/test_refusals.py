"""Refusals tell users why, and nothing of where the provider keeps what."""

from __future__ import annotations

import asyncio
import json
import logging
from typing import Any

import pytest
from pydantic import ValidationError

from aerodaas.protocol.schemas import LeaseIn, MissionIn, NavigationIn, TenantChange
from aerodaas.service.errors import StoreError, without_folders
from aerodaas.service.http.refusals import refuse


def refused(error: Exception) -> tuple[int, str]:
    """Status and text of the answer to a request that meets an error."""
    sent: list[Any] = []

    async def send(message: Any) -> None:  # noqa: ANN401 - ASGI
        sent.append(message)

    asyncio.run(refuse({"type": "http"}, send, error))
    return sent[0]["status"], json.loads(sent[1]["body"])["text"]


def test_a_database_that_fails_is_told_of_to_the_provider_alone(
    caplog: pytest.LogCaptureFixture,
) -> None:
    """Its place is in the log, once for many requests; users hear that it cannot be used."""
    error = StoreError("sqlite:////srv/farm/service.db: disk I/O error: see its log")
    answers = {refused(error) for _ in range(3)}
    [(status, text)] = answers
    assert status == 503
    assert "database" in text
    assert "service.db" not in text
    assert [line.getMessage().count("/srv/farm/service.db") for line in caplog.records] in ([1], [])
    assert all(line.levelno == logging.WARNING for line in caplog.records)


@pytest.mark.parametrize(
    ("said", "told"),
    [
        ("/srv/farm/m/1f/f/order.json: no such file", "order.json: no such file"),
        ("[Errno 28] No space left: '/srv/s/m/tmp12'", "[Errno 28] No space left: 'tmp12'"),
        ("see https://id.example/realms/farm", "see https://id.example/realms/farm"),
        ("one/cam1 and two/cam1, 3 m/s", "one/cam1 and two/cam1, 3 m/s"),
        ("at /", "at /"),
    ],
)
def test_a_path_is_told_by_its_last_part(said: str, told: str) -> None:
    """Addresses, streams and units are no paths."""
    assert without_folders(said) == told


@pytest.mark.parametrize("number", [2**63, 10**400, 1e308, -1])
@pytest.mark.parametrize(
    ("kind", "field", "rest"),
    [
        (TenantChange, "storage_bytes", {}),
        (TenantChange, "cloud_calls", {}),
        (TenantChange, "flight_minutes", {}),
        (LeaseIn, "within", {}),
        (MissionIn, "seed", {"document": {"format": "aerodaas-mission", "version": 1}}),
        (
            NavigationIn,
            "index",
            {"robot": "one", "waypoints": [{"id": "a", "x": 1, "y": 1, "z": 1}]},
        ),
    ],
)
def test_a_number_that_no_database_or_clock_holds_is_refused(
    kind: type[TenantChange], field: str, rest: dict[str, Any], number: float
) -> None:
    """By its field's name, where it is given."""
    kind.model_validate({**rest, field: 5})
    with pytest.raises(ValidationError, match=field):
        kind.model_validate({**rest, field: number})
