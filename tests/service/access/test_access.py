"""Who has the right token is who they say; everybody else is refused, slowed and audited."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from aerodaas.protocol.schemas import USUAL_SCOPES, AccountIn, Role, Scope, TokenIn
from aerodaas.service.access import accounts as access
from aerodaas.service.access.accounts import Access, Accounts
from aerodaas.service.access.audit import Audit
from aerodaas.service.access.principal import Principal, require, sees
from aerodaas.service.errors import RefusedError, StoreError
from aerodaas.service.store import Store

DAY = 86400.0
HERE = "192.0.2.7"


class Service:
    """A store with what gives access to it, and a clock of its own."""

    def __init__(self, path: Path) -> None:
        """In a new database."""
        self.path = path
        self.now = 1e9
        self.told: list[str] = []
        self.store = Store.open(path)
        self.audit = Audit(self.store, lambda: self.now)
        self.accounts = Accounts(self.store, lambda: self.now)
        self.access = Access(self.store, self.audit, self.told.append, lambda: self.now)
        self.admin = str(self.accounts.first_token())
        self.accounts.add(AccountIn(name="pilot", tenant="farm"))

    def token(self, account: str = "pilot", **settings: object) -> str:
        """A new token."""
        request = TokenIn.model_validate({"account": account, **settings})
        return str(self.accounts.issue(request).secret)

    def refusal(self, token: str, address: str = HERE) -> tuple[int, str]:
        """Status and text of a refusal."""
        with pytest.raises(RefusedError) as refused:
            self.access.of(token, address)
        return refused.value.status, refused.value.text


@pytest.fixture
def service(tmp_path: Path) -> Iterator[Service]:
    """With an administrator and a pilot."""
    one = Service(tmp_path / "service.db")
    yield one
    one.store.close()


def test_a_token_tells_who_sends_a_request(service: Service) -> None:
    """With tenant, role and the token's own scopes."""
    token = service.token(scopes=["sense"])
    principal = service.access.of(token, HERE)
    assert principal == Principal(
        "pilot", "farm", Role.PILOT, frozenset({Scope.SENSE}), token.split("_")[1]
    )
    assert service.access.of(service.admin, HERE).role is Role.ADMIN


def test_the_first_token_is_made_once(service: Service) -> None:
    """Whoever starts the service again gets none."""
    assert service.accounts.first_token() is None
    again = Accounts(service.store)
    assert again.first_token() is None
    assert [account.name for account in service.store.accounts.all()] == ["admin", "pilot"]


def test_whatever_is_wrong_with_a_token_the_answer_is_the_same(service: Service) -> None:
    """It tells nobody which ids there are."""
    good = service.token()
    secret = good.split("_", 2)[2]
    short = service.token(days=1)
    revoked = service.accounts.issue(TokenIn(account="pilot"))
    service.accounts.revoke(revoked.id)
    service.accounts.add(AccountIn(name="left", tenant="farm"))
    left = service.token("left")
    service.accounts.change("left", disabled=True)
    other = service.admin.split("_", 2)[1]
    service.now += 2 * DAY
    wrong = {
        "missing": "",
        "of another form": "Basic cGlsb3Q6cGlsb3Q=",
        "unknown": f"aerodaas_{'0' * 16}_{secret}",
        "of another token": f"aerodaas_{other}_{secret}",
        "nearly right": good[:-1] + ("A" if good[-1] != "A" else "B"),
        "with a tail": good + "\n",
        "expired": short,
        "revoked": str(revoked.secret),
        "disabled": left,
    }
    answers = {why: service.refusal(token) for why, token in wrong.items()}
    assert {status for status, _ in answers.values()} == {401}
    assert len(set(answers.values())) == 1
    assert service.access.of(good, HERE).account == "pilot"


def test_a_token_ends_when_it_is_said_to(service: Service) -> None:
    """To the second."""
    token = service.token(days=1)
    service.now += DAY - 1
    assert service.access.of(token, HERE)
    service.now += 1
    assert service.refusal(token)[0] == 401


def test_the_database_holds_no_secret(service: Service) -> None:
    """Whoever reads it cannot fly by it."""
    token = service.token()
    service.access.of(token, HERE)
    service.refusal(f"{token}x")
    secret = token.split("_", 2)[2].encode()
    files = list(service.path.parent.iterdir())
    assert len(files) >= 2
    assert not [file for file in files if secret in file.read_bytes()]


def test_wrong_tokens_are_slowed_and_the_right_one_is_not(service: Service) -> None:
    """The audit log holds as many as were answered as such, and people are told once."""
    statuses = [service.refusal("guess")[0] for _ in range(30)]
    assert statuses == [401] * 10 + [429] * 20
    with pytest.raises(RefusedError) as refused:
        service.access.of("guess", HERE)
    assert refused.value.retry_after is not None
    assert 0 < refused.value.retry_after <= 60
    assert service.access.of(service.token(), HERE)
    assert service.refusal("guess", "198.51.100.1")[0] == 401
    entries = service.audit.newest(100)
    assert [entry.action for entry in entries] == ["token.refused"] * 11
    assert [entry.address for entry in entries] == ["198.51.100.1"] + [HERE] * 10
    assert service.told == [f"service: 20 wrong tokens from {HERE}"]


