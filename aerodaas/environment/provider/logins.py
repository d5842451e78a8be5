"""Tokens of providers: given, in the environment, or stored by `aerodaas login`."""

from __future__ import annotations

import json
import os
import stat
from pathlib import Path
from typing import Any

from aerodaas.environment.provider.address import INSECURE_VARIABLE, ServiceAddress
from aerodaas.environment.provider.client import ProviderClient
from aerodaas.errors import ConfigError
from aerodaas.files.private_file import write_private
from aerodaas.files.user_folders import config_folder
from aerodaas.text.json_text import read_json

__all__ = ["TOKEN_VARIABLE", "URL_VARIABLE", "Logins", "client_for", "default_url"]

TOKEN_VARIABLE = "AERODAAS_TOKEN"  # noqa: S105 - a name, not a secret
"""Environment variable of the token; it goes before a stored one."""
URL_VARIABLE = "AERODAAS_PROVIDER"
"""Environment variable of the provider that commands ask without --at or --to."""


class Logins:
    """The user's file of tokens by provider, mode 0600."""

    def __init__(self, path: Path | None = None) -> None:
        """Read and write `path`, or `aerodaas/logins.json` in the user's configuration folder."""
        self.path = path or config_folder() / "logins.json"

    def urls(self) -> list[str]:
        """Providers with a token, the newest last."""
        return list(self._read())

    def token(self, address: ServiceAddress) -> str | None:
        """The token for a provider; None if there is none.

        Raises ConfigError for a file that is malformed, or that others may read.
        """
        entry = self._read().get(address.base)
        return None if entry is None else str(entry["token"])

    def store(self, address: ServiceAddress, token: str) -> None:
        """Store a token in the place of an earlier one.

        Args:
            address: Address of the provider.
            token: Token of the account.

        Raises:
            ConfigError: If the token cannot be stored.
        """
        content = self._read()
        content.pop(address.base, None)
        self._write({**content, address.base: {"token": token}})

    def forget(self, address: ServiceAddress) -> bool:
        """Remove the token for a provider; whether there was one."""
        content = self._read()
        if content.pop(address.base, None) is None:
            return False
        self._write(content)
        return True

    def _read(self) -> dict[str, dict[str, Any]]:
        if not self.path.exists():
            return {}
        if stat.S_IMODE(self.path.stat().st_mode) & 0o077:
            raise ConfigError(
                f"{self.path} holds tokens and may be read by others: chmod 600 {self.path}"
            )
        content = read_json(self.path, "the file of logins")
        if not isinstance(content, dict) or not all(
            isinstance(one, dict) and isinstance(one.get("token"), str) for one in content.values()
        ):
            raise ConfigError(f"{self.path} is no file of logins: remove it, and log in again")
        return content

    def _write(self, content: dict[str, Any]) -> None:
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
            write_private(self.path, json.dumps(content, indent=2) + "\n")
        except OSError as error:
            raise ConfigError(f"cannot write {self.path}: {error.strerror}") from None


def client_for(url: str, token: str | None = None) -> ProviderClient:
    """A client with the token that is given, or else found.

    Args:
        url: Address of the provider.
        token: Token of the account; None for the environment variable's, else the stored one.

    Raises:
        ConfigError: For a malformed address or token, and if there is no token.
    """
    insecure = os.environ.get(INSECURE_VARIABLE) == "1"
    address = ServiceAddress.parse(url, insecure=insecure)
    found = token or os.environ.get(TOKEN_VARIABLE) or Logins().token(address)
    if not found:
        raise ConfigError(
            f"there is no token for {address.base}: `aerodaas login {address.base}`, or set "
            f"{TOKEN_VARIABLE}"
        )
    if not found.isascii() or not found.isprintable() or " " in found:
        raise ConfigError("a token consists of printable ASCII characters without spaces")
    return ProviderClient(url, found, insecure=insecure)


def default_url() -> str:
    """The provider to ask where none is named; raises ConfigError if that is not clear."""
    named = os.environ.get(URL_VARIABLE)
    if named:
        return named
    known = Logins().urls()
    if len(known) == 1:
        return known[0]
    several = f"you are logged in at {', '.join(known)}" if known else "you are not logged in"
    raise ConfigError(
        f"which provider? {several}: name it by --at URL or --to URL, or in {URL_VARIABLE}"
    )
