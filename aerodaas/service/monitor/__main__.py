"""`python -m aerodaas.service.monitor FLEET`: watch a fleet's vehicles for the service.

Lines of its standard input say which vehicles to hold (`MonitorRequest`), those of its standard
output how they are (`MonitorReport`). It ends with its input: when the service ends, however that
ends.
"""

from __future__ import annotations

import os
import sys
import threading
import time
from pathlib import Path
from typing import TextIO

from aerodaas.config.model import EnvironmentConfig
from aerodaas.config.overrides import located
from aerodaas.service.monitor.reports import MonitorReport, MonitorRequest
from aerodaas.service.monitor.watcher import VehicleWatcher

__all__ = ["main"]

_TELL_SECONDS = 1.0
"""Between two news without a change of a link."""
_LEAST_SECONDS = 0.1
"""Between two news."""


def main() -> None:
    """Watch until the standard input ends."""
    fleet = Path(sys.argv[1])
    config = located(EnvironmentConfig.load(fleet), fleet.parent)
    changed = threading.Event()
    watchers = {robot.id: VehicleWatcher(robot, config, changed.set) for robot in config.robots}
    for watcher in watchers.values():
        watcher.start()
    obeyed = [0]
    # What a driver prints goes to the log.
    out = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    told = (out, watchers, changed, obeyed)
    threading.Thread(target=_print_report, args=told, daemon=True).start()
    for line in sys.stdin.buffer:
        wanted = MonitorRequest.model_validate_json(line)
        for name, watcher in watchers.items():
            watcher.want(wanted=name in wanted.robots)
        # Last: who reads this number finds each vehicle held, or never to be held again.
        obeyed[0] = wanted.number
        changed.set()
    # Without closing a vehicle: one that somebody flies by now would be commanded to land.
    os._exit(0)


def _print_report(
    out: TextIO,
    watchers: dict[str, VehicleWatcher],
    changed: threading.Event,
    obeyed: list[int],
) -> None:
    while True:
        changed.wait(_TELL_SECONDS)
        changed.clear()
        # The number first, see `main`.
        number = obeyed[0]
        robots = {name: watcher.report for name, watcher in watchers.items()}
        out.write(f"{MonitorReport(number=number, robots=robots).model_dump_json()}\n")
        out.flush()
        time.sleep(_LEAST_SECONDS)


if __name__ == "__main__":
    main()
