"""The work of `aerodaas run --seeds`: runs, progress, table and files."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path

import typer

from aerodaas.cli.flying.seeds.figures import rows, show
from aerodaas.cli.flying.seeds.runs import ApplicationRun, SeededRun, fly_seeds
from aerodaas.cli.lab.options import write_csv
from aerodaas.config.options import RunOptions
from aerodaas.environment.recording_paths import recording_folder
from aerodaas.errors import ConfigError, MissionError
from aerodaas.terminal.progress import show_progress

__all__ = ["run_seeds"]


def run_seeds(
    run: ApplicationRun,
    seeds: int,
    *,
    jobs: int | None,
    json_path: Path | None,
    csv_path: Path | None,
) -> None:
    """Fly an application with several seeds; print a table and write files.

    Args:
        run: The application; the seed of its options, or 0, is the first.
        seeds: Number of seeds, 1 or more.
        jobs: Most runs at a time; None for one per core.
        json_path: File for the table as JSON; None for none.
        csv_path: The same as CSV.

    Raises:
        ConfigError: For options that many runs cannot have.
        MissionError: If a run failed.
    """
    first = run.options.seed or 0
    run = replace(run, options=_shared_options(run))
    name = run.application.stem
    done: list[SeededRun] = []
    try:
        with show_progress() as progress:
            bar = progress.add_task(name, total=seeds)

            def on_end(ended: SeededRun) -> None:
                done.append(ended)
                progress.update(bar, completed=len(done))
                if ended.failure:
                    said = f"seed {ended.seed} failed: {ended.failure}"
                    progress.console.print(said, highlight=False, markup=False, soft_wrap=True)

            fly_seeds(run, range(first, first + seeds), jobs or os.cpu_count() or 1, on_end)
    finally:
        # Also after Ctrl-C, of those that have ended.
        if done:
            done.sort(key=lambda ended: ended.seed)
            _print_runs(done, f"{name}: {len(done)} of {seeds} seeds", json_path, csv_path)
            typer.echo(f"in {run.options.record}")
    failed = [str(ended.seed) for ended in done if ended.failure]
    if failed:
        raise MissionError(f"{len(failed)} of {seeds} runs failed: seeds {', '.join(failed)}")


def _shared_options(run: ApplicationRun) -> RunOptions:
    options = run.options
    if options.simulated_time is False:
        raise ConfigError("--seeds flies as fast as the machine goes: leave --speed out")
    shown = {"--live": options.live, "--console": options.console, "--show": options.show or None}
    for name, given in shown.items():
        if given is not None:
            raise ConfigError(f"{name} shows one flight, and --seeds flies several: leave it out")
    if options.record is not None and options.record.suffix == ".mcap":
        raise ConfigError("with --seeds, --record names a folder: each run gets one below it")
    record = options.record or recording_folder(run.application.stem)
    return replace(
        options,
        simulated_time=True,
        record=record.absolute(),
        view=False,
        remote=False,  # they would all listen at one port
        report="figures",
    )


def _print_runs(
    runs: list[SeededRun], title: str, json_path: Path | None, csv_path: Path | None
) -> None:
    show(runs, title)
    found = rows(runs)
    try:
        if json_path is not None:
            json_path.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
        if csv_path is not None:
            write_csv(csv_path, found)
    except OSError as error:
        raise ConfigError(f"cannot write {error.filename}: {error.strerror}") from None
