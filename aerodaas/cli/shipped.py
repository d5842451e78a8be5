"""`aerodaas examples` and `new`: what the package brings along, to fly or to begin from."""

from __future__ import annotations

import ast
import difflib
import importlib.util
import keyword
import os
import shutil
from pathlib import Path
from typing import Annotated

import typer

import aerodaas
from aerodaas.errors import ConfigError, UnknownIdError

__all__ = [
    "APPLICATIONS",
    "TEMPLATES",
    "examples",
    "find_application",
    "new",
    "purpose",
    "shipped_applications",
]

_PACKAGE = Path(aerodaas.__file__).parent
APPLICATIONS = _PACKAGE / "apps"
"""Folder of the applications that ship, their environment files in `environments/`."""
TEMPLATES = _PACKAGE / "templates"
"""Folder of the templates, a folder each."""


def shipped_applications() -> dict[str, Path]:
    """The applications that ship, by name."""
    return {path.stem: path for path in sorted(APPLICATIONS.glob("*.py"))}


def find_application(given: Path) -> Path:
    """The application's file: the given one, or the one that ships under this name.

    Raises:
        ConfigError: If there is neither, with the names that are close.
    """
    if given.is_file():
        return given
    shipped = shipped_applications()
    if not given.exists() and given.name == str(given) and given.stem in shipped:
        return shipped[given.stem]
    raise ConfigError(f"there is no application {given}{_remedy(given, list(shipped))}")


def purpose(application: Path) -> str:
    """The first line of an application's docstring, without its name and its full stop."""
    text = ast.get_docstring(ast.parse(application.read_text(encoding="utf-8"))) or ""
    return text.partition("\n")[0].partition(": ")[2].partition(" (paper")[0].rstrip(".")


def _remedy(given: Path, shipped: list[str]) -> str:
    folder = given.parent
    beside = [path.name for path in folder.glob("*.py")] if folder.is_dir() else []
    close = difflib.get_close_matches(given.name, [*beside, *shipped], n=1)
    if close:
        meant = folder / close[0] if close[0] in beside else close[0]
        return f" (did you mean {meant}?)"
    return "; `aerodaas examples` copies those that ship, `aerodaas new` begins one"


_ENVIRONMENTS = "environments"


def examples(
    names: Annotated[
        list[str] | None, typer.Argument(help="Some of them by name. Default: all.")
    ] = None,
    to: Annotated[Path, typer.Option(help="Folder, which is made.")] = Path("examples"),
    only_list: Annotated[  # noqa: FBT002
        bool, typer.Option("--list", help="List them and copy nothing.")
    ] = False,
) -> None:
    """Copy the applications that ship, with their environments, to read and to change.

    They fly without being copied, too, by name.

        aerodaas examples --list
        aerodaas examples farm_survey vehicle_tracking --to surveys
        aerodaas run farm_survey
    """
    shipped = shipped_applications()
    for name in names or ():
        if name not in shipped:
            raise UnknownIdError("example", name, list(shipped))
    chosen = {name: shipped[name] for name in names or shipped}
    if not only_list:
        _copy([*chosen.values(), *(APPLICATIONS / _ENVIRONMENTS).iterdir()], to)
    width = max(map(len, chosen))
    for name, path in chosen.items():
        typer.echo(f"{name:{width}}  {purpose(path)}")
    if not only_list:
        typer.echo(f"copied to {to}; fly one: aerodaas run {to / next(iter(chosen))}.py")


def _copy(files: list[Path], folder: Path) -> None:
    """Copy files of the applications' folder, keeping those that are there and the same."""
    targets = {folder / path.relative_to(APPLICATIONS): path for path in files if path.is_file()}
    changed = [
        target
        for target, path in targets.items()
        if target.exists() and target.read_bytes() != path.read_bytes()
    ]
    if changed:
        raise ConfigError(f"{changed[0]} is there and differs: copy to another folder by --to")
    try:
        for target, path in targets.items():
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, target)
    except OSError as error:
        raise ConfigError(f"cannot copy to {folder}: {error.strerror}") from None


_NAME = "my_app"
"""Name of the application in the templates."""
_TEST = "flight_test.py"
_SCHEMA = "environment.schema.json"


def new(
    name: Annotated[
        str | None, typer.Argument(help="Of the application, its file and its folder.")
    ] = None,
    template: Annotated[
        str,
        typer.Option(
            "--template",
            "-t",
            help="`survey`: visit places; `follow`: follow a person; a class of your own: "
            "`detector`, `scheduler`, `camera`, `driver` or `extension`.",
        ),
    ] = "survey",
    from_document: Annotated[
        Path | None,
        typer.Option(
            "--from-document",
            metavar="FILE",
            help="Write this mission document as a Python application instead.",
        ),
    ] = None,
    env: Annotated[
        Path | None,
        typer.Option(
            help="With --from-document: the environment file that the application names. Default: "
            "the one that the document names."
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", help="With --from-document: the file. Default: FILE with .py."
        ),
    ] = None,
) -> None:
    """Begin an application: a folder with its file, an environment, a test, a README.

    It flies at once, in simulation.

    With `--from-document` it is one file of at most 40 lines, which flies the same mission as the
    document: to read what a program has planned, and to go on in Python.

        aerodaas new my_app
        cd my_app
        aerodaas run my_app.py
        pip install pytest && pytest
        aerodaas new --from-document mission.json -o my_mission.py
    """
    if from_document is not None:
        if name is not None:
            raise ConfigError(f"--from-document writes one file: name it by -o {name}.py")
        _write_application(from_document, env, output or from_document.with_suffix(".py"))
        return
    if name is None:
        raise ConfigError("name the application, as in `aerodaas new my_app`")
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


def _write_application(source: Path, environment: Path | None, output: Path) -> None:
    """Write a mission document as an application; raises ConfigError if its file is there."""
    from aerodaas.dataflow.mission_document import read_mission  # noqa: PLC0415 - slow to load
    from aerodaas.documents.application import application_text  # noqa: PLC0415 - as above
    from aerodaas.environment.document.flying import environment_beside  # noqa: PLC0415 - as above

    document = read_mission(source)
    environment = environment or environment_beside(document, source)
    # An application looks its environment up beside its own file.
    named = environment and os.path.relpath(environment, output.parent)
    text = application_text(document, named and Path(named).as_posix())
    try:
        with output.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise ConfigError(f"{output} is there already: name another file by --output") from None
    except OSError as error:
        raise ConfigError(f"cannot write {output}: {error.strerror}") from None
    lines = text.count("\n")
    typer.echo(f"{output}: {lines} lines; fly it: aerodaas run {output}")


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
