"""Tokens of an OpenID Connect issuer: which are good, for whom, and which are forged."""

from __future__ import annotations

import base64
import hashlib
import hmac
import json
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import jwt
import pytest
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric import rsa
from oidc_issuer import AUDIENCE, Issuer

from aerodaas.errors import ConfigError, SourceError
from aerodaas.protocol.schemas import USUAL_SCOPES, AccountIn, Role, Scope
from aerodaas.service.access import issuer_keys
from aerodaas.service.access.accounts import Access, Accounts
from aerodaas.service.access.audit import Audit
from aerodaas.service.access.issuer_keys import IssuerKeys
from aerodaas.service.access.oidc import OidcSettings, OidcVerifier
from aerodaas.service.errors import RefusedError, StoreError
from aerodaas.service.store import Store


@pytest.fixture
def issuer() -> Iterator[Issuer]:
    """An issuer with one key."""
    with Issuer() as made:
        yield made


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    """An empty database."""
    with Store.open(tmp_path / "service.db") as made:
        yield made


def access(store: Store, issuer: Issuer, **settings: Any) -> Access:  # noqa: ANN401
    """Access by the issuer's tokens."""
    verifier = OidcVerifier(OidcSettings(issuer.url, AUDIENCE, **settings))
    return Access(store, Audit(store), issuer=verifier)


def status_of(access: Access, token: str) -> int:
    """Status of the refusal of a token; 200 for a good one."""
    try:
        access.of(token, "10.0.0.1")
    except RefusedError as error:
        return error.status
    return 200


def test_a_token_is_its_subjects_account(issuer: Issuer, store: Store) -> None:
    """Made at the first request, with the token's tenant and role; the next finds the same."""
    found = access(store, issuer).of(issuer.token(), "10.0.0.1")
    assert (found.tenant, found.role, found.scopes) == ("farm", Role.PILOT, frozenset(USUAL_SCOPES))
    assert found.account.startswith("asha-")
    again = issuer.token(preferred_username="renamed", aerodaas_role="viewer", aud=["x", AUDIENCE])
    other = access(store, issuer).of(again, "10.0.0.1")
    assert (other.account, other.role) == (found.account, Role.VIEWER)
    assert [(one.name, one.role) for one in store.accounts.all()] == [(found.account, Role.VIEWER)]
    assert [one.name for one in store.tenants.all()] == ["farm"]


@pytest.mark.parametrize("name", ["admin", "asha", "0", "\x1b[2J", "", "x" * 300, "../etc"])
def test_a_name_is_nobody_elses(issuer: Issuer, store: Store, name: str) -> None:
    """Who calls themselves as an account of this service, or as another subject, is neither."""
    Accounts(store).add(AccountIn(name="admin", tenant="admin", role=Role.ADMIN))
    found = access(store, issuer).of(issuer.token(preferred_username=name), "10.0.0.1")
    other = access(store, issuer).of(issuer.token(preferred_username=name, sub="9"), "10.0.0.1")
    assert len({"admin", found.account, other.account}) == 3
    assert AccountIn(name=found.account, tenant=found.tenant)
    assert found.role is Role.PILOT


def test_an_account_can_be_disabled_and_narrowed(issuer: Issuer, store: Store) -> None:
    """By this service's administrator, whatever the issuer signs."""
    Accounts(store).add(AccountIn(name="admin", tenant="admin", role=Role.ADMIN))
    gate = access(store, issuer)
    name = gate.of(issuer.token(), "10.0.0.1").account
    Accounts(store).change(name, scopes=[Scope.SENSE])
    assert gate.of(issuer.token(), "10.0.0.1").scopes == {Scope.SENSE}
    Accounts(store).change(name, disabled=True)
    assert status_of(gate, issuer.token()) == 401


def encoded(part: object) -> str:
    """One part of a token."""
    return base64.urlsafe_b64encode(json.dumps(part).encode()).rstrip(b"=").decode()


def unsigned(issuer: Issuer, algorithm: str) -> str:
    """A token that says that it needs no signature."""
    return f"{encoded({'alg': algorithm, 'kid': 'first'})}.{encoded(issuer.claims())}."


def by_hmac(issuer: Issuer) -> str:
    """A token signed by HMAC, with the public key as its secret."""
    public = issuer.keys["first"].public_key()
    pem = serialization.PublicFormat.SubjectPublicKeyInfo
    secret = public.public_bytes(serialization.Encoding.PEM, pem)
    text = f"{encoded({'alg': 'HS256', 'kid': 'first'})}.{encoded(issuer.claims())}"
    mark = hmac.new(secret, text.encode(), hashlib.sha256).digest()
    return f"{text}.{base64.urlsafe_b64encode(mark).rstrip(b'=').decode()}"


