"""Feeds broken input to the project's readers: `python -m tools.fuzz TARGET...`."""

from __future__ import annotations

import json
import signal
import sys
import time
from pathlib import Path
from typing import Annotated, Any

import typer

from aerodaas.cli.app import run_typer
from tools.fuzz.campaign import Result, fuzz, replay
from tools.fuzz.finding import Finding
from tools.fuzz.limits import Limits
from tools.fuzz.target import CORPUS, load_target, target_names

app = typer.Typer(add_completion=False, rich_markup_mode="markdown", pretty_exceptions_enable=False)
_DEFAULT = 10_000


@app.command()
def main(
    targets: Annotated[list[str] | None, typer.Argument(help="`all` for each of them.")] = None,
    *,
    inputs: Annotated[
        int | None, typer.Option(help="Inputs for each target; 10,000 without --seconds.", min=1)
    ] = None,
    seconds: Annotated[float | None, typer.Option(help="Seconds for each target.", min=0.1)] = None,
    seed: Annotated[int, typer.Option(help="The same one makes the same inputs.", min=0)] = 0,
    jobs: Annotated[int, typer.Option(help="Processes at once.", min=1)] = 1,
    limit: Annotated[float, typer.Option(help="Processor's seconds of one input.")] = 5.0,
    memory: Annotated[int, typer.Option(help="MiB of one input.")] = 512,
    replay_: Annotated[
        list[Path] | None, typer.Option("--replay", help="Run this input as it is; repeatable.")
    ] = None,
    list_: Annotated[bool, typer.Option("--list", help="Name the targets.")] = False,
    output: Annotated[
        Path, typer.Option(help="Folder of the findings, one below it for each target.")
    ] = CORPUS,
) -> None:
    """Mutate valid inputs, and tell those that raise, hang, crash or exhaust memory.

    Each finding is written below tests/fuzz/corpus when it is met; tests replay it from there.
    Ends, by Ctrl-C as well, with a JSON summary, and with exit code 1 if anything was found.

        python -m tools.fuzz plan gps_track --inputs 100000
        nice -n 19 python -m tools.fuzz all --seconds 3600 --seed 7 --jobs 2
    """
    names = target_names() if targets == ["all"] else targets or []
    if list_ or not names:
        for name in target_names():
            typer.echo(name)
        return
    for name in names:
        load_target(name)  # a wrong name is told before an hour has passed
    if inputs is None and seconds is None:
        inputs = _DEFAULT
    # A shell has what it starts in the background ignore Ctrl-C: `kill -INT` ends that, too.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    summary = {}
    for name in names:
        limits = Limits(limit, 5 * limit, memory * 2**20)
        findings = _Findings(name, output / name)
        if replay_:
            result = replay(name, [path.read_bytes() for path in replay_], limits, findings.save)
        else:
            result = fuzz(
                name,
                inputs=inputs,
                seconds=seconds,
                seed=seed,
                jobs=jobs,
                limits=limits,
                progress=_Line(),
                found=findings.save,
            )
        summary[name] = _summary(result, findings.told)
        if result.interrupted:
            break
    typer.echo(json.dumps({"seed": seed, "targets": summary}, indent=2))
    raise typer.Exit(any(one["findings"] for one in summary.values()))


class _Line:
    """A line of progress where somebody watches."""

    _PERIOD = 0.5

    def __init__(self) -> None:
        self._shown = 0.0

    def __call__(self, result: Result) -> None:
        """Show it twice a second."""
        now = time.monotonic()
        if sys.stderr.isatty() and now - self._shown > self._PERIOD:
            self._shown = now
            sys.stderr.write(
                f"\r{result.target}: {result.inputs} inputs in {result.seconds:.0f} s, "
                f"{len(result.findings)} findings\x1b[K"
            )
            sys.stderr.flush()


class _Findings:
    """Writes and prints each finding of a target when it is met."""

    def __init__(self, target: str, folder: Path) -> None:
        self.told: list[dict[str, str]] = []
        self._target = target
        self._folder = folder

    def save(self, finding: Finding) -> None:
        """Write it to the target's folder, and its traceback to the terminal."""
        path = finding.save(self._folder)
        if sys.stderr.isatty():
            sys.stderr.write("\r\x1b[K")
        typer.echo(f"{self._target}: {finding.kind}: {path}\n{finding.trace}", err=True)
        self.told.append({"kind": finding.kind, "error": finding.title, "file": str(path)})


def _summary(result: Result, told: list[dict[str, str]]) -> dict[str, Any]:
    """What the summary says of a target."""
    return {
        "inputs": result.inputs,
        "seconds": round(result.seconds, 1),
        "per_second": round(result.inputs / max(result.seconds, 1e-9)),
        "findings": told,
        "hangs": sum(finding.kind == "hang" for finding in result.findings),
        "memory_growth_mib": round(result.growth / 2**20, 1),
    }


if __name__ == "__main__":
    run_typer(app, "python -m tools.fuzz")
