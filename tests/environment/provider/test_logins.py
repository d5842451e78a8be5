"""Addresses and tokens of providers."""

from __future__ import annotations

import stat

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from aerodaas.environment.provider.address import ServiceAddress, is_url
from aerodaas.environment.provider.logins import Logins, client_for, default_url
from aerodaas.errors import ConfigError

pytestmark = pytest.mark.usefixtures("own_logins")
_HOST = st.from_regex(r"[a-z][a-z0-9]{0,10}(\.[a-z]{2,5}){1,2}", fullmatch=True)
_PATH = st.sampled_from(["", "campus", "fields/campus-2", "a/b/c"])
PROVIDER = ServiceAddress.parse("https://provider.example")


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(_HOST, st.integers(1, 65535) | st.none(), _PATH, st.booleans())
def test_all_spellings_of_an_address_are_one(
    host: str,
    port: int | None,
    path: str,
    capitals: bool,  # noqa: FBT001
) -> None:
    """A token that is stored for one is found for the other."""
    place = host if port is None else f"{host}:{port}"
    url = f"https://{place.upper() if capitals else place}/{path}"
    address = ServiceAddress.parse(url)
    assert ServiceAddress.parse(address.base) == address == ServiceAddress.parse(f"{url}/")
    assert address.websocket == address.base.replace("https", "wss", 1)
    assert is_url(url)


@pytest.mark.parametrize(
    "url",
    [
        "provider.example",
        "ftp://provider.example",
        "https://",
        "https://provider.example:99999",
        "https://provider.example?token=x",
        "https://provider.example#x",
        "http://provider.example",
        "http://10.0.0.1:8400",
        "http://127.0.0.1.example:8400",
        "http://localhost.example",
    ],
)
def test_an_address_that_cannot_be_trusted_is_refused(url: str) -> None:
    """Above all, http to another machine; neither a token nor a password goes into an address."""
    with pytest.raises(ConfigError):
        ServiceAddress.parse(url)


def test_a_password_in_an_address_is_not_repeated() -> None:
    """An error may end in a log."""
    with pytest.raises(ConfigError) as raised:
        ServiceAddress.parse("https://ann:s3cret@provider.example")
    assert "s3cret" not in str(raised.value)
    with pytest.raises(ConfigError) as raised:
        ServiceAddress.parse("ftp://ann:s3cret@provider.example")
    assert "s3cret" not in str(raised.value)


def test_http_goes_to_this_machine_or_where_it_is_allowed(monkeypatch: pytest.MonkeyPatch) -> None:
    """By the loopback interface, or by the variable that says so."""
    for host in ("127.0.0.1", "localhost", "[::1]", "127.9.9.9"):
        assert ServiceAddress.parse(f"http://{host}:8400").port == 8400
    with pytest.raises(ConfigError, match="AERODAAS_INSECURE"):
        client_for("http://10.0.0.1:8400", "token")
    monkeypatch.setenv("AERODAAS_INSECURE", "1")
    assert client_for("http://10.0.0.1:8400", "token").address.host == "10.0.0.1"


def test_a_stored_token_is_its_users_alone() -> None:
    """Mode 0600; a file that others may read is refused, not used."""
    logins = Logins()
    logins.store(PROVIDER, "first")
    logins.store(PROVIDER, "second")
    assert stat.S_IMODE(logins.path.stat().st_mode) == 0o600
    assert Logins().token(PROVIDER) == "second"
    assert logins.urls() == ["https://provider.example"]
    logins.path.chmod(0o640)
    with pytest.raises(ConfigError, match="chmod 600"):
        Logins().token(PROVIDER)
    logins.path.chmod(0o600)
    assert logins.forget(PROVIDER)
    assert not logins.forget(PROVIDER)
    assert Logins().token(PROVIDER) is None


@pytest.mark.parametrize("content", ["{", "[]", '{"https://provider.example": "x"}', "5"])
def test_a_broken_file_of_logins_is_told(content: str) -> None:
    """With its place."""
    logins = Logins()
    logins.store(PROVIDER, "x")
    logins.path.write_text(content)
    with pytest.raises(ConfigError, match="logins"):
        logins.token(PROVIDER)


def test_the_nearest_token_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    """One that is given goes before the environment's, and that before a stored one."""
    url = PROVIDER.base
    with pytest.raises(ConfigError, match=r"aerodaas login https://provider\.example"):
        client_for(url)
    Logins().store(PROVIDER, "stored")
    assert _token(client_for(url)) == "stored"
    monkeypatch.setenv("AERODAAS_TOKEN", "named")
    assert _token(client_for(url)) == "named"
    assert _token(client_for(url, "given")) == "given"
    with pytest.raises(ConfigError, match="printable"):
        client_for(url, "two\r\nX-Lines: 1")


def test_the_provider_need_not_be_named_where_there_is_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """With none, and with several, it must be."""
    with pytest.raises(ConfigError, match="not logged in"):
        default_url()
    Logins().store(PROVIDER, "x")
    assert default_url() == "https://provider.example"
    Logins().store(ServiceAddress.parse("https://other.example"), "y")
    with pytest.raises(ConfigError, match=r"provider.example, https://other.example"):
        default_url()
    monkeypatch.setenv("AERODAAS_PROVIDER", "https://third.example")
    assert default_url() == "https://third.example"


def test_a_file_that_cannot_be_written_is_told() -> None:
    """Nothing is left beside it."""
    logins = Logins()
    logins.path.parent.parent.mkdir(parents=True)
    logins.path.parent.write_text("a file where the folder would be")
    with pytest.raises(ConfigError, match="cannot write"):
        logins.store(PROVIDER, "x")
    assert [one.name for one in logins.path.parent.parent.iterdir()] == ["aerodaas"]


def _token(client: object) -> str:
    header: str = client._exchange.headers["Authorization"]  # type: ignore[attr-defined]
    return header.removeprefix("Bearer ")