def by_anothers_key(issuer: Issuer, **head: object) -> str:
    """A token signed by a key that is not the issuer's, under the id of one that is."""
    stranger = rsa.generate_private_key(public_exponent=65537, key_size=2048)
    return jwt.encode(issuer.claims(), stranger, "RS256", headers={"kid": "first", **head})


def with_its_own_key(issuer: Issuer) -> str:
    """A token that brings the key that it is to be verified by."""
    other = Issuer()
    jwk = other.published("first")
    return jwt.encode(
        issuer.claims(), other.keys["first"], "RS256", headers={"kid": "first", "jwk": jwk}
    )


def altered(issuer: Issuer) -> str:
    """A good token with other claims."""
    head, _, mark = issuer.token().split(".")
    return f"{head}.{encoded(issuer.claims(aerodaas_role='admin'))}.{mark}"


def by_unknown_key(issuer: Issuer) -> str:
    """A token under an id that the issuer does not publish."""
    other = Issuer()
    return jwt.encode(issuer.claims(), other.keys["first"], "RS256", headers={"kid": "other"})


FORGED: dict[str, Callable[[Issuer], str]] = {
    "none": lambda issuer: unsigned(issuer, "none"),
    "None": lambda issuer: unsigned(issuer, "None"),
    "no algorithm": lambda issuer: unsigned(issuer, ""),
    "HMAC with the public key": by_hmac,
    "another's key": by_anothers_key,
    "a key of its own": with_its_own_key,
    "another's address of keys": lambda issuer: by_anothers_key(issuer, jku="http://127.0.0.1:1"),
    "altered": altered,
    "unknown key": by_unknown_key,
    "no key id": lambda issuer: jwt.encode(issuer.claims(), issuer.keys["first"], "RS256"),
    "another algorithm": lambda issuer: jwt.encode(
        issuer.claims(), issuer.keys["first"], "PS256", headers={"kid": "first"}
    ),
    "no longer": lambda issuer: issuer.token(exp=int(time.time()) - 60),
    "not yet": lambda issuer: issuer.token(nbf=int(time.time()) + 600),
    "of tomorrow": lambda issuer: issuer.token(iat=int(time.time()) + 86400),
    "without end": lambda issuer: issuer.token(without="exp"),
    "another's audience": lambda issuer: issuer.token(aud="another service"),
    "no audience": lambda issuer: issuer.token(without="aud"),
    "another issuer": lambda issuer: issuer.token(iss="https://login.example"),
    "no issuer": lambda issuer: issuer.token(without="iss"),
    "nobody": lambda issuer: issuer.token(without="sub"),
    "an empty subject": lambda issuer: issuer.token(sub=""),
    "a long subject": lambda issuer: issuer.token(sub="x" * 300),
    "an end of 400 digits": lambda issuer: issuer.token(exp=10**400),
    "an end beyond numbers": lambda issuer: issuer.token(exp=1e300),
    "too large": lambda issuer: issuer.token(more="x" * 20_000),
    "dots": lambda _: "..",
    "words": lambda _: "a.b.c",
}


@pytest.mark.parametrize("name", FORGED)
def test_what_the_issuer_has_not_signed_for_this_service_is_refused(
    issuer: Issuer, store: Store, name: str
) -> None:
    """By the same words as any wrong token; no account is made of it, and it is audited."""
    gate = access(store, issuer)
    assert status_of(gate, FORGED[name](issuer)) == 401
    assert store.accounts.all() == []
    assert [one.action for one in store.audit.newest(9)] == ["token.refused"]
    assert status_of(gate, issuer.token()) == 200


TOLD: dict[str, tuple[Callable[[Issuer], str], list[str]]] = {
    "no audience": (lambda issuer: issuer.token(without="aud"), ["no aud"]),
    "Cognito": (lambda issuer: issuer.token(without="aud", client_id="4x"), ["'4x'", "ID token"]),
    "audience": (lambda issuer: issuer.token(aud=["account"]), ["['account']", "'drones'"]),
    "slash": (lambda issuer: issuer.token(iss=issuer.url + "/"), ["/farm/'", "/farm'"]),
    "no key id": (FORGED["no key id"], ["no kid"]),
    "unknown key": (by_unknown_key, ["no key 'other'"]),
    "ahead": (lambda issuer: issuer.token(iat=int(time.time()) + 45), ["iat", "NTP"]),
    "over": (lambda issuer: issuer.token(exp=5), ["exp is 5"]),
    "signature": (by_anothers_key, ["signature"]),
    "HMAC": (by_hmac, ["HS256"]),
    "escapes": (lambda issuer: issuer.token(aud="\x1b[2J\n" + "x" * 999), ["aud is '"]),
    "end": (lambda issuer: issuer.token(exp=10**400), ["exp is beyond"]),
}


