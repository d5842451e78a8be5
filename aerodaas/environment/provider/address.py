"""Address of a provider's service."""

from __future__ import annotations

import ipaddress
from dataclasses import dataclass
from urllib.parse import urlsplit

from aerodaas.config.secrets import shown_text
from aerodaas.errors import ConfigError

__all__ = ["INSECURE_VARIABLE", "ServiceAddress", "is_url"]

INSECURE_VARIABLE = "AERODAAS_INSECURE"
"""Environment variable that, set to 1, allows http to other machines, as within a VPN."""
_PORTS = {"http": 80, "https": 443}


def is_url(text: object) -> bool:
    """Whether an environment's name is the address of a provider's service."""
    return isinstance(text, str) and text.lower().startswith(("http://", "https://"))


@dataclass(frozen=True)
class ServiceAddress:
    """Scheme, host, port and path of a service."""

    scheme: str
    host: str
    port: int
    path: str
    """Without a slash at its end; empty for a service that has the host for itself."""

    @classmethod
    def parse(cls, url: str, *, insecure: bool = False) -> ServiceAddress:
        """Read an address such as `https://provider.example/fields/campus`.

        Args:
            url: The address; https, or http to this machine.
            insecure: Allow http to another machine, which shows token and pictures on the way.

        Raises:
            ConfigError: For any other form, and for http to another machine unless `insecure`.
        """
        try:
            parts = urlsplit(url)
            port = parts.port
        except ValueError as error:
            raise ConfigError(f"a provider's address cannot be read: {error}") from None
        host = parts.hostname
        if parts.scheme not in _PORTS or not host:
            raise ConfigError(f"a provider's address is https://host, not {shown_text(url)!r}")
        if parts.username is not None or parts.query or parts.fragment:
            raise ConfigError(
                "a provider's address has no user, password or parameters: give the token by "
                "AERODAAS_TOKEN, token=… or `aerodaas login`"
            )
        if parts.scheme == "http" and not insecure and not _is_loopback(host):
            raise ConfigError(
                f"http to {host} would show token and pictures to everyone on the way: use https, "
                f"or set {INSECURE_VARIABLE}=1 if the way is secured otherwise"
            )
        return cls(parts.scheme, host, port or _PORTS[parts.scheme], parts.path.rstrip("/"))

    @property
    def base(self) -> str:
        """The address in one form for all its spellings."""
        return f"{self.scheme}://{self._place}{self.path}"

    @property
    def websocket(self) -> str:
        """The address for WebSockets."""
        return f"{'wss' if self.scheme == 'https' else 'ws'}://{self._place}{self.path}"

    @property
    def _place(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        return host if self.port == _PORTS[self.scheme] else f"{host}:{self.port}"


def _is_loopback(host: str) -> bool:
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
