"""What all benchmarks share: a table for people, JSON for programs, and where it was measured."""

from __future__ import annotations

import json
import os
import platform
import subprocess
from dataclasses import dataclass, field
from datetime import datetime, timezone
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import psutil
from rich.console import Console
from rich.table import Table

__all__ = ["Figure", "Report"]


@dataclass(frozen=True)
class Figure:
    """One measured number with its unit."""

    value: float
    unit: str

    def __str__(self) -> str:
        decimals = 0 if abs(self.value) >= 100 else 2  # noqa: PLR2004 - three digits are enough
        return f"{self.value:.{decimals}f} {self.unit}"


@dataclass
class Report:
    """The figures of one benchmark: rows of named figures."""

    title: str
    packages: tuple[str, ...] = ()
    """Packages whose versions matter for the figures."""
    rows: list[tuple[str, dict[str, Figure]]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def row(self, name: str, **figures: Figure) -> None:
        """Add a row; the figures' names are the table's columns."""
        self.rows.append((name, figures))

    def show(self) -> None:
        """Print the table and the notes."""
        columns = list(dict.fromkeys(key for _, figures in self.rows for key in figures))
        table = Table(title=self.title, title_justify="left")
        table.add_column("")
        for column in columns:
            table.add_column(column.replace("_", " "), justify="right")
        for name, figures in self.rows:
            table.add_row(name, *(str(figures.get(column, "")) for column in columns))
        console = Console()
        console.print(table)
        for note in self.notes:
            console.print(note)

    def write(self, path: Path | None) -> None:
        """Write the same figures as JSON, with units, machine, versions and revision."""
        if path is None:
            return
        rows = [
            {"name": name, **{key: [one.value, one.unit] for key, one in figures.items()}}
            for name, figures in self.rows
        ]
        content = {"title": self.title, "rows": rows, "notes": self.notes, **_provenance(self)}
        path.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")


def _provenance(report: Report) -> dict[str, Any]:
    versions = {"python": platform.python_version()}
    for package in ("aerodaas", "ray", "numpy", *report.packages):
        try:
            versions[package] = version(package)
        except PackageNotFoundError:
            versions[package] = "not installed"
    machine = {
        "processor": platform.machine(),
        "cores": os.cpu_count(),
        "memory_gib": round(psutil.virtual_memory().total / 2**30, 1),
        "system": f"{platform.system()} {platform.release()}",
    }
    command = ["git", "describe", "--always", "--dirty"]
    described = subprocess.run(  # noqa: S603 - a fixed command
        command, capture_output=True, text=True, check=False, cwd=Path(__file__).parent
    )
    return {
        "machine": machine,
        "versions": versions,
        "revision": described.stdout.strip(),
        "measured": datetime.now(timezone.utc).isoformat(timespec="seconds"),
    }
