"""Lists licences: `python -m tools.licences`."""

from __future__ import annotations

from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from aerodaas.cli.app import run_typer
from tools.licences.reading import installed_licences

app = typer.Typer(add_completion=False, rich_markup_mode="markdown", pretty_exceptions_enable=False)


@app.command()
def main(
    *,
    everything: Annotated[
        bool, typer.Option("--all", help="What only development needs, too.")
    ] = False,
) -> None:
    """List what an installation with all extras brings here, under which licences.

    Ends with exit code 1 if one is neither accepted nor explained (tools/licences/policy.py).
    """
    table = Table("distribution", "version", "licence", "for", box=None)
    licences = [one for one in installed_licences() if one.runtime or everything]
    for one in licences:
        use = "flying" if one.runtime else "development"
        table.add_row(one.name, one.version, " + ".join([one.expression, *one.carried]), use)
    console = Console(soft_wrap=True)
    console.print(table)
    for one in licences:
        for reason in one.reasons:
            console.print(f"\n{one.name}: {reason}.")
    objected = [one for one in licences if one.runtime and one.objections]
    for one in objected:
        console.print(
            f"\n{one.name}: {', '.join(one.objections)} is neither accepted nor explained"
        )
    raise typer.Exit(bool(objected))


if __name__ == "__main__":
    run_typer(app, "python -m tools.licences")
