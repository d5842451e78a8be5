"""Carries out the Containerfile's steps in a folder: `python -m tools.containers ROOT OUT`."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
from pathlib import Path
from typing import Annotated

import typer

from aerodaas.cli.app import run_typer
from aerodaas.errors import AeroDaaSError
from tools.containers.containerfile import Instruction, Stage, expanded, read

app = typer.Typer(add_completion=False, rich_markup_mode="markdown", pretty_exceptions_enable=False)
_ROOT = Path(__file__).resolve().parents[2]
_PATH = "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"


@app.command()
def main(
    base: Annotated[Path, typer.Argument(help="Root of a Debian or Ubuntu, as debootstrap's.")],
    out: Annotated[Path, typer.Argument(help="New folder, in which each stage gets its root.")],
    *,
    argument: Annotated[
        list[str] | None, typer.Option("--build-arg", metavar="NAME=VALUE", help="As docker's.")
    ] = None,
) -> None:
    """Carry out the Containerfile in folders, as root, by chroot.

    For machines on which no container engine runs. It is no container: network and processes
    are the machine's. Of the host it takes `/etc/resolv.conf` and variables of pip and proxies.

        debootstrap --variant=minbase bookworm bookworm/
        python -m tools.containers bookworm/ image/
    """
    if os.geteuid() != 0:
        raise AeroDaaSError("chroot needs root")
    given = dict(text.split("=", 1) for text in argument or ())
    _, stages = read(_ROOT / "Containerfile")
    for number, stage in enumerate(stages):
        _build(stage, base, out, out / (stage.name or str(number)), given)
    typer.echo(out / (stages[-1].name or str(len(stages) - 1)))


def _build(stage: Stage, base: Path, out: Path, root: Path, given: dict[str, str]) -> None:
    out.mkdir(parents=True, exist_ok=True)
    subprocess.run(["cp", "-a", str(base), str(root)], check=True)  # noqa: S603, S607
    shutil.copy("/etc/resolv.conf", root / "etc" / "resolv.conf")
    variables = {"PATH": _PATH, "HOME": "/root"}
    shell = ["/bin/sh", "-c"]
    for instruction in stage.instructions:
        name, words = instruction
        if name == "ARG":
            key, _, default = words.partition("=")
            variables[key] = given.get(key, default)
        elif name == "ENV":
            for pair in shlex.split(words):
                key, _, value = pair.partition("=")
                variables[key] = expanded(value, variables)
        elif name == "SHELL":
            shell = instruction.listed()
        elif name == "COPY":
            _copy(instruction, out, root)
        elif name == "RUN":
            typer.echo(f"RUN {words}")
            _run([*shell, words], root, variables)


def _copy(instruction: Instruction, out: Path, root: Path) -> None:
    words = shlex.split(instruction.words)
    options = dict(word[2:].split("=", 1) for word in words if word.startswith("--"))
    *sources, target = (word for word in words if not word.startswith("--"))
    for source in sources:
        place = root / target.lstrip("/")
        if "from" in options:
            shutil.copytree(out / options["from"] / source.lstrip("/"), place)
        elif source == ".":
            _copy_context(place)
        else:
            shutil.copy(_ROOT / source, place)
            (place / Path(source).name).chmod(int(options.get("chmod", "644"), 8))


def _copy_context(target: Path) -> None:
    """Copy what `.dockerignore` lets through: its lines with a `!` say what that is."""
    target.mkdir()
    for line in (_ROOT / ".dockerignore").read_text(encoding="utf-8").splitlines():
        for source in _ROOT.glob(line[1:]) if line.startswith("!") else ():
            place = target / source.relative_to(_ROOT)
            place.parent.mkdir(parents=True, exist_ok=True)
            if source.is_dir():
                ignored = shutil.ignore_patterns("__pycache__")
                shutil.copytree(source, place, symlinks=True, ignore=ignored)
            else:
                shutil.copy(source, place)


def _run(command: list[str], root: Path, variables: dict[str, str]) -> None:
    outside = {
        name: value
        for name, value in os.environ.items()
        if name.lower().endswith("_proxy") or name.startswith("PIP_")
    }
    done = subprocess.run(  # noqa: S603 - our own file's
        ["chroot", str(root), *command],  # noqa: S607
        env=outside | variables,
        check=False,
    )
    if done.returncode:
        raise AeroDaaSError(f"a step ended with {done.returncode}: {' '.join(command)}")


if __name__ == "__main__":
    run_typer(app, "python -m tools.containers")
