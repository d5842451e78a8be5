"""`aerodaas lab sweep`: cases, tables, files and plots."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

from aerodaas.cli.lab.options import (
    WORKLOAD,
    Duration,
    Edges,
    Jobs,
    Names,
    names_of,
    workload_of,
    write_csv,
    writing_into,
)
from aerodaas.config.extras import has_extra
from aerodaas.errors import ConfigError, UnknownIdError
from aerodaas.schedulers.lab.metrics import seeds_needed
from aerodaas.schedulers.lab.sweep import PARAMETERS, SweepResult, run_sweep
from aerodaas.terminal.figures import Row, show_figures
from aerodaas.terminal.progress import show_progress

__all__ = ["parse_sweeps", "sweep"]

_FIGURES = ("qos per s", "completion")
_BETWEEN = re.compile(r",(?=\s*[A-Za-z])")
"""Commas between words; those within one stand before a number, as in `outage:30-45,80-81`."""
_WORDS = {"network", "times"}
_CSV, _SUMMARY, _PARQUET = "runs.csv", "summary.csv", "runs.parquet"


def sweep(
    *,
    sweeps: Annotated[
        list[str],
        typer.Option(
            "--sweep",
            help="`drones=10,20,40`; given several times, all combinations. Of `drones`, `edges`, "
            "`models` (A: six, P: four), `network`, `times`, `cloud_slots`, `duration`, and "
            "`scheduler.KEYWORD`, which goes to the constructors that have it.",
        ),
    ],
    scheduler: Names = None,
    baseline: Annotated[
        str | None,
        typer.Option(help="What the others are compared with. Default: the first scheduler."),
    ] = None,
    seeds: Annotated[int, typer.Option(help="Number of seeds, 0 to N-1.", min=1)] = 20,
    figure: Annotated[
        list[str] | None,
        typer.Option(
            "--figure",
            "-f",
            help="What is printed and plotted, may be given several times: `qos per s`, "
            "`completion`, `qoe per s`, … Default: the first two. The files have all.",
        ),
    ] = None,
    workload: Annotated[
        str, typer.Option("--workload", "-w", help="What is not swept, as for `run`.")
    ] = WORKLOAD,
    network: Annotated[str, typer.Option(help="As for `run`, where it is not swept.")] = "steady",
    times: Annotated[str, typer.Option(help="As for `run`, where they are not swept.")] = "nominal",
    duration: Duration = None,
    edges: Edges = None,
    cloud_slots: Annotated[
        int | None, typer.Option(help="Executions in the cloud at once; default 32.", min=0)
    ] = None,
    bound: Annotated[
        bool, typer.Option("--bound", help="Compute the clairvoyant bound, too; it takes longer.")
    ] = False,
    jobs: Jobs = None,
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for tables and plots.")] = Path(
        "sweep"
    ),
) -> None:
    """Compare schedulers in every combination of some parameters.

    All see the same sample paths, so they are compared seed by seed: differences from the baseline
    have 95 % intervals (Student's t) and the p of a paired permutation test, corrected by Holm;
    `*` is significant. The folder gets every run as a row of `runs.csv` (`runs.parquet` where
    pyarrow is), the comparisons, and plots for a paper.

        aerodaas lab sweep --sweep drones=2,4,8 -s dems,margin,mine.py:Mine
        aerodaas lab sweep --sweep network=steady,trapezium --sweep cloud_slots=4,16 -s dems,gems
        aerodaas lab sweep --sweep scheduler.slack=10,50,100 -s mine.py:Mine,dems --baseline dems
    """
    figures = figure or list(_FIGURES)
    with show_progress() as progress:
        bar = progress.add_task("edges", total=None)
        result = run_sweep(
            names_of(scheduler),
            parse_sweeps(sweeps),
            workload=workload_of(workload, duration, edges),
            seeds=range(seeds),
            baseline=baseline,
            network=network,
            times=times,
            cloud_slots=cloud_slots,
            bound=bound,
            jobs=jobs,
            progress=lambda done, total: progress.update(bar, completed=done, total=total),
        )
    for name in figures:
        _show(result, name)
    _advise(result)
    files = _write(result, out)
    if has_extra("plots"):
        files += _plot(result, figures, out)
    else:
        typer.echo("plots: pip install 'aerodaas[plots]'")
    typer.echo(f"in {out}: {', '.join(files)}")


def parse_sweeps(texts: Sequence[str]) -> dict[str, list[Any]]:
    """Read `drones=10,20,40` and the like; the same parameter several times adds values.

    Raises ConfigError for what cannot be read, UnknownIdError for a parameter that there is not.
    """
    found: dict[str, list[Any]] = {}
    for text in texts:
        name, equals, values = text.partition("=")
        name = name.strip()
        if not equals or not values:
            raise ConfigError(f"a sweep is written drones=10,20,40, not {text!r}")
        known = name in PARAMETERS or name.startswith("scheduler.")
        if not known:
            raise UnknownIdError("parameter", name, [*PARAMETERS, "scheduler.KEYWORD"])
        split = _BETWEEN.split(values) if name in _WORDS else values.split(",")
        found.setdefault(name, []).extend(_value(name, one.strip()) for one in split)
    return found


def _value(name: str, text: str) -> object:
    kind = PARAMETERS.get(name)
    if kind is None:
        return _plain(text)
    try:
        return kind(text)
    except ValueError:
        what = {int: "whole numbers", float: "numbers"}[kind]
        raise ConfigError(f"{name} takes {what}, not {text!r}") from None


def _plain(text: str) -> object:
    """A constructor's argument: a number where it reads as one."""
    if re.fullmatch(r"[+-]?\d+", text):
        return int(text)
    try:
        return float(text)
    except ValueError:
        return text


def _show(result: SweepResult, figure: str) -> None:
    """Print a figure's means, and how they differ from the baseline's."""
    rows = []
    for row in result.summary(figure):
        case = " ".join(f"{name}={row[name]}" for name in result.parameters)
        cells = [_with_margin(row["mean"], row["high"])]
        if row["difference"] is None:
            cells += ["", ""]
        else:
            cells += [_with_margin(row["difference"], row["difference_high"])]
            cells.append(_p(row["p_holm"]) + (" *" if row["significant"] else "  "))
        name = f"{case}  {row['scheduler']}"
        rows.append(Row(name, cells, bold=bool(row["significant"])))
    title = f"{figure}: means over {len(result.seeds)} seeds with 95 % intervals"
    columns = (figure, f"less {result.baseline}", "p (Holm)")
    show_figures(title, "case", columns, rows)


def _with_margin(value: float, high: float) -> str:
    margin = high - value
    return f"{value:.4g}" + ("" if math.isnan(margin) else f" ±{margin:.2g}")


def _p(p: float) -> str:
    return "" if math.isnan(p) else f"{p:.4f}" if p >= 0.0001 else "<0.0001"  # noqa: PLR2004 - four digits


def _advise(result: SweepResult) -> None:
    """Say so where there are too few seeds for anything to be significant."""
    comparisons = len(result.cases) * (len(result.schedulers) - 1)
    needed = seeds_needed(comparisons)
    if comparisons and len(result.seeds) < needed:
        text = (
            f"with {len(result.seeds)} seeds none of {comparisons} comparisons can be significant: "
            f"take --seeds {needed} or more"
        )
        Console().print(text, highlight=False, soft_wrap=True)


def _write(result: SweepResult, out: Path) -> list[str]:
    """Write the tidy table, and the summary of each figure; returns the files' names."""
    with writing_into(out):
        out.mkdir(parents=True, exist_ok=True)
        write_csv(out / _CSV, result.rows)
        write_csv(out / _SUMMARY, [row for name in result.figures for row in result.summary(name)])
    try:
        import pyarrow as pa  # noqa: PLC0415 - an extra
        from pyarrow import parquet  # noqa: PLC0415
    except ImportError:
        return [_CSV, _SUMMARY]
    parquet.write_table(pa.Table.from_pylist(result.rows), out / _PARQUET)
    return [_CSV, _PARQUET, _SUMMARY]


def _plot(result: SweepResult, figures: Sequence[str], out: Path) -> list[str]:
    from aerodaas.schedulers.lab.plots import plot_sweep  # noqa: PLC0415 - loads matplotlib

    files = []
    for figure in figures:
        for suffix in ("pdf", "png"):
            name = f"{figure.replace(' ', '_')}.{suffix}"
            plot_sweep(result, figure, out / name)
            files.append(name)
    return files
