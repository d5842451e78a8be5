"""The interface's schema, tried by requests that are drawn from it: each answer is one it names."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import schemathesis
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from schemathesis import Case, GenerationMode
from schemathesis.checks import not_a_server_error
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    response_schema_conformance,
    status_code_conformance,
)
from served import document, fleet, robot

from aerodaas.config.model import EnvironmentConfig
from aerodaas.service import provider
from aerodaas.service.access.accounts import Accounts
from aerodaas.service.http.limits import RateLimiter
from aerodaas.service.settings import ServiceSettings
from aerodaas.service.store import Store

pytestmark = pytest.mark.slow

_EXAMPLES = 40
"""Requests of each operation."""
_MODES = (GenerationMode.POSITIVE, GenerationMode.NEGATIVE)
_SUPPRESSED = (HealthCheck.too_slow, HealthCheck.filter_too_much, HealthCheck.data_too_large)
_CHECKS = [
    not_a_server_error,
    status_code_conformance,
    content_type_conformance,
    response_schema_conformance,
]


@pytest.fixture
def interface(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """Schema and content of a service with two drones, in which nothing moves on; for its admin."""
    monkeypatch.setattr(RateLimiter, "admit", lambda *_: None)
    path = tmp_path / "fleet.json"
    path.write_text(json.dumps(fleet(robot("one"), robot("two", 10))), encoding="utf-8")
    config = EnvironmentConfig.load(path)
    wanted = ServiceSettings(path, config, tmp_path / "s", monitor=False)
    wanted.state.mkdir()
    with Store.open(tmp_path / "service.db") as store:
        token = Accounts(store).first_token()
        app = provider.build_service(wanted, store)
        headers = {"Authorization": f"Bearer {token}"}
        schema = schemathesis.openapi.from_asgi("/v1/openapi.json", app, headers=headers)
        schema.config.update(headers=headers)
        yield schema, _known(schema, headers)


def _known(schema: Any, headers: dict[str, str]) -> dict[str, str]:  # noqa: ANN401 - untyped
    """What the service has, by the names of the addresses' parameters."""

    def made(path: str, content: object) -> Any:  # noqa: ANN401 - JSON
        posted = schema[f"/v1/{path}"]["POST"].Case(body=content, media_type="application/json")
        answer = posted.call(headers=headers)
        assert answer.status_code < 300, answer.text
        return answer.json()

    account = made("accounts", {"name": "farm", "tenant": "farm"})["name"]
    return {
        "name": account,
        "tenant": account,
        "token": made("tokens", {"account": account})["id"],
        "lease": made("leases", {"robots": ["two"]})["id"],
        "mission": made("missions", {"document": document("one", (5.0, 0.0))})["id"],
        "robot": "one",
        "sha256": "0" * 64,
    }


def test_each_answer_is_one_that_the_schema_names(
    interface: tuple[Any, dict[str, str]],
) -> None:
    """With a status and a body as it says, whatever is asked; none is the service's own failure."""
    schema, known = interface
    asked: Counter[int] = Counter()
    for found in schema.get_all_operations():
        operation = found.ok()
        drawn = [operation.as_strategy(generation_mode=mode) for mode in _MODES]

        @settings(max_examples=_EXAMPLES, suppress_health_check=_SUPPRESSED, deadline=None)
        @given(case=st.one_of(drawn), is_known=st.booleans())
        def ask(case: Case, is_known: bool) -> None:  # noqa: FBT001 - drawn
            for name in case.path_parameters if is_known else ():
                case.path_parameters[name] = known[name]
            answer = case.call()
            case.validate_response(answer, checks=_CHECKS)
            asked[answer.status_code] += 1

        ask()
    assert {200, 201, 204, 400, 404, 409, 422} <= set(asked)
