"""What strangers and other tenants try at a provider's service; none of it gets through."""

from __future__ import annotations

import base64
import contextlib
import http.client
import json
import pickle
from collections.abc import Iterator
from typing import Any
from urllib.parse import urlsplit

import pytest
from served import Served, document, fleet, robot
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

AUTH = "Authorization"


@pytest.fixture(scope="module")
def provider() -> Iterator[Served]:
    """Two drones; missions wait for an operator, so that none flies."""
    with Served(fleet(robot("one"), robot("two", 10)), "--no-rehearse", "--approval") as served:
        yield served


@pytest.fixture(scope="module")
def victim(provider: Served) -> dict[str, Any]:
    """A tenant with a lease and a mission."""
    token = provider.user("victim", "farm")
    lease = provider.ask("POST", "/v1/leases", {"robots": ["one"], "minutes": 30}, token)
    body = {"document": document("one", (5, 0)), "lease": lease["id"]}
    mission = provider.ask("POST", "/v1/missions", body, token)
    return {"token": token, "lease": lease["id"], "mission": mission["id"]}


@pytest.fixture(scope="module")
def stranger(provider: Served) -> str:
    """Token of a pilot of another tenant."""
    return provider.user("stranger", "elsewhere")


@pytest.mark.parametrize(
    "token",
    ["", "x", "aerodaas_0000000000000000_" + "a" * 43, "aerodaas__", "Bearer", "ä" * 9, "a" * 5000],
    ids=["none", "short", "forged", "empty parts", "a word", "no ASCII", "long"],
)
def test_without_a_valid_token_nothing_is_answered(provider: Served, token: str) -> None:
    """Whatever is wrong with it, the answer is the same."""
    try:
        status, content = provider.send("GET", "/v1/fleet", token=token)
    except UnicodeEncodeError:
        return
    assert status in {401, 429}
    assert b"campus" not in content


def test_a_token_with_another_secret_is_refused(provider: Served, victim: dict[str, Any]) -> None:
    """Also if all but its last character is right."""
    right = victim["token"]
    wrong = right[:-1] + ("a" if right[-1] != "a" else "b")
    assert provider.send("GET", "/v1/fleet", token=right)[0] == 200
    assert provider.send("GET", "/v1/fleet", token=wrong)[0] in {401, 429}


def test_a_revoked_token_and_a_disabled_account_are_refused(provider: Served) -> None:
    """At once."""
    token = provider.user("leaver", "farm")
    assert provider.send("GET", "/v1/me", token=token)[0] == 200
    id_ = token.split("_")[1]
    assert provider.ask("DELETE", f"/v1/tokens/{id_}")["revoked"]
    assert provider.send("GET", "/v1/me", token=token)[0] == 401
    other = provider.user("blocked", "farm")
    provider.ask("PATCH", "/v1/accounts/blocked", {"disabled": True})
    assert provider.send("GET", "/v1/me", token=other)[0] == 401


def test_another_tenants_things_do_not_exist(
    provider: Served, victim: dict[str, Any], stranger: str
) -> None:
    """Mission, lease, recording, commands: not to be told from ones that never were."""
    mission, lease = victim["mission"], victim["lease"]
    place = {"id": "a", "x": 1.0, "y": 1.0, "z": 2.0, "waypoint_type": "local"}
    command = {"robot": "one", "command": "land"}
    tried = [
        ("GET", f"/v1/missions/{mission}", None),
        ("DELETE", f"/v1/missions/{mission}", None),
        ("POST", f"/v1/missions/{mission}/commands", command),
        ("POST", f"/v1/missions/{mission}/navigation", {"robot": "one", "waypoints": [place]}),
        ("GET", f"/v1/missions/{mission}/recording", None),
        ("GET", f"/v1/missions/{mission}/rehearsal.png", None),
        ("GET", f"/v1/leases/{lease}", None),
        ("DELETE", f"/v1/leases/{lease}", None),
        ("POST", f"/v1/leases/{lease}/extend", {"minutes": 5}),
    ]
    for method, path, body in tried:
        assert provider.send(method, path, body, stranger)[0] == 404, path
    assert provider.ask("GET", "/v1/missions", token=stranger) == []
    assert provider.ask("GET", "/v1/leases", token=stranger) == []
    seen = {one["id"]: one for one in provider.ask("GET", "/v1/fleet", token=stranger)["robots"]}
    assert seen["one"]["tenant"] is None
    assert provider.until_phase(mission, "awaiting_approval")["phase"] == "awaiting_approval"


