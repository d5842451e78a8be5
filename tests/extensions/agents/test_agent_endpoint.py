"""The agents' endpoint of a service: who may come in, and what the others are told."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("mcp", reason="the extra `agents` is not installed")

from agent_client import FLEET
from oidc_issuer import AUDIENCE, Issuer
from starlette.testclient import TestClient

from aerodaas.config.model import EnvironmentConfig
from aerodaas.protocol.schemas import USUAL_SCOPES, AccountIn, Role, Scope, TokenIn
from aerodaas.service.access.accounts import Accounts
from aerodaas.service.access.oidc import OidcSettings
from aerodaas.service.provider import build_service
from aerodaas.service.settings import ServiceSettings
from aerodaas.service.store import Store

PUBLIC = "https://drones.example"
METADATA = f"{PUBLIC}/.well-known/oauth-protected-resource/mcp"
ACCOUNTS = {
    "scout": [Scope.SENSE, Scope.COMPUTE, Scope.PROPOSE],
    "pilot": list(USUAL_SCOPES),
    "watcher": [Scope.SENSE],
}


class Endpoint:
    """A service with the endpoint, in this process."""

    def __init__(
        self, client: TestClient, tokens: dict[str, str], issuer: Issuer, store: Store
    ) -> None:
        self.client = client
        self.tokens = tokens
        self.issuer = issuer
        self.store = store

    def post(self, account: str = "", method: str = "tools/list", **headers: str) -> Any:  # noqa: ANN401
        """Send one request of the protocol as an account."""
        token = {"authorization": f"Bearer {self.tokens[account]}"} if account else {}
        given = {"accept": "application/json, text/event-stream", **token, **headers}
        body = {"jsonrpc": "2.0", "id": 1, "method": method, "params": {}}
        return self.client.post("/mcp", json=body, headers=given)


@pytest.fixture(name="issuer", scope="module")
def _issuer() -> Iterator[Issuer]:
    with Issuer() as issuer:
        yield issuer


@pytest.fixture(name="endpoint", scope="module")
def _endpoint(tmp_path_factory: pytest.TempPathFactory, issuer: Issuer) -> Iterator[Endpoint]:
    folder: Path = tmp_path_factory.mktemp("agents")
    file = folder / "fleet.json"
    file.write_text(json.dumps(FLEET), encoding="utf-8")
    settings = ServiceSettings(
        file,
        EnvironmentConfig.load(file),
        folder / "s",
        monitor=False,
        agents=True,
        public=PUBLIC,
        oidc=OidcSettings(issuer.url, AUDIENCE),
    )
    settings.state.mkdir()
    with Store.open(folder / "service.db") as store:
        accounts = Accounts(store)
        accounts.first_token()
        tokens = {}
        for name, scopes in ACCOUNTS.items():
            accounts.add(AccountIn(name=name, tenant="farm", role=Role.PILOT, scopes=scopes))
            tokens[name] = accounts.issue(TokenIn(account=name)).secret or ""
        app = build_service(settings, store, address="http://127.0.0.1:9")
        with TestClient(app, base_url=PUBLIC) as client:
            yield Endpoint(client, tokens, issuer, store)


def test_an_agent_comes_in(endpoint: Endpoint) -> None:
    """By its token alone: there is no session."""
    answer = endpoint.post("scout")
    assert answer.status_code == 200, answer.text
    assert "mcp-session-id" not in answer.headers
    assert "request_approval" in answer.text


@pytest.mark.parametrize("account", ["pilot", "watcher"])
def test_a_token_that_is_no_agents_is_refused_and_told_which_is(
    endpoint: Endpoint, account: str
) -> None:
    """A person's token would let a model do what a person may."""
    answer = endpoint.post(account)
    assert answer.status_code == 403
    challenge = answer.headers["www-authenticate"]
    assert 'scope="propose"' in challenge
    assert METADATA in challenge


@pytest.mark.parametrize("token", ["", "Bearer wrong", "Basic eDp5"])
def test_without_a_good_token_a_client_learns_where_to_get_one(
    endpoint: Endpoint, token: str
) -> None:
    """RFC 9728: the refusal names the metadata, which needs no token."""
    answer = endpoint.post(**({"authorization": token} if token else {}))
    assert answer.status_code == 401
    assert METADATA in answer.headers["www-authenticate"]
    found = endpoint.client.get(METADATA).json()
    assert found["resource"] == f"{PUBLIC}/mcp"
    assert found["scopes_supported"] == ["propose"]


def test_an_issuers_token_is_good_for_this_service_alone(endpoint: Endpoint) -> None:
    """Its account is a person's until an administrator makes it an agent's."""
    issuer = endpoint.issuer
    assert endpoint.client.get(METADATA).json()["authorization_servers"] == [issuer.url]
    endpoint.tokens["issued"] = issuer.token()
    endpoint.tokens["elsewhere"] = issuer.token(aud="another")
    assert endpoint.post("elsewhere").status_code == 401
    assert endpoint.post("issued").status_code == 403
    (name,) = [one.name for one in endpoint.store.accounts.all() if one.subject]
    Accounts(endpoint.store).change(name, scopes=ACCOUNTS["scout"])
    assert endpoint.post("issued").status_code == 200


@pytest.mark.parametrize("headers", [{"host": "evil.example"}, {"origin": "https://evil.example"}])
def test_another_site_is_refused_whatever_its_token(
    endpoint: Endpoint, headers: dict[str, str]
) -> None:
    """A page whose name was rebound to this machine, or another page's script."""
    assert endpoint.post("scout", **headers).status_code == 403
    assert endpoint.client.get(METADATA, headers=headers).status_code == 403


def test_the_api_itself_answers_as_before(endpoint: Endpoint) -> None:
    """Its refusals name no metadata, and the page is there."""
    answer = endpoint.client.get("/v1/me")
    assert answer.status_code == 401
    assert METADATA not in answer.headers["www-authenticate"]
    assert endpoint.client.get("/").status_code == 200


def test_a_large_document_fits_and_a_larger_one_does_not(endpoint: Endpoint) -> None:
    """The endpoint has the bound of a submission."""
    token = {"authorization": f"Bearer {endpoint.tokens['scout']}"}
    statuses = [
        endpoint.client.post("/mcp", content=b"x" * size, headers=token).status_code
        for size in (1 << 20, 5 << 20)
    ]
    assert statuses[0] != 413
    assert statuses[1] == 413
