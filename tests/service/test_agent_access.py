"""What an agent's token may ask of the service: every route is looked at, by name."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest
from fastapi import FastAPI
from served import document, fleet, robot
from starlette.testclient import TestClient, WebSocketDenialResponse

from aerodaas.config.model import EnvironmentConfig
from aerodaas.protocol.schemas import AccountIn, Role, Scope, TokenIn
from aerodaas.service import provider
from aerodaas.service.access.accounts import Accounts
from aerodaas.service.errors import RefusedError
from aerodaas.service.settings import ServiceSettings
from aerodaas.service.store import Store

PROPOSES = [Scope.SENSE, Scope.COMPUTE, Scope.PROPOSE]
MAY = {
    ("GET", "/v1/me"),
    ("GET", "/v1/fleet"),
    ("GET", "/v1/fleet/scenery"),
    ("GET", "/v1/robots/{robot}/preflight"),
    ("GET", "/v1/leases"),
    ("GET", "/v1/leases/{lease}"),
    ("GET", "/v1/missions"),
    ("GET", "/v1/missions/{mission}"),
    ("GET", "/v1/missions/{mission}/scenery"),
    ("GET", "/v1/missions/{mission}/recording"),
    ("GET", "/v1/missions/{mission}/rehearsal.png"),
    ("GET", "/v1/missions/{mission}/playback"),
    ("GET", "/v1/missions/{mission}/playback/picture"),
    ("POST", "/v1/missions/{mission}/commands"),
    ("DELETE", "/v1/missions/{mission}"),
    ("POST", "/v1/missions/{mission}/changes"),
    ("POST", "/v1/proposals"),
    ("GET", "/v1/proposals/{mission}/check"),
    ("POST", "/v1/proposals/{mission}/rehearse"),
    ("POST", "/v1/refused-calls"),
    ("POST", "/v1/proposals/{mission}/request"),
}
"""Routes that agents may ask, by method and address; all others refuse them with 403."""
WAYPOINT = {"id": "w", "x": 1.0, "y": 1.0, "z": 2.0}
BODIES: dict[tuple[str, str], Any] = {
    ("POST", "/v1/missions"): {"document": document("one", (5.0, 0.0))},
    ("POST", "/v1/proposals"): {"document": document("one", (5.0, 0.0))},
    ("POST", "/v1/missions/{mission}/commands"): {"robot": "one", "command": "pause"},
    ("POST", "/v1/missions/{mission}/navigation"): {"robot": "one", "waypoints": [WAYPOINT]},
    ("POST", "/v1/missions/{mission}/changes"): {"robot": "one", "waypoints": [WAYPOINT]},
    ("POST", "/v1/missions/{mission}/plan"): {"robot": "one", "remove": ["w"]},
    ("POST", "/v1/missions/{mission}/actuators"): {
        "robot": "one",
        "actuator": "hook",
        "position": "open",
    },
    ("POST", "/v1/missions/{mission}/survey"): {
        "robot": "one",
        "area": [[0, 0], [5, 0], [5, 5]],
        "height": 5.0,
        "width": 2.0,
    },
    ("POST", "/v1/leases"): {"robots": ["one"]},
    ("POST", "/v1/leases/{lease}/extend"): {"minutes": 1.0},
    ("POST", "/v1/accounts"): {"name": "more", "tenant": "farm"},
    ("POST", "/v1/tokens"): {"account": "agent"},
    ("PATCH", "/v1/robots/{robot}"): {"enabled": True},
    ("POST", "/v1/missions/{mission}/approve"): {"hash": "0" * 64},
}
"""Bodies of requests that people may send so; an empty object for all others."""


@dataclass
class Service:
    """A service with an agent, a pilot and another tenant's pilot, in which nothing moves on."""

    app: FastAPI
    accounts: Accounts
    store: Store
    client: TestClient
    tokens: dict[str, str]

    def ask(self, who: str, method: str, path: str, body: object = None) -> Any:  # noqa: ANN401
        """Answer to a request of an account."""
        headers = {"Authorization": f"Bearer {self.tokens[who]}"}
        return self.client.request(method, path, headers=headers, json=body)

    def proposed(self) -> str:
        """Id of a proposal of the agent's."""
        answer = self.ask("agent", "POST", "/v1/proposals", {"document": document("one", (5, 0))})
        assert answer.status_code == 202, answer.text
        found: str = answer.json()["id"]
        return found


