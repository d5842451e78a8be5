"""`aerodaas examples`: copy the applications that ship."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Annotated

import typer

from aerodaas.cli.shipped import APPLICATIONS, purpose, shipped_applications
from aerodaas.errors import ConfigError, UnknownIdError

__all__ = ["examples"]

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
