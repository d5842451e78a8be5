"""Accounts and their tokens: made, changed, and found by what a request carries."""

from __future__ import annotations

import hashlib
import hmac
import re
import secrets
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from http import HTTPStatus

from aerodaas.protocol.schemas import USUAL_SCOPES, AccountIn, Role, Scope, TokenIn, TokenOut
from aerodaas.service.access.audit import Audit
from aerodaas.service.access.oidc import Issued, OidcVerifier
from aerodaas.service.access.principal import Principal
from aerodaas.service.errors import RefusedError, StoreError
from aerodaas.service.http.limits import WrongTokens
from aerodaas.service.store import Account, Store, Tenant, Token

__all__ = ["Access", "Accounts", "Secret", "digest_of", "fits", "new_secret", "parse"]

_FORM = re.compile(r"aerodaas_([0-9a-f]{16})_([A-Za-z0-9_\-]{43})")
"""`aerodaas_<id>_<secret>`: the first word lets scanners of published files find it."""
_ID_BYTES = 8
_SECRET_BYTES = 32
"""As many as `secrets` takes by default: nobody guesses them, so a plain hash keeps them."""


@dataclass(frozen=True, slots=True)
class Secret:
    """The two parts of a token; `repr` shows the id alone."""

    id: str
    secret: str

    def __repr__(self) -> str:
        return f"Secret({self.id})"

    @property
    def text(self) -> str:
        """Token as a request carries it."""
        return f"aerodaas_{self.id}_{self.secret}"


def new_secret() -> Secret:
    """A new token of 32 random bytes."""
    return Secret(secrets.token_hex(_ID_BYTES), secrets.token_urlsafe(_SECRET_BYTES))


def parse(text: str) -> Secret | None:
    """The parts of a token; None for what has not its form."""
    found = _FORM.fullmatch(text)
    return Secret(*found.groups()) if found else None


def digest_of(secret: str) -> str:
    """SHA-256 of a secret, hexadecimal: all that is kept of it."""
    return hashlib.sha256(secret.encode()).hexdigest()


def fits(secret: str, digest: str) -> bool:
    """Whether a secret is the one of a digest; compared in constant time.

    Args:
        secret: The secret, as it was sent.
        digest: As `digest_of` makes it.
    """
    return hmac.compare_digest(digest_of(secret), digest)


_FIRST = "admin"
_FIRST_DAYS = 365.0
_NAME_LETTERS = 40
_MOST_TOKENS = 100
_DAY = 86400.0
"""Seconds."""


