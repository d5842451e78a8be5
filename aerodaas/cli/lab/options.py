"""Options of the lab's commands, and the workloads that they name."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer

from aerodaas.clock import NANOSECONDS
from aerodaas.errors import ConfigError
from aerodaas.schedulers.lab import Workload, load_workload, read_arrivals
from aerodaas.schedulers.lab.arrival_trace import TRACE

__all__ = [
    "WORKLOAD",
    "Duration",
    "Edges",
    "Jobs",
    "Names",
    "names_of",
    "workload_of",
    "write_csv",
    "writing_into",
]

WORKLOAD = "3D-A"
SCHEDULERS = "ec_edf,dems,gems,margin"
Names = Annotated[
    list[str] | None,
    typer.Option(
        "--scheduler",
        "-s",
        help="Comma-separated, or given several times: registered names (`aerodaas lab list`), "
        "`module:Class` or `file.py:Class`. `dems_published` and the like behave as the published "
        f"code. Default: {SCHEDULERS}.",
    ),
]

Duration = Annotated[
    float | None, typer.Option(help="Simulated seconds; default 300, or the file's.")
]
Edges = Annotated[
    int | None,
    typer.Option(
        help="Simulate so many edges, each with the workload's drones; all cores share them.",
        min=1,
    ),
]
Jobs = Annotated[int | None, typer.Option(help="Processes; default one per core.", min=1)]


def names_of(scheduler: list[str] | None) -> list[str]:
    """Names of `--scheduler`; the default ones where it is not given."""
    return [name.strip() for name in ",".join(scheduler or [SCHEDULERS]).split(",")]


def workload_of(name: str, duration: float | None, edges: int | None) -> Workload:
    """The workload of a name, a JSON file or a trace; raises UnknownIdError, SchedulerError."""
    lasts = None if duration is None else round(duration * NANOSECONDS)
    if name.startswith(TRACE):
        found = read_arrivals(name.removeprefix(TRACE), lasts)
    else:
        found = load_workload(name) if name.endswith(".json") else Workload.named(name)
    if edges is not None:
        found = found.on_edges(edges)
    return found if lasts is None else found.lasting(lasts)


def write_csv(path: Path, rows: Sequence[dict[str, Any]]) -> None:
    """Write at least one row as CSV; the columns are those of the first. Raises OSError."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


@contextmanager
def writing_into(folder: Path) -> Iterator[None]:
    """Raise ConfigError where nothing can be written into a folder."""
    try:
        yield
    except OSError as error:
        raise ConfigError(f"cannot write into {folder}: {error.strerror}") from None
