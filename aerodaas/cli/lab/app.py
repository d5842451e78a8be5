"""`aerodaas lab`: compare analytics schedulers in simulation."""

from __future__ import annotations

import typer

from aerodaas.cli.deferred import deferred_group
from aerodaas.config.extensions import Command, extensions

__all__ = ["app"]

_CORE = (
    Command(
        "run",
        "aerodaas.cli.lab.run:run",
        "Simulate schedulers on the same sample paths and compare them.",
    ),
    Command(
        "sweep",
        "aerodaas.cli.lab.sweep:sweep",
        "Compare schedulers in every combination of some parameters.",
    ),
    Command(
        "list",
        "aerodaas.cli.lab.run:list_all",
        "Show the registered schedulers, the published models and the workloads' names.",
    ),
)


def _commands() -> tuple[Command, ...]:
    return (*_CORE, *(one for extension in extensions().values() for one in extension.lab))


app = typer.Typer(
    cls=deferred_group(_commands),
    # Typer takes an application without a command for a mistake.
    callback=lambda: None,
    no_args_is_help=True,
    rich_markup_mode="markdown",
    help="""Compare analytics schedulers in simulation: thousands of drone-minutes in seconds.

    Try `aerodaas lab run`, then add your own class: `--scheduler dems,mine.py:Mine`.
    """,
)
