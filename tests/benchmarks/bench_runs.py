"""Runs a benchmark as a user does."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

__all__ = ["run_benchmark"]

_ROOT = Path(__file__).parents[2]


def run_benchmark(name: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """`python benchmarks/NAME.py ARGUMENTS`, from the root of the project, with a wide terminal."""
    return subprocess.run(
        [sys.executable, f"benchmarks/{name}.py", *arguments],
        cwd=_ROOT,
        env={"PYTHONPATH": str(_ROOT), "PATH": "/usr/bin:/bin", "COLUMNS": "160"},
        capture_output=True,
        text=True,
        check=False,
    )
