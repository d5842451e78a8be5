"""Where an environment comes from: a file, a provider's catalogue, a recording."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aerodaas.config.checked import checked
from aerodaas.config.model import EnvironmentConfig
from aerodaas.config.options import RunOptions
from aerodaas.config.overrides import located, overridden
from aerodaas.environment.provider.address import is_url
from aerodaas.errors import ConfigError

if TYPE_CHECKING:
    from aerodaas.environment.provider.client import ProviderClient

__all__ = ["EnvironmentSource"]


@dataclass(frozen=True)
class EnvironmentSource:
    """An environment, and what it was read from."""

    path: Path
    """The file; a provider's host."""
    config: EnvironmentConfig
    place: str
    """Names it in errors."""
    client: ProviderClient | None = None
    """Of the provider whose catalogue it is."""

    @classmethod
    def find(
        cls,
        path: str | Path,
        overrides: Mapping[str, Any] | None,
        token: str | None,
        options: RunOptions,
    ) -> EnvironmentSource:
        """Find what an application's `path` means under the run's `options`.

        Args:
            path: Environment file, or a provider's address.
            overrides: Settings by dotted path that replace the file's; those of `options` go before
                them.
            token: Token for a provider's address; None for the stored one.
            options: Options of the run.

        Raises:
            ConfigError: For a file that is missing or malformed, and for a token with a file.
            AeroDaaSError: The errors of a provider.
        """
        url = _url(path, options)
        if url is not None:
            return cls._of_provider(url, token, {**(overrides or {}), **options.overrides})
        if token is not None and not is_url(path):
            raise ConfigError(f"a token is for a provider's address, and {path} is a file")
        file = options.beside_application(options.environment or Path(path))
        settings = {**(overrides or {}), **options.overrides}
        if options.seed is not None:
            settings["simulation.seed"] = options.seed
        if options.replay is None:
            given = options.config or EnvironmentConfig.load(file)
            config = overridden(given, settings)
        else:
            from aerodaas.recording.replay.environment import (  # noqa: PLC0415 - only for a replay
                replay_environment,
            )

            local = file if options.environment is not None else None
            config = overridden(replay_environment(options.replay, local), options.overrides)
        return cls(file, located(config, file.parent), str(options.replay or file))

    @classmethod
    def _of_provider(
        cls, url: str, token: str | None, settings: Mapping[str, Any]
    ) -> EnvironmentSource:
        from aerodaas.environment.provider.logins import client_for  # noqa: PLC0415 - only then

        if settings:
            raise ConfigError(
                f"{', '.join(settings)}: a provider's environment is the provider's, and no "
                "settings can be laid over it"
            )
        client = client_for(url, token)
        place = f"the catalogue of {client.address.base}"
        config = checked(EnvironmentConfig, client.fleet().environment, place)
        return cls(Path(client.address.host), config, place, client)


def _url(path: str | Path, options: RunOptions) -> str | None:
    """The provider to ask; None where the environment is another."""
    if options.provider.url is not None:
        return options.provider.url
    given = options.environment or options.config or options.replay
    return str(path) if given is None and is_url(path) else None