class Accounts:
    """Makes, changes and lists accounts and tokens; the caller has checked who may.

    Every method raises StoreError if the database does not answer. Threads may share it.
    """

    def __init__(self, store: Store, clock: Callable[[], float] = time.time) -> None:
        """Keep them in `store`; `clock` is Unix time."""
        self._store = store
        self._clock = clock
        self._lock = threading.Lock()
        self.on_change: Callable[[str], None] = lambda _: None
        """Called with the name of an account that has changed, or lost a token."""

    def first_token(self) -> str | None:
        """Make the account `admin` with a token of a year; None if there is a token already.

        Returns:
            The token, which is nowhere else: it is to be shown once.
        """
        if self._store.tokens.all():
            return None
        if self._store.accounts.get(_FIRST) is None:
            self.add(AccountIn(name=_FIRST, tenant=_FIRST, role=Role.ADMIN))
        return self.issue(TokenIn(account=_FIRST, days=_FIRST_DAYS)).secret

    def add(self, account: AccountIn) -> Account:
        """Make an account, and its tenant without quotas if there is none of this name.

        Raises:
            RefusedError: With status 409, if there is one of this name; 422 for an agent's that
                may more than an agent.
        """
        _require_separate(account.role, account.scopes)
        given = {**dict(account), "scopes": frozenset(account.scopes)}
        row = Account(**given, created=self._clock())
        with self._lock:
            self._add(row)
        return row

    def of_issued(self, issued: Issued) -> Account:
        """The account of a token's subject, with the token's tenant and role.

        It is made at the first request; its scopes, and whether it is disabled, are the
        administrator's to change.
        """
        row = self._store.accounts.of_subject(issued.subject)
        if row is not None and (row.tenant, row.role) == (issued.tenant, issued.role):
            return row
        with self._lock:
            row = self._store.accounts.of_subject(issued.subject)
            if row is None:
                row = Account(
                    name=_name_of(issued),
                    tenant=issued.tenant,
                    role=issued.role,
                    scopes=frozenset(USUAL_SCOPES),
                    created=self._clock(),
                    subject=issued.subject,
                )
                self._add(row)
                return row
            self._add_tenant(issued.tenant)
            return self._store.accounts.update(
                row.name, lambda one: replace(one, tenant=issued.tenant, role=issued.role)
            )

    def _add(self, row: Account) -> None:
        self._add_tenant(row.tenant)
        self._store.accounts.add(row)

    def _add_tenant(self, name: str) -> None:
        if self._store.tenants.get(name) is None:
            self._store.tenants.add(Tenant(name, created=self._clock()))

    def change(
        self,
        name: str,
        *,
        role: Role | None = None,
        scopes: Collection[Scope] | None = None,
        disabled: bool | None = None,
    ) -> Account:
        """Change what is not None; its tokens obey at once.

        Args:
            name: Name of the account.
            role: Its new role.
            scopes: Its new scopes.
            disabled: Whether it is disabled.

        Raises:
            RefusedError: With status 404 for an unknown account; 409 if no administrator would
                be left; 422 for an agent's account that would be more than that.
        """
        with self._lock:
            others = [
                one
                for one in self._store.accounts.all()
                if one.role is Role.ADMIN and not one.disabled and one.name != name
            ]

            def changed(row: Account) -> Account:
                new = replace(
                    row,
                    role=row.role if role is None else role,
                    scopes=row.scopes if scopes is None else frozenset(scopes),
                    disabled=row.disabled if disabled is None else disabled,
                )
                _require_separate(new.role, new.scopes)
                if not others and (new.role is not Role.ADMIN or new.disabled):
                    raise RefusedError(409, "no administrator would be left: make another first")
                return new

            found = self._store.accounts.update(name, changed)
        self.on_change(name)
        return found

    def issue(self, request: TokenIn) -> TokenOut:
        """Make a token; the answer alone has its secret.

        Raises:
            RefusedError: With status 404 for an unknown account; 409 for a disabled one, or one
                with 100 valid tokens; 403 for scopes beyond the account's.
        """
        now = self._clock()
        account = self._store.accounts.require(request.account)
        if account.disabled:
            raise RefusedError(409, f"account {account.name} is disabled")
        scopes = account.scopes if request.scopes is None else frozenset(request.scopes)
        if scopes - account.scopes:
            beyond = ", ".join(sorted(scope.value for scope in scopes - account.scopes))
            raise RefusedError(403, f"account {account.name} itself may not {beyond}")
        new = new_secret()
        row = Token(
            id=new.id,
            account=account.name,
            digest=digest_of(new.secret),
            scopes=scopes,
            created=now,
            expires=now + request.days * _DAY,
        )
        with self._lock:
            tokens = self._store.tokens.all(account.name)
            if sum(not one.revoked and now < one.expires for one in tokens) >= _MOST_TOKENS:
                raise RefusedError(
                    409, f"account {account.name} has {_MOST_TOKENS} tokens: revoke some"
                )
            self._store.tokens.add(row)
        return TokenOut.model_validate(row).model_copy(update={"secret": new.text})

    def revoke(self, token: str) -> Token:
        """Revoke a token by its id; raises RefusedError with status 404 if there is none."""
        row = self._store.tokens.update(token, lambda row: replace(row, revoked=True))
        self.on_change(row.account)
        return row


def _require_separate(role: Role, scopes: Collection[Scope]) -> None:
    """Refuse an account that proposes missions, and could fly or approve them itself."""
    if Scope.PROPOSE not in scopes:
        return
    if Scope.FLY in scopes:
        raise RefusedError(
            422,
            "an account has either the scope fly or propose, for who proposes a mission does not "
            "fly it: leave one out, or make two accounts",
        )
    if role is not Role.PILOT:
        raise RefusedError(
            422,
            f"an account with the scope propose is an agent's, and has the role pilot, not "
            f"{role.value}: people approve by accounts of their own",
        )


def _name_of(issued: Issued) -> str:
    """A name that people can read and no other account has, whatever others are called."""
    readable = re.sub(r"[^\w\-]", "-", issued.name)[:_NAME_LETTERS]
    first = "" if readable[:1].isalpha() else "u"
    return f"{first}{readable}-{hashlib.sha256(issued.subject.encode()).hexdigest()[:16]}"


_NO_SECRET = "0" * 64
_REMEMBERED = 600.0
"""Seconds for which a token is known while the database does not answer."""
_MOST_REMEMBERED = 1000
_RELEASED = 1_704_067_200.0
"""2024 in Unix seconds: before it there was no release, so a clock that shows it is not set."""


