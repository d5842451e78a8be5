"""Ray always asks for a token, and its file is this user's alone."""

from __future__ import annotations

import os
import stat
import sys
import types
import warnings
from pathlib import Path

import pytest
from required import needs_root

from aerodaas.actors.cluster.authentication import (
    make_token,
    require_authentication,
    require_token,
)
from aerodaas.actors.cluster.ray_variables import UNAUTHENTICATED, set_variables
from aerodaas.errors import AeroDaaSError, ConfigError

NAMES = ("RAY_AUTH_MODE", "RAY_AUTH_TOKEN", "RAY_AUTH_TOKEN_PATH", UNAUTHENTICATED)
NOBODY = 65534


@pytest.fixture(autouse=True)
def token(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the token of a fresh user belongs."""
    for name in NAMES:
        monkeypatch.setenv(name, "")  # so that it is put back
        monkeypatch.delenv(name)
    monkeypatch.delitem(sys.modules, "ray", raising=False)
    monkeypatch.setenv("HOME", str(tmp_path))
    return tmp_path / ".ray" / "auth_token"


def mode(path: Path) -> int:
    """Its rights."""
    return stat.S_IMODE(path.stat().st_mode)


def test_a_fresh_user_gets_a_token(token: Path) -> None:
    """For this user alone, whatever the umask; and it stays the same."""
    before = os.umask(0)
    try:
        set_variables()
        assert require_authentication()
        assert make_token() == token
    finally:
        os.umask(before)
    assert os.environ["RAY_AUTH_MODE"] == "token"
    assert mode(token) == 0o600
    assert mode(token.parent) == 0o700
    assert list(token.parent.iterdir()) == [token]
    first = token.read_text()
    assert len(first) == 64
    make_token()
    assert token.read_text() == first


def test_a_token_that_others_could_read_is_closed(token: Path) -> None:
    """As `ray get-auth-token --generate` leaves one, and said."""
    token.parent.mkdir()
    token.write_text("of-rays-own-making")
    token.chmod(0o644)
    with pytest.warns(UserWarning, match="others could read or write"):
        make_token()
    assert mode(token) == 0o600
    assert token.read_text() == "of-rays-own-making"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        make_token()


def test_a_folder_in_which_others_could_exchange_it_is_closed(token: Path) -> None:
    """Said, too."""
    make_token()
    token.parent.chmod(0o777)
    with pytest.warns(UserWarning, match="could exchange"):
        require_token("10.0.0.1:6379")
    assert mode(token.parent) == 0o755


def test_an_empty_token_is_refused(token: Path) -> None:
    """Ray would end the process."""
    token.parent.mkdir()
    token.touch(0o600)
    with pytest.raises(AeroDaaSError, match=r"auth_token is empty: remove it"):
        make_token()


@needs_root
def test_a_token_of_another_user_is_refused(token: Path) -> None:
    """Who knows it could run code as this user."""
    make_token()
    os.chown(token, NOBODY, NOBODY)
    with pytest.raises(AeroDaaSError, match="belongs to user 65534"):
        make_token()


def test_a_named_file_has_to_be_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is not made behind the user's back."""
    monkeypatch.setenv("RAY_AUTH_TOKEN_PATH", str(tmp_path / "elsewhere"))
    with pytest.raises(AeroDaaSError, match=r"elsewhere cannot be read: No such file"):
        make_token()
    with pytest.raises(AeroDaaSError, match=r"elsewhere is missing; copy the head's"):
        require_token("10.0.0.1:6379")


def test_joining_makes_no_token(token: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It would be the wrong one; one line says what to do."""
    with pytest.raises(
        AeroDaaSError, match=r"no token for the cluster at 10\.0\.0\.1:6379"
    ) as told:
        require_token("10.0.0.1:6379")
    assert "\n" not in str(told.value)
    assert not token.exists()
    monkeypatch.setenv("RAY_AUTH_TOKEN", "a-token")
    require_token("10.0.0.1:6379")
    assert make_token() is None


@pytest.mark.parametrize("asked", ["disabled", "k8s", "", "DISABLED"])
def test_no_other_mode(asked: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A variable that somebody left set switches nothing off; an empty one is none."""
    monkeypatch.setenv("RAY_AUTH_MODE", asked)
    set_variables()
    if asked:
        with pytest.raises(ConfigError, match=f"RAY_AUTH_MODE={asked} would let all"):
            require_authentication()
    else:
        assert require_authentication()


def test_off_by_an_explicit_flag_with_a_warning(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each time."""
    monkeypatch.setenv(UNAUTHENTICATED, "1")
    set_variables()
    for _ in range(2):
        with pytest.warns(UserWarning, match="Ray asks for no token"):
            assert not require_authentication()
    assert os.environ["RAY_AUTH_MODE"] == "disabled"


def test_ray_imported_first_has_no_token(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ray reads the mode as it is imported, so a mode that is set later would mean nothing."""
    monkeypatch.setitem(sys.modules, "ray", types.ModuleType("ray"))
    set_variables()
    with pytest.raises(ConfigError, match="import aerodaas first"):
        require_authentication()
