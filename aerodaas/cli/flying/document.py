"""`aerodaas compile`, `graph` and `schema`: an application as data or drawn, and JSON schema."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from aerodaas.cli.flying.application import build_application
from aerodaas.cli.options import OtherEnvironment
from aerodaas.cli.shipped import find_application
from aerodaas.config.options import RunOptions
from aerodaas.errors import ConfigError

__all__ = ["compile_document", "graph", "schema"]


def compile_document(
    context: typer.Context,
    application: Annotated[
        Path, typer.Argument(help="The application: a Python file; or a recording.")
    ],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="The document's file; default: printed.")
    ] = None,
    env: OtherEnvironment = None,
) -> None:
    """Write an application as a mission document: data, which others fly without running code.

    The file runs up to `start_mission()`. Words after `--` are the application's own. Of a
    recording, it is the document that was flown.

        aerodaas compile my_app.py -o my_app.json
        aerodaas run my_app.json
        aerodaas compile flight.mcap | diff my_app.json -
    """
    from aerodaas.environment.document.flying import (  # noqa: PLC0415
        compile_application,
        recorded_document,
    )

    if application.suffix == ".mcap":
        document = recorded_document(application)
    else:
        document = compile_application(find_application(application), context.args, env)
    _put(document.text(), output)


def graph(
    context: typer.Context,
    application: Annotated[Path, typer.Argument(help="The application, as for `aerodaas run`.")],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="A file; default: printed.")
    ] = None,
    env: OtherEnvironment = None,
) -> None:
    """Draw an application's graph as a Mermaid flowchart; nothing flies.

    Sites that show Markdown draw it, such as GitHub's; so does https://mermaid.live.

        aerodaas graph farm_survey
        aerodaas graph my_app.py -o graph.mmd
    """
    from aerodaas.dataflow.drawing import mermaid  # noqa: PLC0415 - slow to load

    application = find_application(application)
    options = RunOptions(application=application.resolve(), environment=env, view=False)
    _put(mermaid(build_application(application, context.args, options).graph), output)


def schema() -> None:
    """Print the JSON schema of environment files.

    aerodaas schema > environment.schema.json
    """
    from aerodaas.config.schema import environment_schema  # noqa: PLC0415 - slow to load

    typer.echo(environment_schema(), nl=False)


def _put(text: str, output: Path | None) -> None:
    """Print a text, or write it into a file; raises ConfigError if that cannot be."""
    if output is None:
        typer.echo(text, nl=False)
        return
    try:
        output.write_text(text, encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"cannot write {output}: {error.strerror}") from None