@pytest.mark.parametrize("name", TOLD)
def test_the_log_says_why_a_token_is_refused(
    issuer: Issuer, store: Store, caplog: pytest.LogCaptureFixture, name: str
) -> None:
    """In one line of bounded length, with the claim; who sent it learns nothing of that."""
    make, words = TOLD[name]
    assert status_of(access(store, issuer), make(issuer)) == 401
    (line,) = [one.getMessage() for one in caplog.records if one.name.endswith("oidc")]
    assert all(word in line for word in words), line
    assert line.isprintable()
    assert len(line) < 600


def test_the_log_is_not_filled_by_refused_tokens(
    issuer: Issuer, store: Store, caplog: pytest.LogCaptureFixture
) -> None:
    """Nor by what is no token at all."""
    gate = access(store, issuer)
    for _ in range(5):
        status_of(gate, "a.b.c")
    for _ in range(20):
        status_of(gate, issuer.token(aud="another"))
    assert len([one for one in caplog.records if one.name.endswith("oidc")]) == 1


def test_a_key_of_another_kind_is_good_for_its_own_algorithm(issuer: Issuer, store: Store) -> None:
    """Elliptic curves beside RSA."""
    issuer.add("curve", curve=True)
    assert status_of(access(store, issuer), issuer.token("curve")) == 200


ROLES: list[tuple[dict[str, Any], Any, Role | None]] = [
    ({}, "operator", Role.OPERATOR),
    ({}, ["viewer", "operator", "pilot"], Role.OPERATOR),
    ({}, ["something", "pilot"], Role.PILOT),
    ({}, "something", None),
    ({}, [], None),
    ({}, {"admin": True}, None),
    ({}, [["admin"], 5, None], None),
    ({"roles": {"drone-pilots": Role.PILOT}}, ["drone-pilots"], Role.PILOT),
    ({"roles": {"drone-pilots": Role.PILOT}}, ["admin"], None),
]


@pytest.mark.parametrize(("settings", "given", "role"), ROLES)
def test_a_role_is_what_the_provider_makes_of_the_claim(
    issuer: Issuer,
    store: Store,
    settings: dict[str, Any],
    given: Any,  # noqa: ANN401 - JSON
    role: Role | None,
) -> None:
    """The highest of a list; an unknown one is refused with the claim's name."""
    gate = access(store, issuer, **settings)
    if role is not None:
        assert gate.of(issuer.token(aerodaas_role=given), "10.0.0.1").role is role
        return
    with pytest.raises(RefusedError, match="claim aerodaas_role has no role") as refused:
        gate.of(issuer.token(aerodaas_role=given), "10.0.0.1")
    assert refused.value.status == 403
    assert "aerodaas_role" in store.audit.newest(9)[0].text
    assert store.accounts.all() == []


def test_claims_may_lie_in_objects_and_have_names_with_dots(issuer: Issuer, store: Store) -> None:
    """As Keycloak and Auth0 write them."""
    claims = {"role_claim": "realm_access.roles", "tenant_claim": "https://farm.example/tenant"}
    roles = {"roles": ["operator"]}
    given: dict[str, Any] = {"realm_access": roles, "https://farm.example/tenant": "growers"}
    found = access(store, issuer, **claims).of(issuer.token(**given), "10.0.0.1")
    assert (found.role, found.tenant) == (Role.OPERATOR, "growers")


@pytest.mark.parametrize("tenant", [None, 5, "", "two words", "../farm", "x" * 65])
def test_without_a_tenant_nobody_comes_in(
    issuer: Issuer,
    store: Store,
    tenant: Any,  # noqa: ANN401 - JSON
) -> None:
    """It is told which claim is missing."""
    with pytest.raises(RefusedError, match="claim aerodaas_tenant names no tenant"):
        access(store, issuer).of(issuer.token(aerodaas_tenant=tenant), "10.0.0.1")


def test_refused_roles_are_slowed_as_wrong_tokens_are(issuer: Issuer, store: Store) -> None:
    """The audit log cannot be filled by them."""
    gate = access(store, issuer)
    token = issuer.token(aerodaas_role="none")
    assert {status_of(gate, token) for _ in range(300)} == {403, 429}


