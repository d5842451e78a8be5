"""Started by benchmarks/tello.py: djitellopy's video reader, in an environment of its own."""

from __future__ import annotations

import importlib.util
import json
import sys
import time
from pathlib import Path

from djitellopy.tello import BackgroundFrameRead

_WARM_UP = 2.0
"""Seconds: FFmpeg looks at the stream first, and then has a queue to work off."""
_STAMP = Path(__file__).resolve().parent.parent / "tools/tello_vehicle/stamp.py"


def main() -> None:
    """Poll the newest frame; print its ages and the CPU taken as JSON."""
    port, seconds, rate = int(sys.argv[1]), float(sys.argv[2]), float(sys.argv[3])
    spec = importlib.util.spec_from_file_location("stamp", _STAMP)
    assert spec is not None  # noqa: S101 - the file lies there
    assert spec.loader is not None  # noqa: S101
    stamp = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(stamp)
    reader = BackgroundFrameRead(None, f"udp://@0.0.0.0:{port}")
    reader.start()
    time.sleep(_WARM_UP)
    began, cpu = time.monotonic(), time.process_time()
    ages: list[float] = []
    unreadable = 0
    while time.monotonic() - began < seconds:
        time.sleep(1.0 / rate)
        age = stamp.read_age(reader.frame, time.time_ns() // 1_000_000)
        if age is None:
            unreadable += 1
        else:
            ages.append(age)
    load = (time.process_time() - cpu) / (time.monotonic() - began)
    print(json.dumps({"ages": ages, "cpu": load, "unreadable": unreadable}), flush=True)


if __name__ == "__main__":
    main()
