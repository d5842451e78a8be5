"""What the commands at a provider's service share: whom they ask, and how they print."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from pydantic import BaseModel

    from aerodaas.environment.provider.client import ProviderClient

__all__ = ["At", "Json", "client_at", "moment", "print_json", "print_table"]

_WIDE = 1000
"""Columns of a table that goes into a pipe."""
At = Annotated[
    str | None,
    typer.Option(
        "--at",
        metavar="URL",
        envvar="AERODAAS_PROVIDER",
        help="The provider. Default: the only one that you are logged in at.",
    ),
]
Json = Annotated[bool, typer.Option("--json", help="For programs.")]


def client_at(at: str | None) -> ProviderClient:
    """The client of the provider at an address, or of the only one that one is logged in at."""
    from aerodaas.environment.provider.logins import (  # noqa: PLC0415 - slow to load
        client_for,
        default_url,
    )

    return client_for(at or default_url())


def print_json(found: BaseModel | Sequence[BaseModel]) -> None:
    """Print an answer, or a list of them, as JSON."""
    content: Any = (
        [one.model_dump(mode="json") for one in found]
        if isinstance(found, list | tuple)
        else found.model_dump(mode="json")  # type: ignore[union-attr]
    )
    typer.echo(json.dumps(content, indent=2))


def moment(seconds: float) -> str:
    """A moment, seconds of Unix time, as this machine's date and time."""
    from datetime import datetime  # noqa: PLC0415 - only for tables

    return f"{datetime.fromtimestamp(seconds).astimezone():%Y-%m-%d %H:%M:%S}"


def print_table(title: str, heads: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a table of texts, which are another's and are taken for no markup."""
    from rich.console import Console  # noqa: PLC0415 - only for tables
    from rich.table import Table  # noqa: PLC0415
    from rich.text import Text  # noqa: PLC0415

    table = Table(box=None, title=Text(title), title_justify="left", header_style="dim")
    for head in heads:
        table.add_column(head)
    for row in rows:
        table.add_row(*(Text(cell) for cell in row))
    # What reads a pipe has no width to keep to.
    width = None if sys.stdout.isatty() else _WIDE
    Console(highlight=False, width=width).print(table)