class Access:
    """Tells who sends a request by its token; wrong tokens are counted, slowed and audited.

    The right token is never refused for the wrong ones of others behind the same address. While
    the database does not answer, a token that was right in the last ten minutes, and whose account
    has not changed since, stays so, for its drones must still obey. Threads may share it.
    """

    def __init__(
        self,
        store: Store,
        audit: Audit,
        tell: Callable[[str], None] = lambda _: None,
        clock: Callable[[], float] = time.time,
        issuer: OidcVerifier | None = None,
    ) -> None:
        """Look tokens up in `store`; `tell` people of many wrong ones; times are Unix time.

        With an `issuer`, its tokens are good beside the store's.
        """
        self._issuer = issuer
        self._accounts = Accounts(store, clock)
        self._store = store
        self._audit = audit
        self._clock = clock
        self._lock = threading.Lock()
        self._wrong = WrongTokens(tell, server="service")
        self._known: OrderedDict[str, tuple[Principal, float]] = OrderedDict()

    def of(self, token: str, address: str) -> Principal:
        """Find the account that sends a request.

        Args:
            token: What followed `Bearer` in its header; empty for none.
            address: Where it comes from.

        Raises:
            RefusedError: With status 401 for a token that is missing, malformed, unknown, wrong,
                expired or revoked, or whose account is disabled; all with the same text. With
                403 for an issuer's without tenant or role. With 429 and `retry_after` after many
                of these from one address or overall. With 503 if the issuer has to be asked and
                does not answer.
            StoreError: If the database does not answer, and the token is not remembered.
        """
        refusal = RefusedError(401, "wrong or missing token: send it as `Authorization: Bearer …`")
        try:
            principal = self._look_up(token)
        except RefusedError as error:
            if error.status != HTTPStatus.FORBIDDEN:
                raise
            principal, refusal = None, error
        if principal is not None:
            return principal
        with self._lock:
            pause = self._wrong.count(address)
        if pause:
            raise RefusedError(429, "too many wrong tokens", retry_after=pause)
        # So many entries as wrong tokens are answered as such, and no more: an audit log that a
        # stranger can fill tells nothing.
        self._audit.write(
            None,
            "token.refused",
            text="" if refusal.status == HTTPStatus.UNAUTHORIZED else refusal.text,
            accepted=False,
            address=address,
            required=False,
        )
        raise refusal

    def forget(self, account: str) -> None:
        """Remember no token of an account while the database does not answer: it has changed."""
        with self._lock:
            for key in [one for one, (who, _) in self._known.items() if who.account == account]:
                del self._known[key]

    def _look_up(self, text: str) -> Principal | None:
        given = parse(text)
        if given is None:
            return None if self._issuer is None else self._of_issuer(text, self._issuer)
        key = digest_of(given.secret)
        try:
            found = self._store.tokens.owned(given.id)
        except StoreError:
            principal = self._remembered(key)
            if principal is None or principal.token != given.id:
                raise
            return principal
        if found is None:
            fits(given.secret, _NO_SECRET)  # as long as for a known one
            return None
        token, account = found
        right = fits(given.secret, token.digest)
        if right and token.created < _RELEASED <= self._clock():
            token = self._store.tokens.update(token.id, self._dated)
        valid = not token.revoked and self._clock() < token.expires and not account.disabled
        if not right or not valid:
            self._forget(key)
            return None
        scopes = token.scopes & account.scopes
        return self._admitted(key, account, scopes, token.id, token.expires)

    def _dated(self, token: Token) -> Token:
        """A token that was issued before the machine's clock was set: its days begin now."""
        if token.created >= _RELEASED:
            return token
        now = self._clock()
        return replace(token, created=now, expires=now + token.expires - token.created)

    def _of_issuer(self, text: str, issuer: OidcVerifier) -> Principal | None:
        issued = issuer.issued(text)
        if issued is None:
            return None
        key = digest_of(text)
        try:
            account = self._accounts.of_issued(issued)
        except StoreError:
            principal = self._remembered(key)
            if principal is None:
                raise
            return principal
        if account.disabled:
            self._forget(key)
            return None
        return self._admitted(key, account, account.scopes, issued.subject, issued.expires)

    def _admitted(
        self,
        key: str,
        account: Account,
        scopes: frozenset[Scope],
        token: str,
        expires: float,
    ) -> Principal:
        """Principal of a valid token; remembered while the database does not answer."""
        agent, role = Scope.PROPOSE in account.scopes, account.role
        if agent:
            # An issuer may name another role, and an older row hold more.
            scopes -= {Scope.FLY}
            role = Role.PILOT if role.reaches(Role.PILOT) else role
        principal = Principal(account.name, account.tenant, role, scopes, token, agent)
        with self._lock:
            # The database and the wall clock may fail together, as a machine starts.
            left = min(expires - self._clock(), _REMEMBERED)
            self._known[key] = (principal, time.monotonic() + left)
            self._known.move_to_end(key)
            if len(self._known) > _MOST_REMEMBERED:
                self._known.popitem(last=False)
        return principal

    def _forget(self, key: str) -> None:
        with self._lock:
            self._known.pop(key, None)

    def _remembered(self, key: str) -> Principal | None:
        with self._lock:
            principal, until = self._known.get(key, (None, 0.0))
        return principal if time.monotonic() < until else None
