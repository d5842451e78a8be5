"""An application's file, run as Python itself would."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path
from typing import Any

from aerodaas.config.options import RunOptions, current_options

__all__ = ["run_file"]


def run_file(application: Path, words: list[str], options: RunOptions) -> dict[str, Any]:
    """Run the file as `__main__`, with the arguments `words` and its folder on the path.

    Returns its variables.

    Raises the application's own exceptions.
    """
    current_options.set(options)
    sys.argv = [str(application), *words]
    sys.path.insert(0, str(application.resolve().parent))
    return runpy.run_path(str(application), run_name="__main__")
