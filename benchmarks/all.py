"""Every benchmark of speed and size, in its short form, beside the figures of the last time.

    python benchmarks/all.py --json benchmarks/results.json
    python benchmarks/all.py --only start --only hop
    python benchmarks/all.py --list

runs one after another, each in a process of its own, and needs a machine with nothing beside it.
One that fails is told at the end, and the others still run.
"""

from __future__ import annotations

import ast
import json as jsons
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from datetime import datetime, timezone
from pathlib import Path
from typing import Annotated, Any

import psutil
import typer
from _comparison import RESULTS, Comparison, Results, committed, figures, read
from _report import machine, revision, wide_enough
from _suite import OTHERS, SPEED, Benchmark
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table
from rich.text import Text

_HERE = Path(__file__).resolve().parent
_PATIENCE = 600.0
"""Seconds after which a benchmark is ended, and has failed."""
_LAST_WORDS = 30.0
"""Seconds that one may take to end what it has started."""
_SETTLE = 2.0
"""Seconds between two benchmarks, in which the processes of the former end."""
_BUSY = 0.5
"""Processes that want to run, above which a machine is not quiet."""


@dataclass(frozen=True)
class Outcome:
    """What became of a benchmark."""

    seconds: float
    reports: list[dict[str, Any]]
    failure: str = ""
    """The last line that it said, if it has failed."""


def run(benchmark: Benchmark, folder: Path) -> Outcome:
    """Run a benchmark in its short form, without the peers that are missing."""
    folder.mkdir()
    said, began = folder / "said.txt", time.monotonic()
    code = _end_of([*benchmark.program(), "--json", str(folder / "figures.json")], said)
    seconds = time.monotonic() - began
    # Some write a second file beside the first.
    files = sorted(folder.glob("*.json"), key=lambda path: len(path.name))
    reports = [jsons.loads(path.read_text(encoding="utf-8")) for path in files]
    failure = ""
    if code is None:
        failure = f"not over after {_PATIENCE:g} s: {last_line(said)}"
    elif code:
        failure = last_line(said) or f"exit status {code}"
    elif not reports:
        failure = "it wrote no figures"
    return Outcome(seconds, reports, failure)


def _end_of(words: list[str], said: Path) -> int | None:
    """Run a Python program to its end; returns its exit status, None if it had to be ended."""
    paths = [str(_HERE.parent), *filter(None, [os.environ.get("PYTHONPATH")])]
    with (
        said.open("w", encoding="utf-8") as out,
        subprocess.Popen(  # noqa: S603 - ours
            [sys.executable, *words],
            stdin=subprocess.DEVNULL,
            stdout=out,
            stderr=subprocess.STDOUT,
            cwd=_HERE.parent,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(paths), "COLUMNS": "200"},
        ) as process,
    ):
        try:
            return process.wait(_PATIENCE)
        except subprocess.TimeoutExpired:
            return None
        finally:
            if process.poll() is None:
                _end(process)


def _end(process: subprocess.Popen[bytes]) -> None:
    """End a benchmark as Ctrl-C does, and then whatever is left of it."""
    family = psutil.Process(process.pid).children(recursive=True)
    process.send_signal(signal.SIGINT)
    try:
        process.wait(_LAST_WORDS)
    except subprocess.TimeoutExpired:
        process.kill()
    for one in family:
        if one.is_running():
            one.kill()


def last_line(said: Path) -> str:
    """The last line with a word in it, without the frame that a message may have around it."""
    lines = said.read_text(encoding="utf-8", errors="replace").splitlines()
    return next((line.strip(" │┃|") for line in reversed(lines) if re.search(r"\w", line)), "")


def run_all(chosen: list[Benchmark]) -> Results:
    """Run these; returns their figures, with all that makes them comparable later."""
    running = [one for one in chosen if not one.lacks]
    load, began = psutil.getloadavg()[0], time.monotonic()
    results: Results = {
        "made": datetime.now(timezone.utc).isoformat(timespec="seconds"),
        "revision": revision(),
        "machine": machine(),
        "load": round(load, 2),
        "versions": {},
        "benchmarks": {},
        "failed": {},
        "left_out": {one.name: _remedies(one) for one in chosen if one.lacks},
        "without": {one.name: _remedies(one) for one in running if one.missing},
    }
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    with (
        tempfile.TemporaryDirectory(prefix="bench-") as name,
        Progress(*columns, TimeElapsedColumn(), transient=True) as progress,
    ):
        task = progress.add_task("", total=len(running))
        for number, one in enumerate(running):
            if number:
                time.sleep(_SETTLE)
            progress.update(task, description=one.name)
            outcome = run(one, Path(name) / one.name)
            _add(results, one, outcome)
            how = "[red]failed[/red]" if one.name in results["failed"] else "done"
            progress.console.print(f"{one.name}: {how}, {outcome.seconds:.0f} s", highlight=False)
            progress.advance(task)
    results["seconds"] = round(time.monotonic() - began)
    return results


