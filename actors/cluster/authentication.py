"""The token by which the processes of a cluster know each other, and the file that keeps it.

Without it, a process that reaches one of Ray's ports runs code as the user who started Ray.
"""

from __future__ import annotations

import os
import secrets
import stat
import warnings
from pathlib import Path

from aerodaas.actors.cluster.ray_variables import AUTH_MODE, UNAUTHENTICATED
from aerodaas.errors import AeroDaaSError, ConfigError

__all__ = ["make_token", "refusal", "require_authentication", "require_token"]

_ADVICE = (
    "copy the head's (`aerodaas cluster token` there tells its file) to ~/.ray/auth_token here, "
    "with mode 0600, or set RAY_AUTH_TOKEN_PATH to its file"
)


def require_authentication() -> bool:
    """Return whether Ray's token authentication is on, in this process and those that it starts.

    The package `aerodaas.actors` switches it on before it imports Ray. Only
    `AERODAAS_UNAUTHENTICATED=1` switches it off, with a warning.

    Raises:
        ConfigError: RAY_AUTH_MODE asks for another mode, or Ray was imported without one.
    """
    mode = os.environ.get(AUTH_MODE, "")
    if os.environ.get(UNAUTHENTICATED) == "1":
        warnings.warn(
            f"{UNAUTHENTICATED}=1: Ray asks for no token, and all who reach its ports can run "
            "code as this user",
            stacklevel=2,
        )
        return mode.lower() == "token"
    if not mode:
        raise ConfigError(
            "ray was imported before aerodaas, which requires its token: import aerodaas first, or "
            f"set {AUTH_MODE}=token"
        )
    if mode.lower() != "token":
        raise ConfigError(
            f"{AUTH_MODE}={mode} would let all who reach Ray's ports run code as this user: unset "
            f"it, or set {UNAUTHENTICATED}=1 if that is wanted"
        )
    return True


def make_token() -> Path | None:
    """Return the file of this user's token, made if missing; None if RAY_AUTH_TOKEN holds it.

    Raises AeroDaaSError if the file is missing where RAY_AUTH_TOKEN_PATH names it, is empty, or
    others can have read or written it.
    """
    if os.environ.get("RAY_AUTH_TOKEN"):
        return None
    path = _path()
    if not path.exists() and not os.environ.get("RAY_AUTH_TOKEN_PATH"):
        _write(path)
    _examine(path)
    return path


def require_token(address: str) -> None:
    """Check that this user has a token for the cluster at `address`; raises AeroDaaSError."""
    if os.environ.get("RAY_AUTH_TOKEN"):
        return
    path = _path()
    if not path.exists():
        raise AeroDaaSError(f"no token for the cluster at {address}: {path} is missing; {_ADVICE}")
    _examine(path)


def refusal(address: str) -> AeroDaaSError:
    """The error of a cluster that does not take our token."""
    return AeroDaaSError(f"the cluster at {address} refuses our token: {_ADVICE}")


def _path() -> Path:
    named = os.environ.get("RAY_AUTH_TOKEN_PATH")
    return Path(named) if named else Path.home() / ".ray" / "auth_token"


def _write(path: Path) -> None:
    # Written to a file of its own and linked: two applications may start at the same time.
    own = path.with_name(f"auth_token.{os.getpid()}.{secrets.token_hex(4)}")
    try:
        path.parent.mkdir(mode=0o700, exist_ok=True)
        with os.fdopen(os.open(own, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as file:
            file.write(secrets.token_hex(32))
    except OSError as error:
        raise AeroDaaSError(
            f"cannot make a token in {path.parent}: {error.strerror}; set RAY_AUTH_TOKEN_PATH to "
            "the file of one"
        ) from None
    try:
        os.link(own, path)
    except FileExistsError:
        pass
    finally:
        own.unlink()


def _examine(path: Path) -> None:
    """Raise AeroDaaSError if it holds no token of ours; take the rights of others on it away."""
    try:
        with path.open("rb") as file:
            found = os.fstat(file.fileno())
            if not file.read().strip():
                raise AeroDaaSError(f"the token's file {path} is empty: remove it; {_ADVICE}")
            if found.st_uid not in {os.geteuid(), 0}:
                raise AeroDaaSError(
                    f"the token's file {path} belongs to user {found.st_uid}, who then runs code "
                    "as this user: make one of your own"
                )
            others = stat.S_IRWXO | (0 if found.st_uid != os.geteuid() else stat.S_IRWXG)
            if found.st_mode & others:
                _close(path, file.fileno(), found)
    except OSError as error:
        raise AeroDaaSError(
            f"the token's file {path} cannot be read: {error.strerror}; {_ADVICE}"
        ) from None
    folder = path.parent.stat()
    if folder.st_uid == os.geteuid() and folder.st_mode & 0o022 and not folder.st_mode & 0o1000:
        path.parent.chmod(stat.S_IMODE(folder.st_mode) & ~0o022)
        warnings.warn(f"others could exchange the files in {path.parent}: mended", stacklevel=4)


def _close(path: Path, descriptor: int, found: os.stat_result) -> None:
    if found.st_uid != os.geteuid():
        raise AeroDaaSError(
            f"all users of this machine can read or write the token's file {path}: have its "
            "owner make a new one with mode 0600"
        )
    os.fchmod(descriptor, 0o600)
    warnings.warn(
        f"others could read or write the token's file {path}, which now has mode 0600; if there "
        "are other users here, remove it, make a new one (`aerodaas cluster token`) and copy that "
        "to all nodes",
        stacklevel=5,
    )
