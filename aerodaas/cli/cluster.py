"""`aerodaas cluster`: the examination of a cluster, and its token."""

from __future__ import annotations

from typing import Annotated

import typer

from aerodaas.cli.options import ExampleGroup

__all__ = ["app"]

app = typer.Typer(
    cls=ExampleGroup,
    no_args_is_help=True,
    rich_markup_mode="markdown",
    help="""Edge and cloud as one cluster.

    aerodaas cluster check 10.77.0.1:6379
""",
)


@app.command()
def check(
    address: Annotated[
        str, typer.Argument(help="The head's `host:port`.", envvar="RAY_ADDRESS", show_envvar=True)
    ],
) -> None:
    """Say what a cluster offers and what to mend: versions, resources, clocks, links.

    Measures round trip, bandwidth and the clocks' offset from every edge to every other node;
    takes some seconds. Ends with 1 if something needs mending.

        aerodaas cluster check 10.77.0.1:6379
    """
    from aerodaas.actors.cluster.check import check_cluster  # noqa: PLC0415 - loads ray
    from aerodaas.cli.doctor import show_findings  # noqa: PLC0415

    good = show_findings("aerodaas cluster check", check_cluster(address))
    raise typer.Exit(0 if good else 1)


@app.command()
def greet(address: Annotated[str, typer.Argument(help="The head's `host:port`.")]) -> None:
    """Ask a head who it is, without joining: whether it answers, our versions, our token.

    Silent if all is well. For scripts that join, such as `clusters/edge-join.sh`.

        aerodaas cluster greet 10.8.0.1:6379
    """
    from aerodaas.actors.cluster.handshake import greet as ask  # noqa: PLC0415 - loads ray

    ask(address)


@app.command()
def token() -> None:
    """Make the token of this user's clusters, if there is none, and tell its file.

    Copy it to each node and to each machine where applications start, as `~/.ray/auth_token` with
    mode 0600: who has it runs code on all nodes.

        scp -p "$(aerodaas cluster token)" edge:.ray/auth_token
    """
    from aerodaas.actors.cluster.authentication import (  # noqa: PLC0415 - loads ray
        make_token,
        require_authentication,
    )

    require_authentication()
    typer.echo(make_token() or "in RAY_AUTH_TOKEN")