@pytest.fixture
def service(tmp_path: Path) -> Iterator[Service]:
    """A service over two drones."""
    path = tmp_path / "fleet.json"
    path.write_text(json.dumps(fleet(robot("one"), robot("two", 10))), encoding="utf-8")
    wanted = ServiceSettings(path, EnvironmentConfig.load(path), tmp_path / "s", monitor=False)
    wanted.state.mkdir()
    with Store.open(tmp_path / "service.db") as store:
        accounts = Accounts(store)
        tokens = {"admin": accounts.first_token() or ""}
        accounts.add(AccountIn(name="agent", tenant="farm", scopes=PROPOSES))
        accounts.add(AccountIn(name="pilot", tenant="farm"))
        accounts.add(AccountIn(name="boss", tenant="farm", role=Role.OPERATOR))
        accounts.add(AccountIn(name="stranger", tenant="city"))
        for name in ("agent", "pilot", "boss", "stranger"):
            tokens[name] = accounts.issue(TokenIn(account=name)).secret or ""
        app = provider.build_service(wanted, store)
        yield Service(app, accounts, store, TestClient(app), tokens)


def routes(service: Service) -> Iterator[tuple[str, str]]:
    """Method and address of every route, also of extensions."""
    schema = service.ask("admin", "GET", "/v1/openapi.json").json()
    for path, operations in schema["paths"].items():
        for method in operations:
            yield method.upper(), path


def test_every_route_refuses_an_agent_or_is_meant_for_it(service: Service) -> None:
    """A new one refuses it until somebody has thought about that, and names it above."""
    names = {
        "mission": service.proposed(),
        "robot": "one",
        "lease": "none",
        "tenant": "city",
        "name": "pilot",
        "token": "none",
        "sha256": "0" * 64,
    }
    statuses = {
        (method, path): service.ask(
            "agent", method, path.format(**names), BODIES.get((method, path), {})
        ).status_code
        for method, path in routes(service)
    }
    assert len(statuses) > 40
    assert {route for route, status in statuses.items() if status != 403} == MAY
    assert 500 not in statuses.values()


@pytest.mark.parametrize(
    ("path", "may"),
    [("live", True), ("controls?robot=one", False), ("here", False)],
)
def test_an_agent_watches_and_neither_steers_nor_answers_for_the_user(
    service: Service, path: str, *, may: bool
) -> None:
    """By WebSocket."""
    mission = service.proposed()
    headers = {"Authorization": f"Bearer {service.tokens['agent']}"}
    address = f"/v1/missions/{mission}/{path}"
    if may:
        with service.client.websocket_connect(address, headers=headers) as view:
            assert view.receive_json()["kind"] == "mission"
        return
    with (
        pytest.raises(WebSocketDenialResponse) as refused,
        service.client.websocket_connect(address, headers=headers),
    ):
        pass
    assert refused.value.status_code == 403


@pytest.mark.parametrize(
    ("path", "body"),
    [
        ("commands", {"robot": "one", "command": "resume"}),
        ("commands", {"robot": "one", "command": "clear"}),
        ("approve", {"hash": "0" * 64}),
    ],
)
def test_an_agent_neither_resumes_nor_clears_nor_approves(
    service: Service, path: str, body: object
) -> None:
    """It may stop the same mission: that it does not fly is another answer."""
    mission = service.proposed()
    refused = service.ask("agent", "POST", f"/v1/missions/{mission}/{path}", body)
    assert (refused.status_code, "propos" in refused.json()["text"]) == (403, True)
    for word in ("pause", "return-home", "land"):
        stop = {"robot": "one", "command": word}
        answer = service.ask("agent", "POST", f"/v1/missions/{mission}/commands", stop)
        assert answer.status_code == 409