def test_a_token_is_worth_no_more_than_its_account(service: Service) -> None:
    """Neither when it is made nor later."""
    service.accounts.change("pilot", scopes=[Scope.FLY, Scope.SENSE])
    with pytest.raises(RefusedError, match="itself may not compute") as refused:
        service.token(scopes=["fly", "compute"])
    assert refused.value.status == 403
    token = service.token()
    service.accounts.change("pilot", scopes=[Scope.SENSE], role=Role.VIEWER)
    principal = service.access.of(token, HERE)
    assert principal.scopes == {Scope.SENSE}
    assert principal.role is Role.VIEWER


def test_an_administrator_is_always_left(service: Service) -> None:
    """Or nobody could give access again."""
    with pytest.raises(RefusedError, match="no administrator would be left") as refused:
        service.accounts.change("admin", disabled=True)
    assert refused.value.status == 409
    with pytest.raises(RefusedError, match="no administrator would be left"):
        service.accounts.change("admin", role=Role.OPERATOR)
    service.accounts.add(AccountIn(name="second", tenant="admin", role=Role.ADMIN))
    assert service.accounts.change("admin", disabled=True).disabled
    assert service.refusal(service.admin)[0] == 401
    with pytest.raises(RefusedError, match="no administrator"):
        service.accounts.change("second", role=Role.VIEWER)


def test_accounts_and_tokens_have_bounds(service: Service) -> None:
    """A second account of one name, a disabled account, an unknown one, and too many tokens."""
    with pytest.raises(RefusedError, match="already"):
        service.accounts.add(AccountIn(name="pilot", tenant="elsewhere"))
    with pytest.raises(RefusedError, match="no account nobody"):
        service.token("nobody")
    for _ in range(100):
        service.token()
    with pytest.raises(RefusedError, match="revoke some"):
        service.token()
    service.accounts.revoke(service.store.tokens.all("pilot")[0].id)
    assert service.token()
    service.accounts.change("pilot", disabled=True)
    with pytest.raises(RefusedError, match="is disabled"):
        service.token()
    with pytest.raises(RefusedError, match="no token"):
        service.accounts.revoke("0" * 16)


def test_while_the_database_is_gone_known_tokens_command_for_ten_minutes(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Drones in the air obey their users, also if the wall clock is set; nobody else comes in."""
    passed = [0.0]
    monkeypatch.setattr(access.time, "monotonic", lambda: passed[0])
    known, unused = service.token(), service.token()
    principal = service.access.of(known, HERE)
    service.path.rename(service.path.with_suffix(".away"))
    passed[0] += 599
    service.now += 3600
    assert service.access.of(known, HERE) == principal
    with pytest.raises(StoreError, match="is gone"):
        service.access.of(unused, HERE)
    forged = f"aerodaas_{unused.split('_')[1]}_{known.split('_', 2)[2]}"
    with pytest.raises(StoreError, match="is gone"):
        service.access.of(forged, HERE)
    passed[0] += 1
    with pytest.raises(StoreError, match="is gone"):
        service.access.of(known, HERE)


def test_a_revoked_token_is_not_remembered(service: Service) -> None:
    """When it was tried after that."""
    token = service.token()
    id_ = service.access.of(token, HERE).token
    service.accounts.revoke(id_)
    assert service.refusal(token)[0] == 401
    service.path.rename(service.path.with_suffix(".away"))
    with pytest.raises(StoreError):
        service.access.of(token, HERE)


@pytest.mark.parametrize("have", list(Role))
@pytest.mark.parametrize("wanted", list(Role))
def test_each_role_may_do_what_those_before_it_may(have: Role, wanted: Role) -> None:
    """In the order viewer, pilot, operator, admin."""
    order = [Role.VIEWER, Role.PILOT, Role.OPERATOR, Role.ADMIN]
    principal = Principal("a", "farm", have, frozenset(USUAL_SCOPES), "")
    if order.index(have) >= order.index(wanted):
        require(principal, wanted)
        return
    with pytest.raises(RefusedError, match=f"needs the role {wanted.value}") as refused:
        require(principal, wanted)
    assert refused.value.status == 403


def test_a_scope_that_the_token_lacks_is_refused() -> None:
    """Also to an administrator."""
    principal = Principal("a", "farm", Role.ADMIN, frozenset({Scope.SENSE}), "")
    require(principal, Role.PILOT, Scope.SENSE)
    with pytest.raises(RefusedError, match="not good for fly") as refused:
        require(principal, Role.PILOT, Scope.FLY)
    assert refused.value.status == 403


def test_a_tenant_sees_its_own_and_what_is_shared_with_it() -> None:
    """An operator sees all."""
    pilot = Principal("a", "farm", Role.PILOT, frozenset(USUAL_SCOPES), "")
    assert sees(pilot, "farm")
    assert not sees(pilot, "campus")
    assert sees(pilot, "campus", ["elsewhere", "farm"])
    assert sees(Principal("o", "provider", Role.OPERATOR, frozenset(), ""), "campus")