class Clock:
    """A clock that a test moves."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        """Seconds."""
        return self.now


def test_keys_rotate(issuer: Issuer) -> None:
    """A new one is fetched when it is first met, an old one is good no longer once it is gone."""
    clock = Clock()
    keys = IssuerKeys(issuer.url, clock)
    assert keys.key("first") is not None
    issuer.add("second")
    assert keys.key("second") is None, "asked just now"
    clock.now += issuer_keys._AGAIN
    assert keys.key("second") is not None
    del issuer.keys["first"]
    assert keys.key("first") is not None
    clock.now += issuer_keys._FRESH + 1
    assert keys.key("first") is None


def test_an_issuer_without_any_key_has_withdrawn_them_all(issuer: Issuer) -> None:
    """None is good any longer, as with one of several."""
    clock = Clock()
    keys = IssuerKeys(issuer.url, clock)
    assert keys.key("first") is not None
    issuer.keys.clear()
    clock.now += issuer_keys._FRESH + 1
    assert keys.key("first") is None


def test_a_key_for_encryption_signs_nothing(issuer: Issuer, store: Store) -> None:
    """Its token is refused as one of an unknown key."""
    issuer.use = "enc"
    assert status_of(access(store, issuer), issuer.token()) == 401


def test_made_up_ids_do_not_flood_the_issuer(issuer: Issuer) -> None:
    """However many there are, it is asked once in ten seconds, also while it is down."""
    clock = Clock()
    keys = IssuerKeys(issuer.url, clock)
    for number in range(100):
        assert keys.key(f"made up {number}") is None
    assert issuer.fetches == 1
    clock.now += issuer_keys._AGAIN
    keys.key("another")
    assert issuer.fetches == 2
    issuer.down, before = True, issuer.requests
    clock.now += issuer_keys._AGAIN
    for number in range(100):
        assert keys.key(f"made up {number}") is None
    assert issuer.requests == before + 1


def test_keys_are_not_fetched_from_where_a_redirect_leads(issuer: Issuer) -> None:
    """The address that was checked is the one that is asked."""
    with Issuer() as other:
        issuer.moved = f"{other.url}/keys"
        with pytest.raises(SourceError, match="302"):
            IssuerKeys(issuer.url).key("first")
        assert other.fetches == 0


def test_an_issuer_that_is_down_is_done_without_for_an_hour(issuer: Issuer, store: Store) -> None:
    """Then its tokens are refused as what cannot be verified now, and not as wrong."""
    clock = Clock()
    keys = IssuerKeys(issuer.url, clock)
    keys.key("first")
    issuer.down = True
    clock.now += issuer_keys._STALE - 1
    assert keys.key("first") is not None
    clock.now += 2
    with pytest.raises(SourceError, match=r"does not answer: .*500"):
        keys.key("first")
    assert status_of(access(store, issuer), issuer.token()) == 503
    assert store.audit.newest(9) == []


def test_an_issuer_of_another_name_is_not_believed(issuer: Issuer) -> None:
    """Its document names it exactly as the provider does."""
    issuer.called = "https://login.example"
    with pytest.raises(SourceError, match="calls itself"):
        IssuerKeys(issuer.url).key("first")


@pytest.mark.parametrize(
    "url",
    ["http://login.example", "ftp://login.example", "https://u:p@login.example", "", "https:"],
)
def test_keys_come_by_tls_or_from_this_machine(url: str) -> None:
    """Who could change them on the way could sign anything."""
    with pytest.raises(ConfigError, match="https://host"):
        OidcVerifier(OidcSettings(url, AUDIENCE))


def test_keys_of_this_machine_come_by_no_proxy(
    issuer: Issuer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It could change them on the way."""
    monkeypatch.setenv("http_proxy", "http://proxy.example:3128")
    monkeypatch.delenv("no_proxy", raising=False)
    with pytest.raises(ConfigError, match="set no_proxy"):
        IssuerKeys(issuer.url)
    monkeypatch.setenv("no_proxy", "127.0.0.1")
    assert IssuerKeys(issuer.url).key("first") is not None


def test_a_good_token_is_remembered_while_the_database_is_gone(
    issuer: Issuer, store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    """For its drones must still obey; one that was not there before is not let in."""
    gate, token = access(store, issuer), issuer.token()
    known = gate.of(token, "10.0.0.1")

    def gone(_: str) -> None:
        raise StoreError("no database")

    monkeypatch.setattr(store.accounts, "of_subject", gone)
    assert gate.of(token, "10.0.0.1") == known
    with pytest.raises(StoreError):
        gate.of(issuer.token(sub="7"), "10.0.0.1")
