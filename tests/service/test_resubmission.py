"""Submissions that are sent again, because nobody knows whether they have arrived."""

from __future__ import annotations

import http.client
import json
from collections.abc import Iterator
from typing import Any
from urllib.parse import urlsplit

import pytest
from lost_answers import LostAnswers
from served import Served, document, fleet, robot

from aerodaas.environment.provider.client import ProviderClient
from aerodaas.protocol.schemas import MissionIn

pytestmark = pytest.mark.wall_clock

BODY = {"document": document("one", (5, 0))}


@pytest.fixture(scope="module")
def provider() -> Iterator[Served]:
    """Two drones; missions wait for an operator, so that none flies."""
    with Served(fleet(robot("one"), robot("two", 10)), "--no-rehearse", "--approval") as served:
        yield served


def submit(provider: Served, token: str, key: str, body: object = BODY) -> tuple[int, Any]:
    """Submit with a header field `Idempotency-Key`; returns status and JSON."""
    parts = urlsplit(provider.url)
    connection = http.client.HTTPConnection(parts.hostname or "", parts.port, timeout=20)
    headers = {"Authorization": f"Bearer {token}", "Content-Type": "application/json"}
    headers["Idempotency-Key"] = key
    connection.request("POST", "/v1/missions", json.dumps(body), headers)
    answer = connection.getresponse()
    found = answer.status, json.loads(answer.read())
    connection.close()
    return found


def test_a_submission_whose_answer_is_lost_is_one_mission(provider: Served) -> None:
    """The client sends it again by itself, and gets the mission that the first one has become."""
    token = provider.user("cut", "cutters")
    with LostAnswers(provider.url, lost=2) as way:
        found = ProviderClient(way.url, token).submit(MissionIn.model_validate(BODY))
        assert len(way.submissions) == 3
        assert len({_key(head) for head in way.submissions}) == 1
    assert [one["id"] for one in provider.ask("GET", "/v1/missions", token=token)] == [found.id]


def _key(head: bytes) -> bytes:
    (line,) = (one for one in head.split(b"\r\n") if one.lower().startswith(b"idempotency-key:"))
    return line.partition(b": ")[2]


def test_a_key_is_known_after_a_restart(provider: Served) -> None:
    """It is kept with the mission, so a client may repeat what it has sent to the last service."""
    token = provider.user("patient", "patients")
    status, first = submit(provider, token, '"k-1"')
    assert status == 202
    provider.stop()
    provider.start()
    assert submit(provider, token, '"k-1"') == (202, {**first, "phase": ANY, "reason": ANY})
    assert len(provider.ask("GET", "/v1/missions", token=token)) == 1


class _Any:
    """Equal to everything."""

    def __eq__(self, _: object) -> bool:
        return True

    __hash__ = None  # type: ignore[assignment]


ANY = _Any()


def test_a_key_stands_for_one_body(provider: Served) -> None:
    """Another body is refused and audited; the same one in another order of its keys is not."""
    token = provider.user("forgetful", "forgetters")
    _, first = submit(provider, token, '"k"', {**BODY, "minutes": 5})
    _, again = submit(provider, token, '"k"', {"minutes": 5, **BODY})
    assert again["id"] == first["id"]
    status, said = submit(provider, token, '"k"', {**BODY, "minutes": 6})
    assert status == 422
    assert first["id"] in said["text"]
    assert "new key" in said["text"]
    (entry, *_) = provider.ask("GET", "/v1/audit?limit=1")
    assert (entry["account"], entry["accepted"]) == ("forgetful", False)
    assert entry["action"] == "POST /v1/missions"
    assert "Idempotency-Key" in entry["text"]


def test_a_key_is_its_tenants(provider: Served) -> None:
    """Two tenants may use the same one, and learn nothing of each other."""
    ids = {submit(provider, provider.user(name, name), '"same"')[1]["id"] for name in ("a1", "b1")}
    assert len(ids) == 2


@pytest.mark.parametrize("key", ["bare", '""', '"a', f'"{"x" * 256}"', '"a"; q=1', '"\xe4"'])
def test_what_is_no_string_is_no_key(provider: Served, key: str) -> None:
    """It is refused with the form, and nothing is taken in."""
    before = len(provider.ask("GET", "/v1/missions"))
    status, said = submit(provider, provider.token, key)
    assert status == 400
    assert "quotation marks" in said["text"]
    assert len(provider.ask("GET", "/v1/missions")) == before
