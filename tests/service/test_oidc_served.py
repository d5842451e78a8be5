"""A service that takes tokens of an OpenID Connect issuer beside its own."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from oidc_issuer import AUDIENCE, Issuer
from served import Served, document, fleet, robot
from typer.testing import CliRunner

from aerodaas.cli.app import app
from aerodaas.errors import ConfigError


@pytest.fixture(scope="module")
def issuer() -> Iterator[Issuer]:
    """An issuer."""
    with Issuer() as made:
        yield made


@pytest.fixture(scope="module")
def provider(issuer: Issuer) -> Iterator[Served]:
    """A drone for the issuer's people; missions wait for an operator, so that none flies."""
    words = ["--oidc-issuer", issuer.url, "--oidc-audience", AUDIENCE]
    words += ["--oidc-role", "fliers=pilot"]
    with Served(fleet(robot("one")), "--no-rehearse", "--approval", *words) as served:
        yield served


def test_people_of_the_issuer_fly_without_an_account_made_for_them(
    provider: Served, issuer: Issuer
) -> None:
    """The mission is their tenant's, and the audit log names them."""
    token = issuer.token(aerodaas_role=["fliers"])
    me = provider.ask("GET", "/v1/me", token=token)
    assert (me["tenant"], me["role"]) == ("farm", "pilot")
    found = provider.ask("POST", "/v1/missions", {"document": document("one", (5, 0))}, token)
    assert (found["tenant"], found["account"]) == ("farm", me["name"])
    assert any(one["account"] == me["name"] for one in provider.ask("GET", "/v1/audit"))
    other = issuer.token(aerodaas_role=["fliers"], aerodaas_tenant="growers", sub="8")
    assert provider.send("GET", f"/v1/missions/{found['id']}", token=other)[0] == 404


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--oidc-issuer", "https://id.example"), "go together"),
        (("--oidc-audience", "drones"), "go together"),
        (("--oidc-role", "fliers=king"), "VALUE=ROLE"),
        (("--oidc-role", "fliers"), "VALUE=ROLE"),
    ],
)
def test_options_that_do_not_fit_are_told(
    tmp_path: Path, words: tuple[str, ...], said: str
) -> None:
    """Before anything is served."""
    path = tmp_path / "fleet.json"
    path.write_text(json.dumps(fleet(robot("one"))), encoding="utf-8")
    if "together" not in said:
        words = ("--oidc-issuer", "https://id.example", "--oidc-audience", "drones", *words)
    ended = CliRunner().invoke(app, ["serve", str(path), "--state", str(tmp_path / "s"), *words])
    assert isinstance(ended.exception, ConfigError)
    assert said in str(ended.exception)
    assert not (tmp_path / "s").exists()