@pytest.mark.parametrize("what", ["live", "live?streams=one/odometry", "here"])
def test_another_tenants_streams_are_closed(
    provider: Served, victim: dict[str, Any], stranger: str, what: str
) -> None:
    """To another tenant and to nobody's token alike, before anything is sent."""
    url = provider.url.replace("http", "ws", 1) + f"/v1/missions/{victim['mission']}/{what}"
    for token, status, text in (
        (stranger, 404, "there is no mission"),
        ("aerodaas_0_0", 401, "wrong or missing token"),
    ):
        headers = {AUTH: f"Bearer {token}"}
        with pytest.raises(InvalidStatus) as refused:
            connect(url, additional_headers=headers, proxy=None)
        assert refused.value.response.status_code in {status, 429}
        if refused.value.response.status_code == status:
            assert text in json.loads(refused.value.response.body or b"")["text"]
    with connect(url, additional_headers={AUTH: f"Bearer {victim['token']}"}, proxy=None) as socket:
        if what != "here":
            assert '"kind": "mission"' in str(socket.recv(10))


def test_a_live_view_of_impossible_settings_is_refused_by_a_sentence(
    provider: Served, victim: dict[str, Any]
) -> None:
    """Also where the sentence is longer than what a WebSocket's closing takes."""
    query = "rate=500&streams=" + "x" * 3000
    url = provider.url.replace("http", "ws", 1) + f"/v1/missions/{victim['mission']}/live?{query}"
    with pytest.raises(InvalidStatus) as refused:
        connect(url, additional_headers={AUTH: f"Bearer {victim['token']}"}, proxy=None)
    answer = refused.value.response
    assert answer.status_code == 422
    text = json.loads(answer.body or b"")["text"]
    assert "rate: " in text
    assert "streams: " in text


def test_nobody_is_sent_elsewhere(provider: Served) -> None:
    """A path with a slash too many was answered by a redirection to whatever `Host` said."""
    status, text = provider.ask("GET", "/v1/missions/")
    assert (status, text) == (404, "Not Found")


def test_another_tenants_lease_flies_nobody_elses_mission(
    provider: Served, victim: dict[str, Any], stranger: str
) -> None:
    """Nor does one's own lease fly another drone."""
    body = {"document": document("one", (5, 0)), "lease": victim["lease"]}
    assert provider.send("POST", "/v1/missions", body, stranger)[0] == 404
    own = {"document": document("two", (12, 0)), "lease": victim["lease"]}
    status, text = provider.ask("POST", "/v1/missions", own, victim["token"])
    assert status == 403
    assert "is for one, not two" in text


@pytest.mark.parametrize(
    ("role", "method", "path", "body"),
    [
        ("viewer", "POST", "/v1/leases", {"robots": ["two"]}),
        ("viewer", "POST", "/v1/missions", {"document": document("two", (12, 0))}),
        ("pilot", "POST", "/v1/missions/MISSION/approve", None),
        ("pilot", "PATCH", "/v1/robots/one", {"enabled": False}),
        ("operator", "PATCH", "/v1/tenants/farm", {"flight_minutes": None}),
        ("viewer", "DELETE", "/v1/missions/MISSION/recording", None),
        ("pilot", "POST", "/v1/accounts", {"name": "mine", "tenant": "farm", "role": "admin"}),
        ("operator", "POST", "/v1/tokens", {"account": "admin"}),
        ("operator", "GET", "/v1/audit", None),
    ],
)
def test_a_role_is_the_most_that_an_account_may(
    provider: Served, victim: dict[str, Any], role: str, method: str, path: str, body: object
) -> None:
    """And the attempt is in the audit log."""
    name = f"{role}-{method.lower()}-{path.count('/')}{len(path)}".replace("/", "")
    token = provider.user(name, "farm", role)
    path = path.replace("MISSION", victim["mission"])
    assert provider.send(method, path, body, token)[0] == 403
    entries = provider.ask("GET", "/v1/audit?limit=50")
    assert any(one["account"] == name and not one["accepted"] for one in entries)


