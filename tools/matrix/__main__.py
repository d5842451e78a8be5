"""Tests the wheel on each Python that is found: `python -m tools.matrix`."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Annotated

import typer
from hatchling.builders.wheel import WheelBuilder

from aerodaas.cli.app import run_typer
from tools.matrix.interpreters import MINORS, interpreter

app = typer.Typer(add_completion=False, rich_markup_mode="markdown", pretty_exceptions_enable=False)
_ROOT = Path(__file__).resolve().parents[2]
_IN_THE_WHEEL = ("aerodaas", "actors", "schedulers")
_TESTS = (
    *("analytics", "cameras", "config", "dataflow", "drivers", "following", "fuzz", "mission"),
    *("recording", "schedulers", "simulation", "types"),
)
_FAST = "not slow and not wall_clock and not sitl"


@app.command()
def main(
    tests: Annotated[
        list[str] | None, typer.Argument(help="Folders or files below tests/.")
    ] = None,
    *,
    python: Annotated[
        list[int] | None, typer.Option(help="A minor version of Python 3; all that are supported.")
    ] = None,
) -> None:
    """Build the wheel, install it for each Python with its newest requirements, and test it.

    Runs the fast tests, without Ray and without this checkout's packages on the path. Ends with
    one line for each Python, and with exit code 1 if one failed or none was found.

        python -m tools.matrix --python 10 --python 13 mission types
    """
    lines, passed = [], []
    with tempfile.TemporaryDirectory(prefix="aerodaas-matrix-") as name:
        folder = Path(name)
        (wheel,) = WheelBuilder(str(_ROOT)).build(directory=name, versions=["standard"])
        _copy_tests(folder / "checkout")
        for minor in python or MINORS:
            found = interpreter(minor)
            if found is None:
                lines.append(f"3.{minor}: no such Python here")
                continue
            begun = time.monotonic()
            summary, good = _tested(found, wheel, folder, tests or list(_TESTS))
            passed.append(good)
            lines.append(f"3.{minor}: {summary}, {time.monotonic() - begun:.0f} s ({found})")
    typer.echo("\n".join(lines))
    raise typer.Exit(not passed or not all(passed))


def _copy_tests(folder: Path) -> None:
    """All that git knows of, but for what is in the wheel."""
    listed = _run(["git", "ls-files", "-z"], _ROOT).stdout.split("\0")
    for name in filter(None, listed):
        if name.partition("/")[0] not in _IN_THE_WHEEL and (_ROOT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(_ROOT / name, folder / name)


def _tested(python: str, wheel: str, folder: Path, tests: list[str]) -> tuple[str, bool]:
    """Pytest's last line, or what failed before; whether all is well."""
    place = folder / "environment"
    shutil.rmtree(place, ignore_errors=True)
    here = str(place / "bin" / "python")
    for step in (
        ["uv", "venv", "--quiet", "--python", python, str(place)],
        ["uv", "pip", "install", "--quiet", "--python", here, f"aerodaas[dev] @ file://{wheel}"],
        [here, "-c", "import aerodaas, sys; sys.exit('site-packages' not in aerodaas.__file__)"],
    ):
        done = _run(step, folder)
        if done.returncode:
            sys.stderr.write(done.stdout + done.stderr)
            return f"{' '.join(step[:3])} failed", False
    plugin = ["-p", "tools.matrix.without_ray", "-m", _FAST, "-o", "pythonpath=."]
    places = [f"tests/{one}" for one in tests]
    done = _run([here, "-m", "pytest", *plugin, *places], folder / "checkout")
    if done.returncode:
        sys.stderr.write(done.stdout + done.stderr)
    last = re.findall(r"^.*(?:passed|failed|error).*$", done.stdout, re.MULTILINE)
    return last[-1] if last else f"pytest ended with {done.returncode}", done.returncode == 0


def _run(command: list[str], folder: Path) -> subprocess.CompletedProcess[str]:
    bins = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    environment = {**os.environ, "PATH": bins}
    environment.pop("PYTHONPATH", None)
    return subprocess.run(  # noqa: S603 - our own commands
        command, cwd=folder, env=environment, capture_output=True, text=True, check=False
    )


if __name__ == "__main__":
    run_typer(app, "python -m tools.matrix")