def _remedies(benchmark: Benchmark) -> list[str]:
    return [f"{need.what}: {need.remedy}" for need in benchmark.missing]


def _add(results: Results, benchmark: Benchmark, outcome: Outcome) -> None:
    """Add what a benchmark reported, or why it failed."""
    name = benchmark.name
    if outcome.failure:
        results["failed"][name] = outcome.failure
        return
    kept = ("benchmark", "units", "rows", "notes")
    reports = [{key: report[key] for key in kept} for report in outcome.reports]
    found = {
        "command": benchmark.command(),
        "seconds": round(outcome.seconds),
        "reports": reports,
    }
    try:
        figures({"benchmarks": {name: found}})
    except ValueError as error:
        results["failed"][name] = str(error)
        return
    results["benchmarks"][name] = found
    for report in outcome.reports:
        results["versions"] |= report["versions"]


def show_list() -> None:
    """Print which benchmarks there are, their commands, and what this machine lacks of them."""
    table = Table(box=None, padding=(0, 2, 0, 0), show_header=False)
    for one in SPEED:
        lacks = "; ".join(f"without {need.what}: {need.remedy}" for need in one.missing)
        _list(table, one.name, one.command(), f"left out {lacks}" if one.lacks else lacks)
    for name, (command, why) in OTHERS.items():
        _list(table, name, command, f"not run here: {why}")
    wide_enough(table).print(table)


def _list(table: Table, name: str, command: str, remark: str) -> None:
    table.add_row(f"[bold]{name}[/bold]", escape(_about(name)))
    table.add_row("", Text(command, style="cyan"))
    if remark:
        table.add_row("", Text(remark))


def _about(name: str) -> str:
    """The first line of a benchmark's own description."""
    tree = ast.parse((_HERE / f"{name}.py").read_text(encoding="utf-8"))
    return (ast.get_docstring(tree) or "").partition("\n")[0]


def show(results: Results, before: Results | None) -> None:
    """Print the figures beside those of before, and what is not among them."""
    comparison = Comparison(results, before)
    for table in comparison.tables():
        wide_enough(table).print(table)
    console = Console(highlight=False, soft_wrap=True)
    for note in comparison.notes():
        console.print(escape(note))
    if results["load"] > _BUSY:
        told = f"{results['load']:g} processes wanted to run when it began"
        console.print(f"[yellow]not a quiet machine: {told}[/yellow]")
    for how in ("left_out", "without"):
        for name, remedies in results[how].items():
            text = f"{name} was {'left out' if how == 'left_out' else 'run'} without "
            console.print(escape(text + "; ".join(remedies)))
    for name, line in results["failed"].items():
        (command,) = (one.command() for one in SPEED if one.name == name)
        console.print(f"[red]{name} failed:[/red] {escape(line)}")
        console.print(f"  {escape(command)}")


def main(
    only: Annotated[list[str] | None, typer.Option(help="One by name; repeat it.")] = None,
    *,
    list_all: Annotated[bool, typer.Option("--list", help="Tell what there is, and end.")] = False,
    json: Annotated[Path | None, typer.Option(help="Write the figures to this file.")] = None,
    against: Annotated[
        Path | None,
        typer.Option(help=f"Earlier figures; those of {RESULTS.name} in git's HEAD by default."),
    ] = None,
) -> None:
    """Run the benchmarks of speed and size; the exit status is 1 if one fails."""
    if list_all:
        show_list()
        return
    names = [one.name for one in SPEED]
    for name in only or ():
        if name in OTHERS:
            raise typer.BadParameter(f"{name} is run by itself: {OTHERS[name][0]}")
        if name not in names:
            raise typer.BadParameter(f"{name} is none of {', '.join(names)}")
    try:
        before = committed() if against is None else read(against)
    except ValueError as error:
        raise typer.BadParameter(str(error)) from None
    results = run_all([one for one in SPEED if not only or one.name in only])
    show(results, before)
    if json is not None:
        json.parent.mkdir(parents=True, exist_ok=True)
        json.write_text(jsons.dumps(results, indent=1) + "\n", encoding="utf-8")
    if results["failed"]:
        raise typer.Exit(1)


if __name__ == "__main__":
    typer.run(main)