def test_a_token_without_the_scope_does_not_fly(provider: Served) -> None:
    """However much its account may."""
    provider.user("narrow", "farm")
    wanted = {"account": "narrow", "scopes": ["sense"]}
    token = provider.ask("POST", "/v1/tokens", wanted)["secret"]
    body = {"document": document("two", (12, 0))}
    assert provider.send("POST", "/v1/missions", body, token)[0] == 403


FOREIGN: dict[str, dict[str, Any]] = {
    "class": {"id": "one/mine", "analysis": "os:system", "reads": ["one/odometry"]},
    "module": {"id": "one/mine", "analysis": "subprocess.Popen", "reads": ["one/odometry"]},
    "unknown": {"id": "one/mine", "analysis": "MineAnalytics", "reads": ["one/odometry"]},
    "pickle": {
        "id": "one/mine",
        "analysis": "MonitoringAnalytics",
        "settings": {"$pickle": base64.b64encode(pickle.dumps(print)).decode()},
        "reads": ["one/odometry"],
        "surplus": True,
    },
}


@pytest.mark.parametrize("name", FOREIGN)
def test_a_document_brings_no_code(provider: Served, victim: dict[str, Any], name: str) -> None:
    """It is refused before anything of it is built."""
    body = {"document": document("one", (5, 0), analyses=[FOREIGN[name]])}
    assert provider.send("POST", "/v1/missions", body, victim["token"])[0] == 422


@pytest.mark.parametrize(
    "body",
    [b"", b"{", b"[]", b'{"document": NaN}', pickle.dumps({"a": 1}), b"\xff" * 50, b"[" * 100_000],
    ids=["empty", "cut", "list", "NaN", "pickle", "bytes", "deep"],
)
def test_a_body_that_is_no_mission_is_refused_by_a_sentence(
    provider: Served, victim: dict[str, Any], body: bytes
) -> None:
    """The service goes on."""
    status, content = provider.send("POST", "/v1/missions", body, victim["token"])
    assert status in {400, 422}
    assert b'"text"' in content
    assert provider.send("GET", "/v1/me")[0] == 200


def test_a_body_of_a_gigabyte_is_refused_before_it_is_sent(
    provider: Served, victim: dict[str, Any]
) -> None:
    """By its length; one that hides its length is cut off at the bound."""
    parts = urlsplit(provider.url)
    connection = http.client.HTTPConnection(parts.hostname or "", parts.port, timeout=20)
    connection.putrequest("POST", "/v1/missions")
    connection.putheader(AUTH, f"Bearer {victim['token']}")
    connection.putheader("Content-Length", str(1 << 30))
    connection.endheaders()
    assert connection.getresponse().status == 413
    connection.close()
    hidden = http.client.HTTPConnection(parts.hostname or "", parts.port, timeout=20)
    chunks = (b"a" * (1 << 20) for _ in range(64))
    headers = {AUTH: f"Bearer {victim['token']}", "Content-Type": "application/json"}
    status = 0
    with contextlib.suppress(OSError, http.client.HTTPException):
        hidden.request("POST", "/v1/missions", chunks, headers, encode_chunked=True)
        status = hidden.getresponse().status
    assert status in {0, 400, 413, 422}
    assert provider.send("GET", "/v1/me")[0] == 200


def test_a_flood_is_slowed_and_others_are_served(provider: Served) -> None:
    """The account that floods, and no other."""
    token = provider.user("flood", "farm")
    statuses = set()
    for _ in range(3000):
        statuses.add(provider.send("GET", "/v1/me", token=token)[0])
        if 429 in statuses:
            break
    assert statuses == {200, 429}
    assert provider.send("GET", "/v1/me")[0] == 200
