"""An application's file, run as Python itself would."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path

from aerodaas.config.options import RunOptions, current_options
from aerodaas.environment.offering import require_started

__all__ = ["run_file"]


def run_file(application: Path, words: list[str], options: RunOptions) -> None:
    """Run the file as `__main__`, with its folder on the path.

    Args:
        application: Path of the Python file.
        words: Arguments that follow it in `sys.argv`.
        options: Options of the run, current for all that the file starts.

    Raises:
        GraphError: If it starts no environment of its own.
        Exception: The application's own.
    """
    current_options.set(options)
    sys.argv = [str(application), *words]
    sys.path.insert(0, str(application.resolve().parent))
    with require_started():
        runpy.run_path(str(application), run_name="__main__")
