"""An application's file, run as Python itself would."""

from __future__ import annotations

import runpy
import sys
import traceback
from pathlib import Path
from typing import Any

from aerodaas.config.options import RunOptions, current_options
from aerodaas.environment.offering import BuildEndedError, require_started

__all__ = ["run_file"]


def run_file(application: Path, words: list[str], options: RunOptions) -> dict[str, Any]:
    """Run the file as `__main__`, with the arguments `words` and its folder on the path.

    Returns its variables, as they are where it ends; of one that is only built, see `offered`.

    Raises the application's own exceptions, and GraphError if it starts no environment of its own.
    """
    current_options.set(options)
    sys.argv = [str(application), *words]
    sys.path.insert(0, str(application.resolve().parent))
    try:
        with require_started():
            return runpy.run_path(str(application), run_name="__main__")
    except BuildEndedError as end:
        frames = (frame for frame, _ in traceback.walk_tb(end.__traceback__))
        return next(one.f_globals for one in frames if one.f_code.co_filename == str(application))
