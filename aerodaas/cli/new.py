"""`aerodaas new`: begin an application of one's own from a template."""

from __future__ import annotations

import importlib.util
import keyword
from pathlib import Path
from typing import Annotated

import typer

from aerodaas.cli.shipped import TEMPLATES
from aerodaas.errors import ConfigError, UnknownIdError

__all__ = ["new"]

_NAME = "my_app"
"""Name of the application in the templates."""
_TEST = "flight_test.py"
_SCHEMA = "environment.schema.json"


def new(
    name: Annotated[str, typer.Argument(help="Of the application, its file and its folder.")],
    template: Annotated[
        str,
        typer.Option(
            "--template",
            "-t",
            help="`survey`: visit places; `follow`: follow a person; a class of your own: "
            "`detector`, `scheduler`, `camera` or `driver`.",
        ),
    ] = "survey",
) -> None:
    """Begin an application: a folder with its file, an environment, a test, a README.

    It flies at once, in simulation.

        aerodaas new my_app
        cd my_app
        aerodaas run my_app.py
        pip install pytest && pytest
    """
    templates = sorted(path.parent.name for path in TEMPLATES.glob(f"*/{_NAME}.py"))
    if template not in templates:
        raise UnknownIdError("template", template, templates)
    _check(name)
    folder = Path(name)
    files = _files(template, name)
    try:
        folder.mkdir()
        for file, text in files.items():
            (folder / file).write_text(text, encoding="utf-8")
    except FileExistsError:
        raise ConfigError(f"{name} is there already: give another name") from None
    except OSError as error:
        raise ConfigError(f"cannot write {folder}: {error.strerror}") from None
    typer.echo(f"{name}/: {', '.join(files)}")
    typer.echo(f"fly it: cd {name} && aerodaas run {name}.py")


def _check(name: str) -> None:
    """Refuse a name that Python could not import, or that hides what it imports already."""
    if not name.isidentifier() or keyword.iskeyword(name):
        raise ConfigError(f"{name!r} is no name for a Python file: letters, digits, underscores")
    if importlib.util.find_spec(name) is not None:
        raise ConfigError(f"a module is called {name!r} already: give another name")


def _files(template: str, name: str) -> dict[str, str]:
    """Text of each file by its name, the application's first."""
    from aerodaas.config.schema import environment_schema  # noqa: PLC0415 - slow to load

    folder = TEMPLATES / template
    application = folder / f"{_NAME}.py"
    others = [path for path in sorted(folder.iterdir()) if path.is_file() and path != application]
    sources = {
        application.name: application,
        **{path.name: path for path in others},
        f"test_{_NAME}.py": TEMPLATES / _TEST,
    }
    texts = {
        file.replace(_NAME, name): path.read_text(encoding="utf-8").replace(_NAME, name)
        for file, path in sources.items()
    }
    return {**texts, _SCHEMA: environment_schema()}
