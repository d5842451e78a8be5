"""`aerodaas compile` and `schema`: an application as data or drawn, and JSON schema."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from aerodaas.cli.flying.application import build_application
from aerodaas.cli.options import OtherEnvironment
from aerodaas.cli.shipped import find_application
from aerodaas.config.options import RunOptions
from aerodaas.errors import ConfigError

__all__ = ["compile_document", "schema"]


def compile_document(
    context: typer.Context,
    application: Annotated[
        Path, typer.Argument(help="The application: a Python file; or a recording.")
    ],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="The file; default: printed.")
    ] = None,
    env: OtherEnvironment = None,
    graph: Annotated[  # noqa: FBT002
        bool, typer.Option("--graph", help="Draw the graph as a Mermaid flowchart instead.")
    ] = False,
) -> None:
    """Write an application as a mission document that others fly without its code, or draw it.

    The file runs up to `start_mission()`. Words after `--` are the application's own. Of a
    recording, it is the document that was flown. Sites that show Markdown draw a flowchart, such as
    GitHub's; so does https://mermaid.live.

        aerodaas compile my_app.py -o my_app.json
        aerodaas run my_app.json
        aerodaas compile flight.mcap | diff my_app.json -
        aerodaas compile my_app.py --graph -o graph.mmd
    """
    from aerodaas.environment.document.flying import (  # noqa: PLC0415
        compile_application,
        recorded_document,
    )

    if graph:
        _put(_drawing(application, context.args, env), output)
        return
    if application.suffix == ".mcap":
        document = recorded_document(application)
    else:
        document = compile_application(find_application(application), context.args, env)
    _put(document.text(), output)


def _drawing(application: Path, words: list[str], env: Path | None) -> str:
    """Flowchart of the application's graph."""
    from aerodaas.dataflow.drawing import mermaid  # noqa: PLC0415 - slow to load

    application = find_application(application)
    options = RunOptions(application=application.resolve(), environment=env, view=False)
    return mermaid(build_application(application, words, options).graph)


def schema(
    document: Annotated[  # noqa: FBT002
        bool, typer.Option("--document", help="Of mission documents instead.")
    ] = False,
) -> None:
    """Print the JSON schema of environment files, or of mission documents.

    An editor completes a file by it. That of mission documents describes the arguments of each
    analysis and scheduler that is installed here, so that a program can write a document by it.

        aerodaas schema > environment.schema.json
        aerodaas schema --document > mission.schema.json
    """
    if document:
        from aerodaas.documents.schema import document_schema  # noqa: PLC0415 - slow to load

        typer.echo(json.dumps(document_schema(), indent=2))
        return
    from aerodaas.config.schema import environment_schema  # noqa: PLC0415 - as above

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
