"""Let time go slower or faster for Python: `python _pace.py PACE SCRIPT ARGUMENTS`.

What flies in real time goes by the clocks of Python's `time`. On a machine too busy for networks
in real time all programs of a flight run at a fraction of it; one without a camera runs faster.
"""

from __future__ import annotations

import runpy
import sys
import time
from collections.abc import Callable
from pathlib import Path

__all__ = ["set_pace"]


def set_pace(pace: float) -> None:
    """Let the clocks of this process run, and its sleeps end, `pace` times as fast from now on."""
    sleep = time.sleep
    time.monotonic = _paced(time.monotonic, pace)
    time.time = _paced(time.time, pace)
    time.sleep = lambda seconds: sleep(float(seconds) / pace)


def _paced(clock: Callable[[], float], pace: float) -> Callable[[], float]:
    began = clock()
    return lambda: began + (clock() - began) * pace


if __name__ == "__main__":
    set_pace(float(sys.argv[1]))
    sys.argv = sys.argv[2:]
    sys.path[0] = str(Path(sys.argv[0]).resolve().parent)
    runpy.run_path(sys.argv[0], run_name="__main__")
