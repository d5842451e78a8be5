"""What every benchmark shares: a table for people, and the same figures as JSON."""

from __future__ import annotations

import importlib.metadata
import json
import math
import os
import platform
import subprocess
import sys
from collections.abc import Mapping, Sequence
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

import psutil
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.measure import Measurement
from rich.table import Table

from aerodaas.recording.provenance import processor_name

__all__ = ["Report", "machine", "machine_line", "plain", "revision", "shown", "wide_enough"]

_WIDEST = 400
_ROOT = Path(__file__).resolve().parent.parent


class Report:
    """Figures by case, each with its unit.

    ``report = Report("vision", {"inference": "ms"}, packages=["onnxruntime"])``, then
    ``report.row("yolo11n", {"inference": 19.3})``, ``report.show()``, ``report.write(path)``.
    """

    def __init__(
        self, name: str, units: Mapping[str, str], *, packages: Sequence[str] = ()
    ) -> None:
        """Name the benchmark, its figures with their units, and the `packages` it rests on."""
        self.name = name
        self.units = dict(units)
        self.packages = ("numpy", *packages)
        self.rows: list[tuple[str, dict[str, float]]] = []
        self.notes: list[str] = []

    def row(self, case: str, figures: Mapping[str, float]) -> None:
        """Add the figures of one case, NaN for none; raises KeyError for one without a unit."""
        self.rows.append((case, {figure: figures[figure] for figure in self.units}))

    def note(self, text: str) -> None:
        """Add a sentence that belongs below the table."""
        self.notes.append(text)

    def show(self) -> None:
        """Print the table."""
        table = Table(
            title=self.name,
            caption=machine_line(),
            caption_justify="left",
            box=SIMPLE_HEAD,
            padding=(0, 1),
            pad_edge=False,
        )
        table.add_column("case", no_wrap=True)
        for figure, unit in self.units.items():
            table.add_column(f"{figure}\n{unit}", justify="right", no_wrap=True)
        for case, figures in self.rows:
            table.add_row(case, *map(shown, figures.values()))
        console = wide_enough(table)
        console.print(table)
        for text in self.notes:
            console.print(text)

    def write(self, path: Path) -> None:
        """Write the figures as JSON, with the machine, the versions and the revision."""
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(self.as_json(), indent=2) + "\n", encoding="utf-8")

    def as_json(self) -> dict[str, Any]:
        """Everything that makes the figures comparable later."""
        return {
            "benchmark": self.name,
            "made": datetime.now(timezone.utc).isoformat(timespec="seconds"),
            "revision": revision(),
            "machine": machine(),
            "versions": {name: importlib.metadata.version(name) for name in self.packages}
            | {"python": platform.python_version()},
            "command": sys.argv,
            "units": self.units,
            "rows": [
                {"case": case} | {name: plain(value) for name, value in figures.items()}
                for case, figures in self.rows
            ],
            "notes": self.notes,
        }


def wide_enough(table: Table) -> Console:
    """A console that cuts no figure of `table` short, which is worth nothing: it wraps instead."""
    console, wide = Console(), Console(width=_WIDEST)
    console.width = max(console.width, Measurement.get(wide, wide.options, table).maximum)
    return console


def shown(value: float) -> str:
    """The value by three digits, or a dash for NaN."""
    return "-" if math.isnan(value) else f"{value:.3g}"


def plain(value: float) -> float | None:
    """The value, or None for NaN, for which JSON has no word."""
    return None if math.isnan(value) else value


def machine() -> dict[str, Any]:
    """What of this machine the figures go by."""
    return {
        "cpu": processor_name(),
        "cores": len(os.sched_getaffinity(0)),
        "memory_gib": round(psutil.virtual_memory().total / 2**30, 1),
        "system": platform.platform(),
    }


def machine_line(of: Mapping[str, Any] | None = None) -> str:
    """This machine, or another one as `machine` gives it, in a line."""
    known = of or machine()
    return f"{known['cpu']}, {known['cores']} cores, {known['memory_gib']} GiB"


def revision() -> str:
    """The git revision, with a mark if the tree differs from it; "unknown" outside git."""
    command = ["git", "describe", "--always", "--dirty", "--abbrev=40", "--exclude=*"]
    try:
        done = subprocess.run(command, cwd=_ROOT, capture_output=True, text=True, check=True)  # noqa: S603 - constant
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return done.stdout.strip()
