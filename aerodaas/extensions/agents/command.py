"""`aerodaas agent`: an agent proposes missions over standard input and output."""

from __future__ import annotations

import os
import sys
import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from aerodaas.config.extras import require_extra
from aerodaas.errors import ConfigError

if TYPE_CHECKING:
    from aerodaas.environment.provider.client import ProviderClient

__all__ = ["agent"]


def agent(
    env: Annotated[
        Path | None,
        typer.Option(help="Environment file of a simulated fleet, which is served meanwhile."),
    ] = None,
    to: Annotated[
        str | None,
        typer.Option(metavar="URL", help="A service that is there; token in AERODAAS_TOKEN."),
    ] = None,
    state: Annotated[
        Path | None, typer.Option(help="Folder that keeps missions. Default: none are kept.")
    ] = None,
    speed: Annotated[
        str, typer.Option(help="Mission seconds per wall second of the simulated fleet, or `max`.")
    ] = "1",
    browser: Annotated[  # noqa: FBT002 - Typer's flags
        bool, typer.Option(help="Open the page on which a person approves missions.")
    ] = True,
) -> None:
    """Let an agent propose missions (MCP over standard input and output).

    The agent's program starts it. A mission flies once it was rehearsed, and a person has approved
    it on the page whose address is printed to standard error.

        aerodaas agent --env farm.json
        AERODAAS_TOKEN=… aerodaas agent --to https://provider.example
    """
    require_extra("agents", "aerodaas agent")
    if (env is None) == (to is None):
        raise ConfigError(
            "give either --env FILE, a simulated fleet, or --to URL, a service that is there"
        )
    from aerodaas.environment.provider.logins import client_for  # noqa: PLC0415 - slow to load
    from aerodaas.extensions.agents.local import local_service  # noqa: PLC0415 - as above

    if to is not None:
        if state is not None:
            raise ConfigError("--state is of a fleet that is served here: leave it out with --to")
        _serve(client_for(to))
        return
    assert env is not None  # noqa: S101 - as was checked above
    with local_service(env, state, speed) as service:
        page = f"{service.url}/#token={service.person}"
        sys.stderr.write(f"a person approves missions here: {page}\n")
        if browser and not _shown(page):
            sys.stderr.write("no browser was found: open that address yourself\n")
        _serve(client_for(service.url, service.agent))


def _serve(client: ProviderClient) -> None:
    """Speak the protocol until standard input closes."""
    from aerodaas.config.model import EnvironmentConfig  # noqa: PLC0415 - slow to load
    from aerodaas.extensions.agents.caller import Caller  # noqa: PLC0415 - as above
    from aerodaas.extensions.agents.server import AgentServer  # noqa: PLC0415 - as above

    fleet = EnvironmentConfig.model_validate(client.fleet().environment)
    caller = Caller(client, client.address.base)
    AgentServer(lambda _: caller, fleet).run("stdio")


def _shown(page: str) -> bool:
    """Whether a browser shows a page; standard input and output are the protocol's meanwhile.

    Args:
        page: Address of the page.
    """
    kept = os.dup(0), os.dup(1)
    nothing = os.open(os.devnull, os.O_RDONLY)
    try:
        os.dup2(nothing, 0)
        os.dup2(2, 1)
        return webbrowser.open(page)
    finally:
        for number, descriptor in enumerate(kept):
            os.dup2(descriptor, number)
            os.close(descriptor)
        os.close(nothing)