def test_another_tenants_mission_does_not_exist(service: Service) -> None:
    """An unknown one is answered in the same words."""
    answer = service.ask("stranger", "POST", "/v1/missions", BODIES["POST", "/v1/missions"])
    assert answer.status_code == 202
    told = []
    for mission in (answer.json()["id"], "unknown"):
        for method, path in MAY:
            if "{mission}" not in path:
                continue
            body = BODIES.get((method, path), {})
            query = "?stream=s&at=0" if path.endswith("picture") else ""
            found = service.ask("agent", method, path.format(mission=mission) + query, body)
            assert found.status_code == 404, (method, path, found.text)
            told.append(found.json()["text"].replace(mission, "ID"))
    assert len(set(told)) == 1


def test_the_operator_approves_what_was_proposed(service: Service) -> None:
    """With a body, of a proposal that waits for it; each step is audited with account and hash."""
    mission = service.proposed()
    shown = service.ask("boss", "GET", f"/v1/missions/{mission}").json()
    known = shown["proposal"]["hash"]
    answer = service.ask("boss", "POST", f"/v1/missions/{mission}/approve", {"hash": known})
    assert (answer.status_code, "does not wait" in answer.json()["text"]) == (409, True)
    assert service.ask("boss", "POST", f"/v1/missions/{mission}/approve").status_code == 409
    log = service.ask("admin", "GET", "/v1/audit").json()
    created = next(one for one in log if one["action"] == "proposal.create")
    assert (created["account"], created["target"]) == ("agent", mission)
    assert known in created["text"]
    refused = next(one for one in log if not one["accepted"])
    assert (refused["account"], refused["action"].endswith("/approve")) == ("boss", True)


@pytest.mark.parametrize(
    ("changes", "remedy"),
    [
        ({"scopes": [Scope.FLY, Scope.PROPOSE]}, "leave one out"),
        ({"scopes": PROPOSES, "role": Role.OPERATOR}, "accounts of their own"),
        ({"scopes": PROPOSES, "role": Role.ADMIN}, "accounts of their own"),
    ],
)
def test_an_agents_account_may_nothing_else(
    service: Service, changes: dict[str, Any], remedy: str
) -> None:
    """Neither when it is made, nor later."""
    with pytest.raises(RefusedError, match=remedy):
        service.accounts.add(AccountIn(name="both", tenant="farm", **changes))
    with pytest.raises(RefusedError, match=remedy):
        service.accounts.change("pilot", **changes)
    assert service.ask("pilot", "GET", "/v1/me").json()["role"] == "pilot"


def test_a_token_of_an_agent_stays_one_without_the_scope(service: Service) -> None:
    """A narrower token opens less, and makes no person of its account."""
    narrow = TokenIn(account="agent", scopes=[Scope.SENSE])
    service.tokens["agent"] = service.accounts.issue(narrow).secret or ""
    body = BODIES["POST", "/v1/proposals"]
    assert service.ask("agent", "POST", "/v1/proposals", body).status_code == 403
    attached = {"document": document("one"), "attach": "any"}
    refused = service.ask("agent", "POST", "/v1/missions", attached)
    assert (refused.status_code, "agent's account" in refused.json()["text"]) == (403, True)
    assert service.ask("agent", "GET", "/v1/missions").status_code == 200


def test_an_issuers_role_makes_no_agent_an_operator(service: Service) -> None:
    """Nor does a scope that its row has kept: the token opens what an agent's does."""
    more = frozenset({*PROPOSES, Scope.FLY})
    service.store.accounts.update("agent", lambda row: replace(row, role=Role.ADMIN, scopes=more))
    assert service.ask("agent", "GET", "/v1/missions").status_code == 200
    for method, path in (("GET", "/v1/audit"), ("GET", "/v1/accounts"), ("POST", "/v1/leases")):
        body = BODIES.get((method, path))
        assert service.ask("agent", method, path, body).status_code == 403
    stranger = service.ask("stranger", "POST", "/v1/missions", BODIES["POST", "/v1/missions"])
    found = service.ask("agent", "GET", f"/v1/missions/{stranger.json()['id']}")
    assert found.status_code == 404


def test_a_person_who_becomes_an_agent_keeps_no_right_to_fly(service: Service) -> None:
    """Its tokens obey at once."""
    lease = {"robots": ["one"]}
    assert service.ask("pilot", "POST", "/v1/leases", lease).status_code == 201
    service.accounts.change("pilot", scopes=PROPOSES)
    assert service.ask("pilot", "POST", "/v1/leases", lease).status_code == 403
